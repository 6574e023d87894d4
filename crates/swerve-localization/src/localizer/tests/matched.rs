//! Poses from map matching, which arrive late by the run time of the matcher.

use super::*;

/// Standard deviations of the position across the path, metres, and of the heading, radians.
const PLACE_M: f64 = 0.05;
const HEADING_RAD: f64 = 0.002;

/// Measurements of the drive with ten poses per second, each with its time of arrival. The standard deviation of
/// positions along the path is `along_m`.
fn arriving(drive: &mut Drive, seconds: usize, along_m: f64) -> Vec<(Time, Time, Sensed)> {
    let way = drive.way(seconds);
    let mut all: Vec<_> =
        drive.measured(seconds).into_iter().map(|(stamp, what)| (stamp, stamp, what)).collect();
    let mut rng = Rng::keyed(5, "matches", &[]);
    for (k, at) in way.into_iter().enumerate().skip(50).step_by(10) {
        let stamp = Time::ZERO + Span::from_ms(10 * k as i64);
        let yaw = Drive::turn(k as f64 * 0.01)[0];
        let (sin, cos) = math::sin_cos(yaw);
        let [a, b] = [along_m, PLACE_M].map(|sigma| sigma * rng.normal());
        let at_m = [at[0] + cos * a - sin * b, at[1] + sin * a + cos * b, PLACE_M * rng.normal()];
        let [aa, bb] = [along_m * along_m, PLACE_M * PLACE_M];
        let covariance_m2 =
            [cos * cos * aa + sin * sin * bb, cos * sin * (aa - bb), sin * sin * aa + cos * cos * bb];
        let heading_rad = yaw + HEADING_RAD * rng.normal();
        let what = Sensed::Pose { at_m, heading_rad, covariance_m2, sigma: [PLACE_M, HEADING_RAD] };
        let late = Span::from_ms(20 + rng.below(80) as i64);
        all.push((stamp + late, stamp, what));
    }
    all.sort_by_key(|(arrival, stamp, _)| (*arrival, *stamp));
    all
}

/// Root mean square errors on the ground along and across the path after 5 s, and the localizer at the end.
fn driven(along_m: f64) -> ([f64; 2], Localizer) {
    let mut drive = Drive::new(2, Params::default());
    let (way, all) = (drive.way(20), arriving(&mut drive, 20, along_m));
    let mut localizer = drive.localizer();
    let (mut squares, mut count) = ([0.0; 2], 0.0);
    for (arrival, stamp, what) in all {
        assert_ne!(localizer.take(stamp, what), Taken::TooLate);
        let k = (arrival - Time::ZERO).ns() / 10_000_000;
        let newest = localizer.estimate().filter(|estimate| estimate.stamp == arrival && k > 500);
        let Some(estimate) = newest else { continue };
        let [x, y] = error_m(&estimate, way[k as usize]);
        let (sin, cos) = math::sin_cos(Drive::turn(k as f64 * 0.01)[0]);
        for (sum, e) in squares.iter_mut().zip([x * cos + y * sin, y * cos - x * sin]) {
            *sum += e * e;
        }
        count += 1.0;
    }
    (squares.map(|square: f64| (square / count).sqrt()), localizer)
}

/// The goal for a filter with poses of 5 cm is 3 cm; fixes have an error of half a metre here.
#[test]
fn late_poses_make_it_better_than_each_of_them() {
    let ([along, across], localizer) = driven(PLACE_M);
    println!("rms along {along:.4} m, across {across:.4} m");
    assert!(math::hypot(along, across) < 0.03, "{along} {across}");
    let heading = localizer.tally(Source::Heading);
    assert!(heading.taken > 190 && heading.refused < 5, "{heading:?}");
    assert!((heading.nis_sum / heading.taken as f64 - 1.0).abs() < 0.3, "{heading:?}");
}

/// A match that does not constrain the position along the road keeps the car in its lane, without jumps along it.
#[test]
fn direction_unseen_by_the_matcher_is_estimated_from_other_sensors() {
    let ([along, across], _) = driven(10.0);
    println!("rms along {along:.4} m, across {across:.4} m");
    assert!(across < 0.05 && along < 1.0, "{along} {across}");
}

#[test]
fn late_poses_give_the_same_bits_as_timely_ones() {
    let mut drive = Drive::new(3, Params::default());
    let mut late = arriving(&mut drive, 6, PLACE_M);
    let mut as_they_come = drive.localizer();
    let mut in_time = as_they_come.clone();
    for (_, stamp, what) in &late {
        as_they_come.take(*stamp, *what);
    }
    late.sort_by_key(|(_, stamp, _)| *stamp);
    for (_, stamp, what) in &late {
        in_time.take(*stamp, *what);
    }
    assert_eq!(bits(&as_they_come), bits(&in_time));
}
