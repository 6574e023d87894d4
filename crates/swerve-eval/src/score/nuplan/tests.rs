use super::*;

/// A car of 4 m by 2 m whose rear axle is 1 m ahead of its rear, at `x_m`, with constant speed.
fn ego(x_m: f64, speed_mps: f64) -> EgoState {
    EgoState {
        rear_axle: Pose2::new(x_m - 1.0, 0.0, 0.0),
        outline: Obb::new(Pose2::new(x_m, 0.0, 0.0), 4.0, 2.0),
        speed_mps,
        lon_accel_mps2: 0.0,
        lat_accel_mps2: 0.0,
    }
}

/// A drive along x at constant speed in one lane.
fn drive(n: u32, speed_mps: f64) -> Vec<Step> {
    let step = |k: u32| {
        let x_m = speed_mps * PERIOD_S * f64::from(k);
        let lane = LaneFacts {
            lane: Some((1, 10.0 + x_m)),
            limits_mps: vec![10.0],
            in_one_lane: true,
            ..LaneFacts::default()
        };
        Step { ego: ego(x_m, speed_mps), tracks: Vec::new(), lane }
    };
    (0..n).map(step).collect()
}

fn track(id: u64, kind: TrackKind, (x_m, y_m, heading_rad): (f64, f64, f64), speed_mps: f64) -> Track {
    Track { id, kind, outline: Obb::new(Pose2::new(x_m, y_m, heading_rad), 4.0, 2.0), speed_mps }
}

const GOOD: Progress = Progress { ego_m: 50.0, expert_m: 50.0 };

#[test]
fn faultless_drive_scores_one() {
    let score = closed_loop(&drive(51, 10.0), GOOD).unwrap();
    assert_eq!(score.score, 1.0, "{score:?}");
    assert_eq!(closed_loop(&drive(3, 10.0), GOOD), None);
    assert_eq!((mean(&[score, ClosedLoopScore { score: 0.5, ..score }]), mean(&[])), (Some(0.75), None));
}

#[test]
fn score_weighs_progress_and_time_to_collision_most() {
    let mut steps = drive(51, 10.0);
    // Half of the progress, and over the limit by half of the threshold.
    steps.iter_mut().for_each(|step| step.lane.limits_mps = vec![10.0 - OVERSPEED_MPS / 2.0]);
    let score = closed_loop(&steps, Progress { ego_m: 25.0, expert_m: 50.0 }).unwrap();
    let excess = 51.0 / 50.0 * 0.5;
    assert!((score.speed - (1.0 - excess)).abs() < 1e-12, "samples over duration: {score:?}");
    let wanted = (5.0 * 0.5 + 5.0 + 4.0 * (1.0 - excess) + 2.0) / 16.0;
    assert!((score.score - wanted).abs() < 1e-12, "{score:?}");
    steps[20].lane.corner_outside_m = 0.3;
    assert_eq!(closed_loop(&steps, GOOD).unwrap().score, 0.0);
}

#[test]
fn speed_limit_of_a_connector_is_the_highest_of_its_neighbours() {
    let mut steps = drive(11, 12.0);
    assert!((speed(&steps) - (1.0 - 11.0 / 10.0 * 2.0 / OVERSPEED_MPS).max(0.0)).abs() < 1e-12);
    for limits in [vec![8.0, 12.0], Vec::new(), vec![8.0, 0.0]] {
        steps.iter_mut().for_each(|step| step.lane.limits_mps.clone_from(&limits));
        assert_eq!(speed(&steps), 1.0, "{limits:?}: no limit is exceeded, or none is known");
    }
    assert_eq!(speed(&steps[..1]), 1.0);
}

#[test]
fn progress_is_at_least_two_metres() {
    let ratio = |ego_m: f64, expert_m: f64| progress_ratio(Progress { ego_m, expert_m });
    assert_eq!([ratio(30.0, 60.0), ratio(70.0, 60.0), ratio(0.0, 60.0)], [0.5, 1.0, 2.0 / 60.0]);
    assert_eq!([ratio(0.5, 1.0), ratio(-1.9, 0.0), ratio(-2.1, 0.0)], [1.0, 1.0, 0.0]);
    let making = |ego_m: f64| closed_loop(&drive(11, 10.0), Progress { ego_m, expert_m: 50.0 }).unwrap();
    assert_eq!((making(10.0).making_progress, making(9.9).making_progress), (1.0, 0.0));
}

#[test]
fn direction_is_judged_by_the_way_back_in_one_second() {
    let backwards = |speed_mps: f64| {
        let mut steps = drive(31, 0.0);
        for (k, step) in steps.iter_mut().enumerate() {
            step.lane.lane = Some((1, 50.0 - speed_mps * PERIOD_S * k as f64));
        }
        direction(&steps)
    };
    // The window of one second holds 11 steps: 1.8 m/s is 1.98 m.
    assert_eq!([backwards(1.8), backwards(1.82), backwards(5.45), backwards(5.46)], [1.0, 0.5, 0.5, 0.0]);
    assert_eq!(direction(&drive(31, 10.0)), 1.0);
    // A change of lane is no progress in either.
    let mut steps = drive(31, 0.0);
    steps[15..].iter_mut().for_each(|step| step.lane.lane = Some((2, 0.5)));
    assert_eq!(direction(&steps), 1.0);
}

#[test]
fn fault_depends_on_the_kind_of_contact() {
    // The ego's outline covers x from -2 to 2 and y from -1 to 1.
    let fault = |speed_mps: f64, track: Track, in_one_lane: bool| {
        let mut steps = drive(1, 0.0);
        steps[0].ego = ego(0.0, speed_mps);
        steps[0].lane.in_one_lane = in_one_lane;
        steps[0].tracks = vec![track];
        let Impacts(found) = impacts(&steps);
        found.first().map(|impact| impact.at_fault)
    };
    let car = |at, speed_mps| track(1, TrackKind::Vehicle, at, speed_mps);
    assert_eq!(fault(5.0, car((10.0, 0.0, 0.0), 5.0), true), None);
    assert_eq!(fault(0.05, car((3.9, 0.0, 0.0), 5.0), true), Some(false), "the ego stands");
    assert_eq!(fault(5.0, car((3.9, 0.0, 0.0), 5.0), true), Some(true), "front");
    assert_eq!(fault(5.0, car((-3.9, 0.0, 0.0), 9.0), true), Some(false), "rear");
    assert_eq!(fault(5.0, car((-3.9, 0.0, 0.0), 0.0), true), Some(true), "the track stands");
    assert_eq!(fault(5.0, car((-0.5, 1.9, 0.0), 5.0), true), Some(false), "side, in one lane");
    assert_eq!(fault(5.0, car((-0.5, 1.9, 0.0), 5.0), false), Some(true), "side, between lanes");
}

#[test]
fn each_track_collides_once_and_one_object_leaves_half() {
    let factor = |vru, vehicle, object| AtFault { vru, vehicle, object }.factor();
    assert_eq!([factor(0, 0, 0), factor(0, 0, 1), factor(0, 0, 2)], [1.0, 0.5, 0.0]);
    assert_eq!([factor(1, 0, 0), factor(0, 1, 0), factor(0, 1, 1)], [0.0; 3]);
    let mut steps = drive(11, 10.0);
    let cone = track(7, TrackKind::Object, (8.0, 0.0, 0.0), 3.0);
    steps.iter_mut().for_each(|step| step.tracks = vec![cone]);
    let found = impacts(&steps);
    // The front reaches x = 6 after 0.4 s.
    assert_eq!(found.0, [Impact { step: 4, track: 7, kind: TrackKind::Object, at_fault: true }]);
    let times = times_to_collision_s(&steps, &found);
    assert_eq!(times[4], Some(0.0));
    assert!(times[5..].iter().all(Option::is_none), "a track that was hit is left out");
    assert_eq!(closed_loop(&steps, GOOD).unwrap().no_collisions, 0.5);
}

#[test]
fn time_to_collision_is_sampled_in_tenths() {
    let time = |at: (f64, f64, f64), speed_mps: f64, set: fn(&mut Step)| {
        let mut steps = drive(1, 10.0);
        steps[0].tracks = vec![track(1, TrackKind::Vehicle, at, speed_mps)];
        set(&mut steps[0]);
        times_to_collision_s(&steps, &Impacts::default())[0].map(|time_s| (time_s * 10.0).round() as i64)
    };
    // A gap of 9.5 m at 10 m/s: 0.95 s, found at 1.0 s; the longest that is seen is 2.9 s.
    assert_eq!(time((13.5, 0.0, 0.0), 0.0, |_| {}), Some(10));
    assert_eq!(time((12.9, 0.0, 0.0), 0.0, |_| {}), Some(9));
    assert_eq!(time((18.5, 0.0, 0.0), 5.0, |_| {}), Some(29));
    assert_eq!(time((33.1, 0.0, 0.0), 0.0, |_| {}), None);
    assert_eq!(time((13.5, 0.0, 0.0), 0.0, |step| step.ego.speed_mps = 5e-3), None, "the ego stands");
    // Coming from the side, at 34 degrees: counts only between lanes or in an intersection.
    let crossing = (8.0, 6.0, -core::f64::consts::FRAC_PI_2);
    assert_eq!(time(crossing, 6.0, |_| {}), None);
    assert_eq!(time(crossing, 6.0, |step| step.lane.in_intersection = true), Some(5));
    assert_eq!(time(crossing, 6.0, |step| step.lane.in_one_lane = false), Some(5));
    // From behind never.
    assert_eq!(time((-6.0, 0.0, 0.0), 30.0, |step| step.lane.in_intersection = true), None);
}

#[test]
fn expert_follows_the_closed_form_of_the_free_model() {
    let driver = FreeDriver::default();
    // Time to reach a share u of the desired speed: v0 / a (atanh(u) + atan(u)) / 2.
    let (limit_mps, u) = (10.0, 0.8_f64);
    let (log, angle) = (0.5 * libm::log((1.0 + u) / (1.0 - u)), libm::atan(u));
    let time_s = limit_mps / driver.accel_mps2 * 0.5 * (log + angle);
    let slow = expert_progress_m(1e4, &[(0.0, limit_mps)], (0.0, time_s), driver);
    // Way: integral of v dv / (a (1 - u^4)) = v0² / (4 a) ln((1 + u²) / (1 - u²)).
    let way_m = limit_mps * limit_mps / (4.0 * driver.accel_mps2) * libm::log((1.0 + u * u) / (1.0 - u * u));
    assert!((slow - way_m).abs() < 1e-3, "{slow} {way_m}");
    // At the limit it stays there; a lower one is reached with the comfortable deceleration.
    let cruise = |limits: &[(f64, f64)]| expert_progress_m(1e3, limits, (10.0, 10.0), driver);
    assert!((cruise(&[(0.0, 10.0)]) - 100.0).abs() < 1e-9);
    assert!((cruise(&[(0.0, 10.0), (50.0, 5.0)]) - 50.0).abs() < 50.0);
    assert!(cruise(&[(0.0, 10.0), (50.0, 5.0)]) < 90.0);
    assert_eq!(expert_progress_m(80.0, &[(0.0, 10.0)], (10.0, 10.0), driver), 80.0);
    assert_eq!(cruise(&[]), 0.0);
}
