use swerve_core::Time;
use swerve_geom::{Point2, Polyline, Pose2};
use swerve_msg::{ActorKind, PlanPoint, PredictedPose};

use super::*;

#[test]
fn speed_falls_with_the_deviation_of_the_pose() {
    let share = |sigma_m: f64| speed_share(sigma_m, [0.4, 1.0]);
    for (sigma_m, share_of_speed) in [(0.0, 1.0), (0.4, 1.0), (0.7, 0.65), (1.0, 0.3), (50.0, 0.3)] {
        assert!((share(sigma_m) - share_of_speed).abs() < 1e-12, "{sigma_m}");
    }
    assert_eq!(speed_share(1e9, [f64::MAX; 2]), 1.0, "the paper's planners do not");
    assert!((speed_share(0.5, [0.4, 0.4]) - SLOWEST).abs() < 1e-12);
}

fn route() -> Route {
    let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(200.0, 0.0)]).unwrap();
    Route::uniform(line, 4.0, 2.0)
}

fn trust(lane_sigmas: f64) -> PoseTrust {
    let shape = Shape { width_m: 1.9, length_m: 5.0, rear_overhang_m: 1.0, ..Shape::default() };
    PoseTrust::new([9.0, 9.0], lane_sigmas, shape)
}

/// Obstacle ahead of an ego at 50 m with 6 m/s, on a road along x of 4 m to the left and 2 m to the right.
fn ahead(trust: &mut PoseTrust, along_m: f64, across_m: f64) -> Option<Prediction> {
    uncertain(trust, along_m, across_m);
    let pose = Pose2::new(50.0, 0.0, 0.0);
    stop(trust, &EgoState { pose, speed_mps: 6.0, ..EgoState::default() }).map(|stop| stop.wall)
}

fn uncertain(trust: &mut PoseTrust, along_m: f64, across_m: f64) {
    let covariance = [along_m * along_m, 0.0, across_m * across_m, 0.0, 0.0, 0.0];
    trust.quality = Some(PoseQuality { covariance, ..PoseQuality::default() });
}

fn here<'a>(ego: &'a EgoState, route: &'a Route) -> Here<'a> {
    Here { ego, place: route.project(ego.pose.point()), route }
}

fn stop(trust: &mut PoseTrust, ego: &EgoState) -> Option<Stop> {
    trust.stop(here(ego, &route()))
}

#[test]
fn ego_stops_where_two_deviations_do_not_fit_beside_it() {
    let mut trust = trust(2.0);
    // 2 - 0.95 = 1.05 m to the nearer edge: two deviations of 0.525 m fit.
    assert!([0.1, 0.52].iter().all(|&sigma_m| ahead(&mut trust, 0.1, sigma_m).is_none()));
    assert!(ahead(&mut trust, 3.0, 0.1).is_none(), "a place that is open along the lane is in the lane");
    let wall = ahead(&mut trust, 0.1, 0.53).unwrap();
    // The front is 4 m ahead of the origin; 3 m/s2 build up within 3 m and stop 6 m/s within 6 m; 2 m are left.
    let near_m = wall.path[0].pose.x_m - 0.5 * wall.extent.length_m;
    assert!((near_m - 65.0).abs() < 1e-9 && wall.extent.width_m == 6.0, "{wall:?}");
    let status = |trust: &PoseTrust, status| trust.explained(Plan { status, ..Plan::default() }).status;
    assert_eq!(status(&trust, PlanStatus::Comfortable), PlanStatus::PoseUncertain);
    assert_eq!(status(&trust, PlanStatus::Brake), PlanStatus::Brake, "an emergency is one");
    // 1.1 times two deviations fit from 0.477 m on.
    assert!(ahead(&mut trust, 0.1, 0.48).is_some() && ahead(&mut trust, 0.1, 0.47).is_none());
    assert_eq!(status(&trust, PlanStatus::Comfortable), PlanStatus::Comfortable);
}

#[test]
fn ego_stops_earlier_while_fixes_have_more_noise_than_reported() {
    let mut trust = trust(2.0);
    // Three deviations of 0.35 m in place of two of 0.525 m.
    for (mode, across_m, stops) in [
        (PoseMode::Noisy, 0.34, false),
        (PoseMode::Noisy, 0.36, true),
        (PoseMode::Good, 0.36, false),
        (PoseMode::Coasting, 0.36, false),
    ] {
        trust.stop_s_m = None;
        let covariance = [0.01, 0.0, across_m * across_m, 0.0, 0.0, 0.0];
        trust.quality = Some(PoseQuality { mode, covariance, ..PoseQuality::default() });
        assert_eq!(stop(&mut trust, &at(6.0)).is_some(), stops, "{mode:?} {across_m}");
    }
}

/// A pose with deviations of 0.315 m across the lane and 0.0105 rad in heading: two deviations fill the 1.05 m beside
/// the car after 40 m.
fn reckoning(trust: &mut PoseTrust, mode: PoseMode) {
    let covariance = [0.0, 0.0, 0.315 * 0.315, 0.0, 0.0, 0.0105 * 0.0105];
    trust.quality = Some(PoseQuality { mode, covariance, ..PoseQuality::default() });
}

fn at(speed_mps: f64) -> EgoState {
    EgoState { pose: Pose2::new(50.0, 0.0, 0.0), speed_mps, ..EgoState::default() }
}

#[test]
fn speed_allows_a_stop_by_dead_reckoning_in_the_lane() {
    let mut trust = trust(2.0);
    let mut speed = |mode, good_m| {
        reckoning(&mut trust, mode);
        trust.good_m = good_m;
        trust.speed_max_mps(here(&at(10.0), &route()))
    };
    // 2 s until missing fixes are noticed, 0.5 s between two fixes without an inertial unit; else 40 m at 2.5 m/s2.
    for (mode, good_m, expected) in [
        (PoseMode::Good, Some(0.315), 20.0),
        (PoseMode::Coasting, Some(0.3), 80.0),
        (PoseMode::Coasting, Some(0.2), 200.0_f64.sqrt()),
        (PoseMode::Coasting, None, 200.0_f64.sqrt()),
    ] {
        let found = speed(mode, good_m);
        assert!((found - expected).abs() < 1e-6, "{mode:?} {good_m:?}: {found}");
    }
}

#[test]
fn missing_fixes_are_noticed_while_the_mode_is_still_good() {
    let quality = |across_m: f64, heading_rad: f64| {
        let covariance = [0.04, 0.0, across_m * across_m, 0.0, 0.0, heading_rad * heading_rad];
        PoseQuality { mode: PoseMode::Good, covariance, ..PoseQuality::default() }
    };
    let mut trust = trust(2.0);
    // A reduced heading variance is a fix, too, even if the position across the lane gets worse.
    for (k, across_m) in [0.25, 0.29, 0.33].into_iter().enumerate() {
        trust.learn(quality(across_m, 0.005 - 0.001 * k as f64));
        assert!(trust.is_fixed(), "{across_m}");
    }
    for (across_m, is_fixed) in [(0.35, true), (0.37, true), (0.39, false), (0.41, false), (0.36, true)] {
        trust.learn(quality(across_m, 0.003));
        assert_eq!(trust.is_fixed(), is_fixed, "{across_m}");
    }
}

#[test]
fn overtaking_is_limited_by_the_pose() {
    let mut trust = trust(2.0);
    reckoning(&mut trust, PoseMode::Good);
    let way_m = |trust: &PoseTrust| trust.overtake_max_m(here(&at(10.0), &route()));
    assert!((way_m(&trust) - 40.0).abs() < 1e-9, "{}", way_m(&trust));
    trust.quality = None;
    assert_eq!(way_m(&trust), f64::INFINITY, "the true pose");
}

#[test]
fn ego_stops_while_a_stop_still_ends_in_the_lane() {
    let mut trust = trust(2.0);
    // 40 m at 4 m/s2: from 17.9 m/s on.
    for (speed_mps, stops) in [(17.0, false), (18.0, true)] {
        trust.stop_s_m = None;
        reckoning(&mut trust, PoseMode::Coasting);
        assert_eq!(stop(&mut trust, &at(speed_mps)).is_some(), stops, "{speed_mps}");
    }
    // With fixes there is no dead reckoning. A stop is over when 10 m are possible.
    trust.good_m = Some(0.315);
    assert!(stop(&mut trust, &at(18.0)).is_none());
    trust.stop_s_m = Some(60.0);
    trust.good_m = None;
    let mut left = |way_m: f64| {
        let heading_rad = 0.42 / way_m;
        let covariance = [0.0, 0.0, 0.315 * 0.315, 0.0, 0.0, heading_rad * heading_rad];
        let mode = PoseMode::Coasting;
        trust.quality = Some(PoseQuality { mode, covariance, ..PoseQuality::default() });
        stop(&mut trust, &at(0.0)).is_some()
    };
    assert!(left(9.0) && !left(11.0));
}

/// Near side of the wall, metres ahead of the front.
fn ahead_of_front_m(stop: &Stop, ego: &EgoState) -> f64 {
    stop.wall.path[0].pose.x_m - 0.5 * stop.wall.extent.length_m - ego.pose.x_m - 4.0
}

#[test]
fn wall_is_never_nearer_than_a_stop_at_4_mps2() {
    let mut trust = trust(2.0);
    uncertain(&mut trust, 0.1, 0.6);
    trust.good_m = Some(0.6);
    let at = |x_m: f64, speed_mps: f64| EgoState { pose: Pose2::new(x_m, 0.0, 0.0), ..at(speed_mps) };
    let mut ahead_m = |ego: EgoState| ahead_of_front_m(&stop(&mut trust, &ego).unwrap(), &ego);
    // 20 m at 2.5 m/s2, 5 m to build up and 2 m; 7 m further it stays in place; at least 12.5 m at 4 m/s2 and 2 m.
    for (x_m, speed_mps, expected_m) in [(50.0, 10.0, 27.0), (57.0, 10.0, 20.0), (66.0, 10.0, 14.5)] {
        let found_m = ahead_m(at(x_m, speed_mps));
        assert!((found_m - expected_m).abs() < 1e-9, "{x_m}: {found_m}");
    }
    // A standing car is not led on.
    assert!((ahead_m(at(80.0, 0.2)) - 0.5).abs() < 1e-9);
}

/// A plan from 50 m on, 3 m to the left, at 10 m/s.
fn plan(accel_mps2: f64, end_d_m: f64, end_mps: f64, status: PlanStatus) -> Plan {
    let point = |x_m: f64, d_m: f64, speed_mps: f64| PlanPoint {
        pose: Pose2::new(x_m, d_m, 0.0),
        speed_mps,
        accel_mps2,
        ..PlanPoint::default()
    };
    Plan { status, points: vec![point(50.0, 3.0, 10.0), point(75.0, end_d_m, end_mps)], ..Plan::default() }
}

#[test]
fn stop_from_the_other_lane_ends_in_the_own_lane_or_waits() {
    let mut trust = trust(2.0);
    let lane = Route::uniform(route().line().clone(), 2.0, 2.0);
    let route = route().in_lane(lane.borders().clone());
    uncertain(&mut trust, 0.1, 0.6);
    let mut is_fit = |d_m: f64, plan: &Plan| {
        let ego = EgoState { pose: Pose2::new(50.0, d_m, 0.0), speed_mps: 10.0, ..EgoState::default() };
        let here = here(&ego, &route);
        trust.stop(here).unwrap().is_fit(plan, here, &trust.shape)
    };
    use PlanStatus::{Brake, Comfortable, Found};
    // The line is 2 m to the left: with 0.95 m of the car and 0.1 m of tolerance, 1.15 m is in the ego's lane.
    for (d_m, accel_mps2, end_d_m, end_mps, status, expected) in [
        (3.0, -3.0, 1.1, 0.0, Comfortable, true),
        (3.0, -3.0, 1.2, 0.0, Comfortable, false),
        (3.0, -3.0, 1.2, 5.0, Comfortable, false),
        (0.0, -3.0, 1.2, 5.0, Comfortable, true),
        (0.0, -3.0, 1.2, 0.0, Comfortable, false),
        (0.0, -4.0, 0.0, 0.0, Found, true),
        (0.0, -4.1, 0.0, 0.0, Found, false),
        (0.0, -3.0, 0.0, 0.0, Brake, false),
    ] {
        let plan = plan(accel_mps2, end_d_m, end_mps, status);
        assert_eq!(is_fit(d_m, &plan), expected, "{d_m} {accel_mps2} {end_d_m} {end_mps} {status:?}");
    }
    // A plan without the wall replaces it unless it brakes harder.
    let hard = plan(-8.0, 3.0, 0.0, Found);
    for (accel_mps2, status, is_worse) in
        [(-1.0, Comfortable, true), (-8.0, Found, true), (-8.5, Found, false), (-1.0, Brake, false)]
    {
        assert_eq!(Stop::is_worse_than(&hard, &plan(accel_mps2, 3.0, 0.0, status)), is_worse);
    }
}

#[test]
fn target_speed_is_not_lowered_during_a_stop_or_before_a_late_one() {
    let (mut trust, route) = (trust(2.0), route());
    let ego = at(10.0);
    uncertain(&mut trust, 0.1, 0.6);
    let target_mps = |trust: &PoseTrust| trust.target_speed_mps(12.0, here(&ego, &route), &[]);
    // No distance by dead reckoning is left.
    assert_eq!(target_mps(&trust), SLOWEST_MPS);
    assert!(stop(&mut trust, &ego).is_some());
    assert_eq!(target_mps(&trust), 10.0);
    trust.postpone();
    assert_eq!(target_mps(&trust), 10.0);
    uncertain(&mut trust, 0.1, 0.1);
    assert!(stop(&mut trust, &ego).is_none() && !trust.is_postponed);
    assert_eq!(target_mps(&trust), 12.0);
}

/// At the crossing of a route with itself the other stretch is nearer: the wall is on the stretch that the ego is on.
#[test]
fn wall_is_on_the_stretch_that_the_ego_is_on() {
    let mut trust = trust(2.0);
    uncertain(&mut trust, 0.6, 0.6);
    let points = [(0.0, 0.0), (100.0, 0.0), (100.0, 60.0), (50.0, 60.0), (50.0, -60.0)];
    let line = Polyline::new(&points.map(|(x_m, y_m)| Point2::new(x_m, y_m))).unwrap();
    let route = Route::uniform(line, 4.0, 2.0);
    let ego = EgoState { pose: Pose2::new(49.8, 0.4, 0.0), speed_mps: 6.0, ..EgoState::default() };
    let place = route.project_near(ego.pose.point(), 48.0, 10.0);
    let wall = trust.stop(Here { ego: &ego, place, route: &route }).unwrap().wall;
    // On the other stretch it would be at x = 50 m.
    let at = wall.path[0].pose;
    assert!((at.x_m - 65.25).abs() < 1.0 && (at.y_m - 1.0).abs() < 0.5, "{wall:?}");
}

#[test]
fn ground_is_narrowed_by_the_deviations_of_the_pose() {
    let mut trust = trust(2.0);
    let mut right_m = |sigma_m: f64| {
        let _ = ahead(&mut trust, 3.0, sigma_m);
        let pose = Pose2::new(50.0, 0.0, 0.0);
        trust.ground(here(&EgoState { pose, ..EgoState::default() }, &route())).right_m(50.0)
    };
    // Two deviations in steps of 0.1 m; 0.25 m of the 1.05 m beside the car are left.
    for (sigma_m, left_m) in [(0.01, 2.0), (0.26, 1.5), (0.36, 1.3), (0.5, 1.2)] {
        assert!((right_m(sigma_m) - left_m).abs() < 1e-9, "{sigma_m}: {}", right_m(sigma_m));
    }
}

#[test]
fn ego_never_stops_without_a_margin_or_with_the_true_pose() {
    assert!(ahead(&mut trust(0.0), 0.1, 5.0).is_none());
    let (ego, route) = (EgoState::default(), route());
    assert!(stop(&mut trust(2.0), &ego).is_none());
    assert_eq!(trust(2.0).target_speed_mps(7.0, here(&ego, &route), &[]), 7.0);
}

#[test]
fn ground_contains_a_standing_car() {
    let mut trust = trust(2.0);
    let mut right_m = |d_m: f64, speed_mps: f64| {
        let _ = ahead(&mut trust, 3.0, 0.5);
        let pose = Pose2::new(50.0, d_m, 0.0);
        let ego = EgoState { pose, speed_mps, ..EgoState::default() };
        trust.ground(here(&ego, &route())).right_m(50.0)
    };
    // To the right of the car 1.05 m and its offset; 0.1 m of that is left, in steps of 0.1 m.
    for (d_m, left_m) in [(0.0, 1.2), (-0.12, 1.2), (2.2, 1.3), (-0.76, 1.9), (-1.0, 2.0)] {
        assert!((right_m(d_m, 0.0) - left_m).abs() < 1e-9, "{d_m}: {}", right_m(d_m, 0.0));
        assert!((right_m(d_m, 5.0) - 1.2).abs() < 1e-9, "{d_m}");
    }
}

#[test]
fn speed_beside_cover_falls_with_the_deviations() {
    let mut trust = trust(2.0);
    let mut share = |sigma_m: f64, kind: ActorKind, x_m: f64, moves_m: f64| {
        let _ = ahead(&mut trust, 0.1, sigma_m);
        let at = |x_m: f64| PredictedPose { at: Time::ZERO, pose: Pose2::new(x_m, 4.0, 0.0) };
        let path = vec![at(x_m), at(x_m + moves_m)];
        let one = Prediction { kind, path, ..stop_wall(WALL_ID, 0.0, &route(), Time::ZERO) };
        let ego = EgoState { pose: Pose2::new(50.0, 0.0, 0.0), speed_mps: 10.0, ..EgoState::default() };
        trust.speed_share(here(&ego, &route()), &[one])
    };
    // 1.05 m beside the car. Two deviations of 0.1575 m take 0.3 of it, of 0.34125 m 0.65: half way to 0.3.
    for (sigma_m, expected) in [(0.157, 1.0), (0.341_25, 0.65), (0.525, 0.3)] {
        assert!((share(sigma_m, ActorKind::Truck, 80.0, 0.0) - expected).abs() < 1e-9, "{sigma_m}");
    }
    // Moving vehicles, pedestrians, objects behind the ego, and those more than six seconds away are no cover.
    for (kind, x_m, moves_m) in [
        (ActorKind::Truck, 80.0, 5.0),
        (ActorKind::Pedestrian, 80.0, 0.0),
        (ActorKind::Truck, 49.0, 0.0),
        (ActorKind::Truck, 111.0, 0.0),
    ] {
        assert_eq!(share(0.39, kind, x_m, moves_m), 1.0, "{kind:?} at {x_m}");
    }
}
