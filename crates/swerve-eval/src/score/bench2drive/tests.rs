use super::super::leaderboard::Counts;
use super::*;

fn record(completion: f64, counts: Counts, percent: &[f64]) -> RouteRecord {
    RouteRecord {
        route_length_m: 150.0,
        route_completion: completion,
        counts,
        min_speed_checkpoints_percent: percent.to_vec(),
        ..RouteRecord::default()
    }
}

#[test]
fn sums_are_divided_by_220_routes() {
    let hit = Counts { collisions_vehicle: 1, ..Counts::default() };
    let records = [
        record(100.0, Counts::default(), &[50.0, 150.0]),
        record(100.0, hit, &[80.0]),
        record(40.0, hit, &[]),
    ];
    let found = bench2drive(&records);
    assert!((found.driving_score - (100.0 + 60.0 + 24.0) / 220.0).abs() < 1e-12, "{found:?}");
    assert_eq!(found.success_rate, 1.0 / 220.0);
    assert_eq!(found.efficiency_percent, Some(90.0));
    assert_eq!(route_score(&records[0]).status, Status::Completed);
    assert!(is_success(&records[0]) && !is_success(&records[1]) && !is_success(&records[2]));
    assert_eq!(bench2drive(&[]).efficiency_percent, None);
}

#[test]
fn slow_checkpoints_cost_nothing_and_extreme_ones_do_not_count() {
    let slow = record(100.0, Counts::default(), &[10.0, 1000.0, 1000.01, 20.006]);
    assert_eq!(route_score(&slow).penalty, 1.0);
    assert_eq!(efficiency_percent(&slow), Some((10.0 + 1000.0 + 20.01) / 3.0));
    assert_eq!(efficiency_percent(&record(100.0, Counts::default(), &[2000.0])), None);
}

fn steady(n: usize, motion: Motion) -> Vec<Motion> {
    vec![motion; n]
}

#[test]
fn comfort_is_the_share_of_whole_pieces() {
    let calm = Motion { lon_accel_mps2: 1.0, ..Motion::default() };
    let hard = Motion { lon_accel_mps2: -4.1, ..Motion::default() };
    let share = |drive: &[Motion]| comfort(drive, YawAccel::SmoothedYawRate);
    assert_eq!(share(&steady(20, calm)), Some(1.0));
    assert_eq!(share(&steady(20, hard)), Some(0.0));
    let mixed = [steady(20, calm), steady(20, hard), steady(20, calm)].concat();
    assert_eq!(share(&mixed), Some(2.0 / 3.0));
    assert_eq!(share(&[steady(40, calm), steady(19, hard)].concat()), Some(1.0), "the rest does not count");
    assert_eq!(share(&steady(2, calm)), None);
    // A step of the acceleration inside a piece is a jerk: 2 m/s² in 0.1 s.
    assert_eq!(
        share(&[steady(10, calm), steady(10, Motion { lon_accel_mps2: -1.0, ..calm })].concat()),
        Some(0.0)
    );
}

#[test]
fn published_yaw_acceleration_is_the_yaw_rate() {
    // A yaw rate that rises by 2 rad/s² from -0.9 to 0.9 rad/s is within the limit of the rate, not of its derivative.
    let turn = |rate: f64| -> Vec<Motion> {
        (0..10)
            .map(|k| Motion { yaw_rate_radps: rate * (0.1 * f64::from(k) - 0.45), ..Motion::default() })
            .collect()
    };
    let both = |drive: &[Motion]| {
        [YawAccel::SmoothedYawRate, YawAccel::Derived].map(|yaw_accel| comfort(drive, yaw_accel))
    };
    assert_eq!(both(&turn(2.0)), [Some(1.0), Some(0.0)]);
    assert_eq!(both(&turn(1.9)), [Some(1.0), Some(1.0)]);
}

#[test]
fn comfort_matches_scipys_filter() {
    // Amplitude, frequency per sample, and the shares, computed with `scipy.signal.savgol_filter` (window 7,
    // order 2) in the order of operations of Bench2Drive's code: with the yaw rate as yaw acceleration, and derived.
    for (a, w, wanted) in [
        (1.5, 0.06, [1.0, 1.0]),
        (1.5, 0.2, [1.0, 1.0]),
        (1.5, 0.3, [0.6, 0.5]),
        (2.5, 0.06, [0.9, 0.9]),
        (2.5, 0.12, [0.7, 0.7]),
        (2.5, 0.2, [0.6, 0.6]),
        (2.5, 0.3, [0.2, 0.0]),
        (3.5, 0.06, [0.5, 0.5]),
        (3.5, 0.12, [0.3, 0.3]),
        (3.5, 0.2, [0.2, 0.1]),
        (3.5, 0.3, [0.0, 0.0]),
    ] {
        let (sin, cos) = (math::sin, math::cos);
        let motion = |k: u32| {
            let k = f64::from(k);
            Motion {
                lon_accel_mps2: 0.8 * a * sin(w * k) * cos(0.02 * k),
                lat_accel_mps2: a * sin(0.7 * w * k + 1.0) * sin(0.015 * k),
                yaw_rate_radps: 0.4 * a * sin(w * k + 0.5) * sin(0.01 * k),
            }
        };
        let drive: Vec<Motion> = (0..210).map(motion).collect();
        let found = [YawAccel::SmoothedYawRate, YawAccel::Derived].map(|kind| comfort(&drive, kind).unwrap());
        assert_eq!(found, wanted, "{a} {w}");
    }
}
