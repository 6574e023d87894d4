use super::*;
use crate::testing::{Capped, World, conformance, keeps_its_lane, yields_to_pedestrians};
use crate::{CollisionMode, Solid, Unlimited, predicted_start};
use proptest::prelude::*;
use swerve_core::Time;
use swerve_geom::{Point2, Polyline};
use swerve_msg::{ActorId, ActorKind, EgoState, Extent, PredictedPose, Prediction, Route};
use swerve_vehicle::{Limits, Shape};

#[test]
fn conforms() {
    conformance(&|| Fot::new(Params::fast()).unwrap(), true);
}

#[test]
fn fot_yields_to_pedestrians_that_may_stop() {
    yields_to_pedestrians(&|collision| Fot::new(Params { collision, ..Params::default() }).unwrap());
}

#[test]
fn fot_keeps_its_lane_before_oncoming_traffic() {
    keeps_its_lane(&|| Fot::new(Params::fast()).unwrap());
}

/// A stop within a few samples must not exceed the brakes between samples.
#[test]
fn infeasible_stops_are_not_found() {
    for ahead_m in 8..40 {
        let mut world = World::straight(15.0);
        for y in [-1.5, 1.0, 3.5, 6.0] {
            world = world.with(ActorKind::Car, (4.5, 2.4), (f64::from(ahead_m), y), (0.0, 0.0));
        }
        let plan = plan(&world, Params::slow());
        for pair in plan.points.windows(2) {
            let moved_m = pair[0].pose.point().distance(pair[1].pose.point());
            let least_m = {
                let (v, dt_s) = (pair[0].speed_mps, (pair[1].at - pair[0].at).as_secs());
                let brake = world.limits.brake_max_mps2;
                let t_s = dt_s.min(v / brake);
                v * t_s - 0.5 * brake * t_s * t_s
            };
            assert!(moved_m > least_m - 0.02, "{ahead_m} m: {:?} {pair:?}", plan.status);
        }
    }
}

fn plan(world: &World, params: Params) -> Plan {
    Fot::new(params).unwrap().plan(&world.request(), &mut Unlimited::default())
}

#[test]
fn a_free_road_is_driven_straight() {
    let plan = plan(&World::straight(15.0), Params::default());
    assert_eq!(plan.status, PlanStatus::Found);
    assert!(plan.points.iter().all(|p| p.pose.y_m.abs() < 1e-9 && p.pose.heading_rad.abs() < 1e-9));
}

/// A person walks off the lane to the right and is gone when the ego arrives; all her places at once block every path
/// on the road.
#[test]
fn a_person_is_passed_behind_in_time() {
    let world = World::straight(14.0).with_person((26.0, 3.0), (0.0, -3.0));
    let timed = plan(&world, Params { clearance_m: 0.5, ..Params::fast() });
    assert_eq!(timed.status, PlanStatus::Found);
    assert!(world.clearance_m(&timed, CollisionMode::TimeIndexed) >= 0.49);
    let swept = Params { collision: CollisionMode::SweptStatic, left_m: 1.0, ..Params::fast() };
    let stopped = plan(&world, swept);
    let behind = |p: &PlanPoint| world.shape.footprint(p.pose).corners()[0].x_m < 25.75;
    assert!(stopped.status.is_fallback() || stopped.points.iter().all(behind));
}

#[test]
fn few_candidates_are_evaluated() {
    let world = World::straight(16.0).with_person((25.0, 0.5), (0.0, 0.0));
    let plan = plan(&world, Params::slow());
    assert!(plan.work > 0 && plan.work < 3_000, "{}", plan.work);
}

/// A budget that ends early gives a path from the coarse lattice, no cheaper than the full result.
#[test]
fn best_candidate_so_far_is_returned_when_the_budget_ends() {
    let world = World::straight(16.0).with_person((25.0, 0.5), (0.0, 0.0));
    let mut planner = Fot::new(Params::slow()).unwrap();
    let whole = planner.plan(&world.request(), &mut Unlimited::default());
    let mut found = 0;
    for units in (1..whole.work).step_by(7) {
        let plan = planner.plan(&world.request(), &mut Capped::new(units));
        if plan.status == PlanStatus::Found {
            found += 1;
            assert!(world.clearance_m(&plan, CollisionMode::TimeIndexed) > 0.0);
        }
    }
    assert!(found > 0, "of {} units", whole.work);
}

/// The person behind the truck: a street along x with y from -2 to 6, a truck at (110, 4), a person at (117, 4.5) who
/// walks 2.75 m/s towards -y once the ego's centre is within 26 m, seen from 20 m on. The ego follows its plans
/// exactly; each plan begins `delay_ms` after its input. Returns the smallest distance to truck and person.
fn person_behind_truck(speed_mps: f64, params: Params, delay_ms: i64) -> f64 {
    let line: Vec<Point2> = (0..260).map(|x| Point2::new(f64::from(x), 0.0)).collect();
    let route = Route::uniform(Polyline::new(&line).unwrap(), 6.0, 2.0);
    let (shape, limits) = (Shape::default(), Limits::default());
    let mut ego = EgoState { pose: Pose2::new(60.0, 0.0, 0.0), speed_mps, ..EgoState::default() };
    let (mut planner, mut walked_from, mut least_m) = (Fot::new(params).unwrap(), None, f64::INFINITY);
    let mut previous: Option<Plan> = None;
    for tick in 0..1000_i64 {
        let now = Time::from_ms(10 * tick);
        ego = match previous.as_ref().and_then(|plan| plan.at(now).filter(|_| plan.points[0].at <= now)) {
            Some(p) => EgoState {
                stamp: now,
                pose: p.pose,
                speed_mps: p.speed_mps,
                accel_mps2: p.accel_mps2,
                yaw_rate_radps: p.speed_mps * p.curvature_1pm,
                ..ego
            },
            None => EgoState { stamp: now, pose: ego.pose.ahead(0.01 * ego.speed_mps), ..ego },
        };
        let body = Solid::from(&shape.footprint(ego.pose));
        let gap_m = math::hypot(117.0 - body.x_m, 4.5 - body.y_m);
        if walked_from.is_none() && gap_m < 26.0 {
            walked_from = Some(now);
        }
        let walked_m =
            |t: Time| walked_from.map_or(0.0, |from: Time| (2.75 * (t - from).as_secs()).clamp(0.0, 4.5));
        let person_at = |t: Time| Pose2::new(117.0, 4.5 - walked_m(t), 0.0);
        let boxes = [(Pose2::new(110.0, 4.0, 0.0), 5.2, 2.6), (person_at(now), 0.5, 0.5)];
        for (pose, length, width) in boxes {
            least_m = least_m.min(Solid::from(&swerve_geom::Obb::new(pose, length, width)).distance_m(&body));
        }
        if tick % 5 != 0 || ego.pose.x_m > 150.0 {
            continue;
        }
        let moving = walked_m(now) > 0.0 && walked_m(now) < 4.5;
        let velocity = if moving { -2.75 } else { 0.0 };
        let predict = |pose: Pose2, velocity: f64, length_m: f64, width_m: f64, id: u32| {
            let extent = Extent { length_m, width_m, height_m: 1.8 };
            let path = (0..=50).map(|k| PredictedPose {
                at: now + Span::from_ms(100 * k),
                pose: Pose2::new(pose.x_m, pose.y_m + velocity * 0.1 * k as f64, 0.0),
            });
            Prediction::single(ActorId(id), ActorKind::Pedestrian, extent, path.collect())
        };
        let mut predictions = vec![predict(boxes[0].0, 0.0, 5.2, 2.6, 1)];
        if gap_m < 20.0 {
            predictions.push(predict(boxes[1].0, velocity, 0.5, 0.5, 2));
        }
        let start = predicted_start(&ego, previous.as_ref(), Span::from_ms(delay_ms));
        let request = Request {
            stamp: now,
            start,
            route: &route,
            along_m: None,
            target_speed_mps: speed_mps,
            overtake_max_m: f64::INFINITY,
            changed_lately: &[],
            predictions: &predictions,
            shape: &shape,
            limits: &limits,
            previous: previous.as_ref(),
            seed: 0,
        };
        let next = planner.plan(&request, &mut Unlimited::default());
        // Until the new plan begins, the old one continues.
        let mut points: Vec<PlanPoint> =
            previous.iter().flat_map(|p| p.points.iter().copied()).filter(|p| p.at < start.stamp).collect();
        points.extend(&next.points);
        previous = Some(Plan { points, ..next });
    }
    least_m
}

#[test]
fn person_behind_the_truck_is_avoided_if_there_is_time() {
    for speed_mps in [16.0, 18.0, 20.0, 22.0] {
        let least_m = person_behind_truck(speed_mps, Params::fast(), 20);
        assert!(least_m > 0.1, "{speed_mps} m/s: {least_m}");
    }
    // With most of a second lost before a plan takes effect, a collision at 16 m/s is unavoidable.
    assert_eq!(person_behind_truck(16.0, Params::fast(), 900), 0.0);
}

/// Speeds and last pose of an ego that follows its plans exactly, with a new plan every 50 ms in a world that depends
/// on time.
fn driven(
    from_mps: f64,
    target_mps: f64,
    seconds: i64,
    world_at: impl Fn(f64) -> World,
) -> (Vec<f64>, Pose2) {
    let mut planner = Fot::new(Params::default()).unwrap();
    let mut ego = EgoState { speed_mps: from_mps, ..EgoState::default() };
    let (mut speeds, mut previous): (Vec<f64>, Option<Plan>) = (Vec::new(), None);
    for tick in 0..20 * seconds {
        let now = Time::from_ms(50 * tick);
        if let Some(p) = previous.as_ref().and_then(|plan| plan.at(now)) {
            ego = EgoState {
                pose: p.pose,
                speed_mps: p.speed_mps,
                accel_mps2: p.accel_mps2,
                yaw_rate_radps: p.speed_mps * p.curvature_1pm,
                ..ego
            };
        }
        ego.stamp = now;
        speeds.push(ego.speed_mps);
        let world = world_at(now.as_secs());
        let request = Request {
            stamp: now,
            start: ego,
            target_speed_mps: target_mps,
            previous: previous.as_ref(),
            ..world.request()
        };
        previous = Some(planner.plan(&request, &mut Unlimited::default()));
    }
    (speeds, ego.pose)
}

/// Distance from the front bumper to `x_m`.
fn gap_m(pose: Pose2, x_m: f64) -> f64 {
    let shape = Shape::default();
    x_m - pose.x_m - (shape.length_m - shape.rear_overhang_m)
}

fn jam(rear_m: f64) -> World {
    let mut world = World::straight(10.0);
    for y in [-0.5, 4.0] {
        world = world.with(ActorKind::Car, (4.0, 2.0), (rear_m + 2.0, y), (0.0, 0.0));
    }
    world
}

#[test]
fn the_ego_stops_once_before_a_blocked_road_and_keeps_the_gap() {
    for from_mps in [0.0, 6.0, 10.0] {
        let (speeds, pose) = driven(from_mps, 10.0, 20, |_| jam(70.0));
        let top = speeds.iter().position(|&v| v > 9.0).unwrap();
        let braking = speeds[top..].iter().skip_while(|&&v| v > 8.0);
        assert!(braking.clone().zip(braking.skip(1)).all(|(a, b)| *b <= a + 0.05), "{from_mps}: {speeds:?}");
        assert!(speeds[speeds.len() - 1] < 0.01, "{from_mps}: {speeds:?}");
        assert!((gap_m(pose, 70.0) - Params::default().follow_gap_m).abs() < 0.3, "{from_mps}: {pose:?}");
    }
}

#[test]
fn slow_traffic_is_followed_at_its_speed_and_distance() {
    let leader_mps = 4.0;
    let place = |t: f64| 40.0 + leader_mps * t;
    let (speeds, pose) = driven(10.0, 10.0, 20, |t| {
        let mut world = World::straight(10.0);
        world.start.stamp = Time::from_ms((t * 1000.0).round() as i64);
        for y in [-0.5, 4.0] {
            world = world.with(ActorKind::Car, (4.0, 2.0), (place(t) + 2.0, y), (leader_mps, 0.0));
        }
        world
    });
    assert!((speeds[speeds.len() - 1] - leader_mps).abs() < 0.3, "{speeds:?}");
    let p = Params::default();
    let wanted_m = p.follow_gap_m + p.follow_time_s * leader_mps;
    assert!((gap_m(pose, place(19.95)) - wanted_m).abs() < 1.0, "{pose:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
    #[test]
    fn target_places_are_searched_like_exhaustively(
        speed in 0.0..20.0, offset in -0.5..1.0, ahead in 8.0..60.0, across in -1.5..1.5,
    ) {
        let mut world = World::straight(speed).with(ActorKind::Car, (4.0, 2.0), (ahead, across), (0.5, 0.0));
        world.start.pose.y_m += offset;
        let mut planner = Fot::new(Params::default()).unwrap();
        let request = world.request();
        planner.set_world(&request, CollisionMode::TimeIndexed);
        let start = planner.frenet(&request);
        let Fot { params, line, road, obstacles, .. } = &planner;
        let line = line.line();
        let checks = checks(params, &request, obstacles, road);
        let task = Task { params, line, cut_m: f64::INFINITY, start, target_mps: speed, checks };
        let (mut lattice, mut aims) = (Lattice::default(), Lattice::default());
        lattice.set(params, speed);
        aims.set_aims(&lattice, start.d[0], |t_s| follow::aim(&task, t_s));
        let want = Search::default().exhaustive(&task, &aims);
        let got = match Search::default().run(&task, &aims, None, &mut 0) {
            Outcome::Found(candidate) => Some(candidate),
            Outcome::Nothing | Outcome::Stopped => None,
        };
        prop_assert_eq!(got, want);
    }
}

/// Largest speed and acceleration of a motion through equidistant points, by finite differences: m/s, m/s².
fn moved(plan: &Plan) -> [f64; 2] {
    let points = &plan.points;
    let dt_s = (points[1].at - points[0].at).as_secs();
    let velocity = |p: &[PlanPoint]| (p[1].pose.point() - p[0].pose.point()) * (1.0 / dt_s);
    let speeds = points.windows(2).map(|p| velocity(p).norm());
    let accels = points.windows(3).map(|p| (velocity(&p[1..]) - velocity(&p[..2])).norm() / dt_s);
    [speeds.fold(0.0, f64::max), accels.fold(0.0, f64::max)]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
    #[test]
    fn limits_hold_for_the_motion_in_the_map(
        speed in 0.0..14.0, target in 3.0..30.0, offset in -30.0..30.0, heading in -0.4..0.4, bent in 0..2,
    ) {
        let mut world = if bent == 1 { World::bend(60.0, speed) } else { World::straight(speed) };
        world.route = Route::uniform(world.route.line().clone(), 60.0, 60.0);
        world.target_speed_mps = target;
        world.start.pose = Pose2::new(0.0, offset, heading);
        let params = Params { max_accel_mps2: 3.0, max_speed_mps: 15.0, left_m: 30.0, right_m: 30.0, ..Params::fast() };
        let plan = plan(&world, params);
        if plan.status == PlanStatus::Found {
            let [speed_mps, accel_mps2] = moved(&plan);
            prop_assert!(speed_mps <= 15.0 * 1.001 && accel_mps2 <= 3.0 * 1.01, "{speed_mps} {accel_mps2}");
        }
    }

    /// From rest the motion starts in the ego's direction with the curvature of its wheels, and its heading and
    /// curvature are continuous.
    #[test]
    fn motion_from_rest_starts_in_the_ego_state(
        offset in -0.9..0.9, heading in -0.2..0.2, steering in -0.1..0.1, bent in 0..2,
    ) {
        let mut world = if bent == 1 { World::bend(20.0, 0.0) } else { World::straight(0.0) };
        world.target_speed_mps = 6.0;
        world.route = Route::uniform(world.route.line().clone(), 6.0, 4.0);
        world.start.pose = Pose2::new(0.0, offset, heading);
        world.start.steering_rad = steering;
        let plan = plan(&world, Params::fast());
        prop_assert_eq!(plan.status, PlanStatus::Found);
        let (first, last) = (&plan.points[0], &plan.points[plan.points.len() - 1]);
        prop_assert!((first.pose.heading_rad - heading).abs() < 1e-9 && first.pose.y_m - offset < 1e-6);
        let wheels = math::tan(steering) / world.shape.wheelbase_m;
        prop_assert!((first.curvature_1pm - wheels).abs() < 1e-6, "{} {wheels}", first.curvature_1pm);
        prop_assert!(last.pose.point().distance(first.pose.point()) > 3.0);
        for two in plan.points.windows(2) {
            let way_m = two[0].pose.point().distance(two[1].pose.point());
            let turned = (two[1].pose.heading_rad - two[0].pose.heading_rad).abs();
            prop_assert!(turned <= way_m * curvature_max_1pm(&world.limits, &world.shape) + 1e-6, "{turned} {way_m}");
        }
    }
}
