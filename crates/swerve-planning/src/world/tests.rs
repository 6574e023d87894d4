use super::*;
use crate::collision::CollisionMode;
use crate::testing::World;

fn start(speed_mps: f64, yaw_rate_radps: f64) -> EgoState {
    EgoState { stamp: Time::from_ms(500), speed_mps, yaw_rate_radps, ..EgoState::default() }
}

#[test]
fn without_a_plan_the_start_goes_on_round_its_circle() {
    // A quarter circle of radius 10 m in one second.
    let quarter = core::f64::consts::FRAC_PI_2;
    let there = predicted_start(&start(10.0 * quarter, quarter), None, Span::from_ms(1000));
    assert!((there.pose.x_m - 10.0).abs() < 1e-9 && (there.pose.y_m - 10.0).abs() < 1e-9, "{there:?}");
    assert!((there.pose.heading_rad - quarter).abs() < 1e-12);
    assert_eq!(there.stamp, Time::from_ms(1500));
}

#[test]
fn with_a_plan_the_start_moves_as_the_plan_does() {
    let point = |ms, x, speed_mps| PlanPoint {
        at: Time::from_ms(ms),
        pose: Pose2::new(x, 1.0, 0.0),
        speed_mps,
        ..PlanPoint::default()
    };
    let plan = Plan { points: vec![point(0, 0.0, 10.0), point(1000, 9.0, 8.0)], ..Plan::default() };
    let measured = EgoState { pose: Pose2::new(4.0, 0.5, 0.0), ..start(9.5, 0.0) };
    let there = predicted_start(&measured, Some(&plan), Span::from_ms(100));
    assert!((there.pose.x_m - 4.9).abs() < 1e-9 && (there.pose.y_m - 0.5).abs() < 1e-9, "{there:?}");
    assert!((there.speed_mps - 9.3).abs() < 1e-9);
    // A plan that begins only later is taken as it is.
    let early = EgoState { stamp: Time::from_ms(-200), ..measured };
    let taken_up = predicted_start(&early, Some(&plan), Span::from_ms(300));
    assert!(
        (taken_up.pose.x_m - 0.9).abs() < 1e-9 && (taken_up.speed_mps - 9.8).abs() < 1e-9,
        "{taken_up:?}"
    );
    // Beyond its end the plan says nothing.
    let beyond = predicted_start(&measured, Some(&plan), Span::from_ms(1000));
    assert!((beyond.pose.x_m - 13.5).abs() < 1e-9);
}

#[test]
fn speeds_keep_the_limits() {
    let world = World::bend(20.0, 25.0);
    let plan = follow_route(&world.request(), SpeedProfile::Limited, 5.0, PlanStatus::Route);
    let (mut slowed, limits) = (false, world.limits);
    for pair in plan.points.windows(2) {
        assert!(pair[0].accel_mps2 >= -limits.brake_max_mps2 - 1e-6, "{pair:?}");
        assert!(pair[0].accel_mps2 <= limits.accel_max_mps2 + 1e-6, "{pair:?}");
        slowed |= pair[1].speed_mps < 13.0;
    }
    assert!(slowed);
    let last = plan.points[plan.points.len() - 1];
    assert!(last.speed_mps * last.speed_mps * 0.05 <= limits.lateral_accel_max_mps2 * 1.01, "{last:?}");
    let constant = follow_route(&world.request(), SpeedProfile::Constant, 5.0, PlanStatus::Route);
    assert!(constant.points.iter().all(|p| p.speed_mps == 25.0));
}

#[test]
fn a_free_plan_is_kept_and_a_blocked_one_braked_along() {
    let world = World::straight(10.0);
    let request = world.request();
    let before = follow_route(&request, SpeedProfile::Limited, 4.0, PlanStatus::Route);
    let mut later = Request { previous: Some(&before), ..request };
    later.start.stamp = request.start.stamp + Span::from_ms(350);
    later.start.pose = later.start.pose.ahead(3.5);
    let clear = Obstacles::new(&[], CollisionMode::TimeIndexed);
    let plan = fall_back(Fallback::KeepOrBrake, &later, &clear, 0.0, 4.0);
    assert_eq!(plan.status, PlanStatus::Kept);
    assert_eq!(plan.points[0].at, later.start.stamp);
    assert!((plan.points[0].pose.x_m - 3.5).abs() < 1e-6);

    let blocked = World::straight(10.0).with_person((25.0, 0.0), (0.0, 0.0));
    let person = Obstacles::new(&blocked.predictions, CollisionMode::TimeIndexed);
    let plan = fall_back(Fallback::KeepOrBrake, &later, &person, 0.0, 4.0);
    assert_eq!(plan.status, PlanStatus::Brake);
    let last = plan.points[plan.points.len() - 1];
    assert!(last.speed_mps == 0.0);
    assert!((last.pose.x_m - (3.5 + 100.0 / 16.0)).abs() < 0.01, "{last:?}");
}

#[test]
fn giving_way_stops_before_all_that_a_walker_may_come_to_cover() {
    // She comes from the left and may stop anywhere between 4 m left and 6 m right of the line, 24.75 m ahead.
    let stopping = |speed_mps: f64, previous: Option<&Plan>| {
        let world = World::straight(speed_mps).with_person((25.0, 4.0), (0.0, -2.0));
        let obstacles = Obstacles::new(&world.predictions, CollisionMode::MayStop);
        let request = Request { previous, ..world.request() };
        let limits = eased_limits(&request);
        let plan = give_way(&Request { limits: &limits, ..request }, &obstacles, 0.3)?;
        assert!(world.clearance_m(&plan, CollisionMode::MayStop) > 0.25);
        let last = plan.points[plan.points.len() - 1];
        assert!(last.speed_mps < 1e-5, "{last:?}");
        let hardest = plan.points.iter().map(|p| p.accel_mps2).fold(0.0, f64::min);
        let front_m = world.shape.footprint(last.pose).corners()[0].x_m;
        Some((plan.status, hardest, front_m))
    };
    let (status, hardest, front_m) = stopping(8.0, None).expect("there is room");
    assert!(status == PlanStatus::Found && (hardest + 3.0).abs() < 0.01, "{hardest}");
    assert!(front_m > 20.0 && front_m < 24.45, "{front_m}");
    let (_, hardest, _) = stopping(13.0, None).expect("there is just room");
    assert!((-6.0..-3.5).contains(&hardest), "{hardest}");
    // From 17 m/s it takes 7 of 8 m/s²: too much to begin with, but not to go on with.
    assert_eq!(stopping(17.0, None), None);
    let stop = Plan { points: vec![PlanPoint::default()], ..Plan::default() };
    assert!(stopping(17.0, Some(&stop)).is_some());
    assert_eq!(stopping(20.0, Some(&stop)), None);
}

#[test]
fn the_originals_fall_back_as_they_did() {
    let world = World::straight(10.0);
    let none = Obstacles::default();
    let stop = fall_back(Fallback::StopOnRoute, &world.request(), &none, 0.0, 4.0);
    assert_eq!(stop.status, PlanStatus::Stop);
    assert!(stop.points.iter().all(|p| p.speed_mps == 0.0));
    let regardless = fall_back(Fallback::FollowRoute, &world.request(), &none, 0.0, 4.0);
    assert_eq!(regardless.status, PlanStatus::GaveUp);
    assert!(regardless.points.iter().all(|p| p.speed_mps == 10.0));
}

#[test]
fn braking_without_a_plan_stays_on_the_circle() {
    let mut world = World::straight(10.0);
    world.start.yaw_rate_radps = 0.5;
    let plan = brake(&world.request());
    let center = swerve_geom::Point2::new(0.0, 20.0);
    for p in &plan.points {
        assert!((p.pose.point().distance(center) - 20.0).abs() < 0.01, "{p:?}");
    }
}

#[test]
fn range_counts_every_predicted_place() {
    let world = World::straight(10.0).with_person((60.0, 0.0), (-10.0, 0.0));
    assert!(obstacle_in_range(&world.predictions, world.start.pose, 11.0));
    assert!(!obstacle_in_range(&world.predictions, world.start.pose, 9.0));
    assert_eq!(within_range(&world.predictions, world.start.pose, 9.0).len(), 0);
    assert_eq!(route_pose_ahead(world.route.line(), world.start.pose, 12.0), Pose2::new(12.0, 0.0, 0.0));
}
