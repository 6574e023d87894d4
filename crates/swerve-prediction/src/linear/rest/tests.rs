use super::*;
use swerve_core::Rng;
use swerve_geom::{Pose2, Vector2};
use swerve_msg::{ActorId, ActorKind, Extent, Track, TrackList};

use crate::linear::{Params, predict};
use crate::{Ground, Horizon, PredictorName, predict as predict_by_name};

/// A pedestrian with sightings every 50 ms up to now: `place(t)` in metres at `t` seconds (negative), reported to
/// move at `reported_mps` along y.
fn person(reported_mps: f64, mut place: impl FnMut(f64) -> [f64; 2]) -> Track {
    let at = |k: i64| {
        let [x_m, y_m] = place(-0.05 * (12 - k) as f64);
        Sighting { at: Time::from_ms(50 * k), point: Point2::new(x_m, y_m) }
    };
    let history: Vec<Sighting> = (0..=12).map(at).collect();
    let last = history[12].point;
    Track {
        id: ActorId(3),
        kind: ActorKind::Pedestrian,
        pose: Pose2::new(last.x_m, last.y_m, 1.0),
        extent: Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 },
        velocity_mps: Vector2::new(0.0, reported_mps),
        history,
    }
}

/// Predicted distance over two seconds, metres.
fn way_m(track: Track) -> f64 {
    let list = TrackList { stamp: Time::from_ms(600), tracks: vec![track] };
    let path = &predict(&list, &Params::default()).predictions[0].path;
    path[0].pose.point().distance(path[40].pose.point())
}

/// The slope of a line through five of these sightings has a deviation of 0.02 / (0.05 sqrt 10) = 0.126 m/s on each
/// axis: 0.3 m and more in two seconds.
#[test]
fn standing_person_with_noise_of_two_centimetres_stays() {
    let mut rng = Rng::keyed(5, "noise", &[]);
    let moving = (0..500).filter(|_| {
        let reported_mps = 0.02 * rng.normal();
        way_m(person(reported_mps, |_| [4.0 + 0.02 * rng.normal(), 0.02 * rng.normal()])) > 0.0
    });
    // Three standard errors of 3 cm are 4.5 of 2 cm.
    assert_eq!(moving.count(), 0);
}

#[test]
fn drift_of_a_pose_estimate_is_not_a_motion() {
    // 0.1 m/s without noise, which the reported velocity does not include.
    assert_eq!(way_m(person(0.0, |t| [4.0, 0.1 * t])), 0.0);
    // The fit of the paper extrapolates it.
    let list = TrackList { stamp: Time::from_ms(600), tracks: vec![person(0.0, |t| [4.0, 0.1 * t])] };
    let paper = predict(&list, &Params { rest_speed_mps: 0.0, ..Params::default() });
    assert!((paper.predictions[0].path[40].pose.y_m - 0.2).abs() < 1e-9);
}

/// As by the fit alone from the first frame on: 0.2, 0.5, 0.8 and then all of the speed.
#[test]
fn person_who_sets_off_slowly_is_extrapolated_at_once_where_the_velocity_is_reported() {
    for (frames, share) in [(1, 0.2), (2, 0.5), (3, 0.8), (4, 1.0)] {
        let set_off = |t: f64| [4.0, 0.3 * (t + 0.05 * f64::from(frames)).max(0.0)];
        assert!((way_m(person(0.3, set_off)) - 0.3 * share * 2.0).abs() < 1e-9, "{frames}");
    }
}

#[test]
fn person_who_sets_off_is_extrapolated_soon_where_no_velocity_is_reported() {
    // Number of frames after which a motion is significant: 0.3 m/s after 9 cm, 1.4 m/s after 0.15 s.
    for (speed_mps, frames) in [(0.3, 6), (1.4, 3)] {
        let set_off = |frames: i32| move |t: f64| [4.0, speed_mps * (t + 0.05 * f64::from(frames)).max(0.0)];
        assert!(way_m(person(0.0, set_off(frames))) > 1.5 * speed_mps, "{speed_mps}");
        assert_eq!(way_m(person(0.0, set_off(1))), 0.0, "{speed_mps}");
    }
}

#[test]
fn place_at_rest_is_the_mean_of_the_newest_sightings() {
    let track = person(0.0, |t| [4.0, if t < -0.3 { 0.0 } else { 0.01 }]);
    let settled = settled(&track.history, track.velocity_mps, REST_MPS);
    assert!(settled.iter().all(|one| (one.point.y_m - 0.01).abs() < 1e-12 && one.point.x_m == 4.0));
    // Sightings older than the window are kept.
    let mut long = track.history.clone();
    long.insert(0, Sighting { at: Time::from_ms(-500), point: Point2::new(1.0, 1.0) });
    assert_eq!(super::settled(&long, track.velocity_mps, REST_MPS)[0], long[0]);
}

#[test]
fn two_sightings_are_extrapolated() {
    let history = &person(0.0, |t| [4.0, 0.05 * t]).history[11..];
    assert!(matches!(settled(history, Vector2::default(), REST_MPS), Cow::Borrowed(_)));
}

/// Every predictor that uses tracks gives the same prediction for noisy sightings as for exact ones.
#[test]
fn no_predictor_extrapolates_the_scatter_of_a_standing_person() {
    let mut rng = Rng::keyed(6, "noise", &[]);
    let horizon = Horizon { steps: 40, step: swerve_core::Span::from_ms(100) };
    let track = person(0.0, |_| [4.0 + 0.02 * rng.normal(), 0.02 * rng.normal()]);
    let place = settled(&track.history, track.velocity_mps, REST_MPS)[12].point;
    let exact = person(0.0, |_| [place.x_m, place.y_m]);
    let ends = |name: PredictorName, track: &Track| -> Vec<Point2> {
        let list = TrackList { stamp: Time::from_ms(600), tracks: vec![track.clone()] };
        let modes = predict_by_name(name, &list, &horizon, Ground::Open).predictions;
        modes.iter().map(|mode| mode.path[40].pose.point()).collect()
    };
    for name in PredictorName::ALL {
        for (end, wanted) in ends(name, &track).iter().zip(ends(name, &exact)) {
            assert!(end.distance(wanted) < 0.05, "{name:?}: {end:?} {wanted:?}");
        }
    }
}
