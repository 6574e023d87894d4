use swerve_msg::PlanPoint;

use super::*;
use swerve_localization::lateral_velocity::steady_mps;

const SPEED_MPS: f64 = 8.0;

/// State on a drive along x at 10 ms steps, `off_m` to the left of the axis.
fn state(step: i64, off_m: f64) -> EgoState {
    let x_m = SPEED_MPS * 0.01 * step as f64;
    let pose = Pose2::new(x_m, off_m, 0.0);
    EgoState { stamp: Time::from_ms(10 * step), pose, speed_mps: SPEED_MPS, ..EgoState::default() }
}

/// Steps of 10 ms until the time constant of corrections is reached: 0.5 s are a quarter of 2 s.
const BEFORE: i64 = 200;

/// Local poses of two seconds without error and `steps` with one.
fn with_step(off_m: f64, steps: i64) -> Vec<LocalPose> {
    let mut odometer = Odometer::new([0.0; 3]);
    let off_m = |step: i64| if step < BEFORE { 0.0 } else { off_m };
    (0..BEFORE + steps).map(|step| odometer.advance(&state(step, off_m(step)), 0.0)).collect()
}

#[test]
fn odometry_has_no_jump_where_the_pose_jumps() {
    for pair in with_step(0.3, 100).windows(2) {
        let moved = pair[1].odom.point() - pair[0].odom.point();
        assert!((moved.x - 0.08).abs() < 1e-12 && moved.y.abs() < 1e-12, "{pair:?}");
    }
}

#[test]
fn correction_enters_with_its_time_constant() {
    let poses = with_step(0.2, 100);
    let off_m = |step: usize| poses[step].to_map(poses[step].odom).y_m;
    // One step of 10 ms, then half a second: 1 - exp(-t / 0.5 s) of it.
    assert!((off_m(200) - 0.2 * (1.0 - swerve_geom::math::exp(-0.02))).abs() < 1e-9);
    assert!((off_m(249) - 0.2 * (1.0 - swerve_geom::math::exp(-1.0))).abs() < 1e-9);
}

#[test]
fn correction_at_the_start_enters_at_once() {
    // 0.2 m from the second step on: 98 % of it, 1 - exp(-1 / 0.25), with the first, as the time constant is a quarter
    // of 10 ms.
    let mut odometer = Odometer::new([0.0; 3]);
    odometer.advance(&state(0, 0.0), 0.0);
    let pose = odometer.advance(&state(1, 0.2), 0.0);
    let entered_m = 0.2 * (1.0 - swerve_geom::math::exp(-4.0));
    assert!((pose.to_map(pose.odom).y_m - entered_m).abs() < 1e-9, "{pose:?}");
}

#[test]
fn large_correction_leaves_at_most_the_largest_lag() {
    let first = with_step(3.0, 1).pop().unwrap();
    assert!((first.to_map(first.odom).y_m - (3.0 - LAG_MAX_M)).abs() < 1e-9);
}

#[test]
fn odometry_includes_the_onset_of_a_swerve() {
    const FINE: i64 = 100;
    const LEVER_M: f64 = 1.3;
    let speed_mps = 18.0;
    // Into a turn of 0.4 rad/s; the rear slips outwards on its tyres a tenth of a second later.
    let yaw_radps = |t: f64| (2.0 * t).clamp(0.0, 0.4);
    let late_mps = |t: f64| steady_mps(speed_mps, yaw_radps(t - 0.1));
    let mut odometer = Odometer::new([LEVER_M, 0.0, 0.5]);
    let (mut way, mut course) = (Pose2::<Odom>::default(), Pose2::<Odom>::default());
    for step in 0..40 {
        let t = 0.01 * step as f64;
        let (before, after) = (t - 5e-3, t + 5e-3);
        let gained_mps2 =
            (late_mps(after) - late_mps(before) + LEVER_M * (yaw_radps(after) - yaw_radps(before))) / 0.01;
        let state = EgoState {
            stamp: Time::from_ms(10 * step),
            speed_mps,
            yaw_rate_radps: yaw_radps(t),
            lateral_accel_mps2: speed_mps * yaw_radps(t) + gained_mps2,
            ..EgoState::default()
        };
        let local = odometer.advance(&state, 0.0);
        assert!(local.odom.point().distance(way.point()) < 0.02, "{t}: {local:?} {way:?}");
        for k in 0..FINE {
            let (t, dt_s) = (t + 1e-4 * (k as f64 + 0.5), 1e-4);
            way = moved(way, Point2::new(speed_mps * dt_s, late_mps(t) * dt_s), yaw_radps(t) * dt_s);
            course = moved(course, Point2::new(speed_mps * dt_s, 0.0), yaw_radps(t) * dt_s);
        }
    }
    // Without the slip of the rear.
    assert!(course.point().distance(way.point()) > 0.06);
}

#[test]
fn ego_and_plan_keep_their_distance_over_a_correction() {
    let poses = with_step(0.3, 50);
    let (then, now) = (poses[199], poses[220]);
    let point = PlanPoint { pose: Pose2::new(9.0, 0.1, 0.02), ..PlanPoint::default() };
    let plan = Plan { points: vec![point], ..Plan::default() };
    let mut kept = LocalPoses::default();
    kept.kept.extend(&poses);
    // The ego at `now`, in the map as the plan knew it, is where dead reckoning puts it: on the line.
    let ego = kept.state(&state(220, 0.3), Some(then));
    assert!((ego.pose.x_m - 17.6).abs() < 1e-9 && ego.pose.y_m.abs() < 1e-9, "{ego:?}");
    // The plan keeps its distance to the ego in the map of `now`.
    let carried = carried(&plan, Some(then), Some(now)).unwrap();
    let beside: Point2<Ego> = now.to_map(now.odom).to_local(carried.points[0].pose.point());
    let before: Point2<Ego> = ego.pose.to_local(point.pose.point());
    assert!(beside.distance(before) < 1e-9 && (carried.points[0].pose.heading_rad - 0.02).abs() < 1e-9);
}

#[test]
fn poses_and_plans_are_unchanged_without_localization() {
    let measured = state(7, 0.25);
    assert_eq!(LocalPoses::default().state(&measured, None), measured);
    assert_eq!(carried(&Plan::default(), None, None), None);
    let known = with_step(0.0, 1).pop();
    assert_eq!(carried(&Plan::default(), known, known), None);
}
