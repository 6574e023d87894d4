//! Fallback plans when a search finds none, and plans that give way to pedestrians.

use swerve_core::{Span, Time};
use swerve_geom::{Ego, FrenetPoint, Point2, Pose2, angle_between, math};
use swerve_msg::{EgoState, Plan, PlanPoint, PlanStatus};
use swerve_vehicle::Limits;

use crate::brake::{brake, brake_along, way_ahead};
use crate::collision::{Obstacles, contact_mps};
use crate::fot::poly::Quintic;
use crate::lock::curvature_max_1pm;
use crate::path::points::{Measured, PathPoint, with_curvature};
use crate::path::route::PATH_STEP_M;
use crate::path::speed::{CREEP_MPS, SpeedProfile, timed_points};
use crate::request::Request;

/// The previous plan while it is collision-free with `clearance_m`, otherwise full brake along it; if that ends in the
/// lane of oncoming traffic, a stop in the ego's own lane, provided that it does no more harm.
pub fn keep_or_brake(request: &Request<'_>, obstacles: &Obstacles, clearance_m: f64) -> Plan {
    kept(request, obstacles, clearance_m).unwrap_or_else(|| {
        let full = brake(request);
        if rests_in_lane(request, &full) {
            return full;
        }
        // Negative: no contact.
        let harm = |plan: &Plan| contact_mps(request, obstacles, plan, clearance_m).unwrap_or(-1.0);
        let in_lane = SHARES.into_iter().map(|share| stop_on_way_back(request, share));
        let stops = in_lane.filter(|plan| rests_in_lane(request, plan)).chain([full.clone()]);
        stops.min_by(|a, b| harm(a).total_cmp(&harm(b))).unwrap_or(full)
    })
}

/// Returns true if a plan ends at a pose where the ego may come to rest.
fn rests_in_lane(request: &Request<'_>, plan: &Plan) -> bool {
    plan.points.last().is_none_or(|end| request.may_rest_at(end.pose))
}

/// Brakes with a fraction of full brake on the way back to the ego's lane.
fn stop_on_way_back(request: &Request<'_>, share: f64) -> Plan {
    let Limits { brake_max_mps2, lateral_accel_max_mps2, .. } = *request.limits;
    let limits = Limits { brake_max_mps2: share * brake_max_mps2, ..*request.limits };
    // Friction circle: lateral acceleration left by braking.
    let path = with_curvature(&way_back(request, lateral_accel_max_mps2 * (1.0 - share * share).sqrt()));
    brake_along(&Request { limits: &limits, ..*request }, &path, PlanStatus::Brake)
}

/// Fractions of full brake tried on the way back to the ego's lane, the hardest first.
const SHARES: [f64; 4] = [0.9, 0.7, 0.5, 0.3];

/// Path back to the line: a quintic offset over arc length (Werling 2010, section V.C), as short as the lateral
/// acceleration and full lock allow at the current speed, then along the line.
fn way_back(request: &Request<'_>, lateral_mps2: f64) -> Vec<Pose2> {
    let (route, start) = (request.route, &request.start);
    let FrenetPoint { s_m, d_m } = request.place();
    let off_rad = angle_between(route.line().at(s_m).pose.heading_rad, start.pose.heading_rad);
    let speed_mps = start.speed_mps.max(0.0);
    let tightest_1pm = curvature_max_1pm(request.limits, request.shape);
    let radius_m = (speed_mps * speed_mps / lateral_mps2).max(1.0 / tightest_1pm);
    let slope = math::tan(off_rad.clamp(-1.0, 1.0));
    // Bound on the curvature at the length L: that of the offset over L², and that of the slope over L.
    let turn_m = 0.5 * SLOPE_PEAK * slope.abs() * radius_m;
    let back_m = (turn_m + (turn_m * turn_m + QUINTIC_PEAK * d_m.abs() * radius_m).sqrt()).max(PATH_STEP_M);
    let offset = Quintic::new([d_m, slope, 0.0], [0.0; 3], back_m);
    let length_m = back_m.max(speed_mps * speed_mps / (2.0 * SHARES[3] * request.limits.brake_max_mps2));
    let steps = (length_m / PATH_STEP_M).ceil() as usize;
    let beside = |k: usize| {
        let ahead_m = k as f64 * PATH_STEP_M;
        let to = offset.at(ahead_m.min(back_m));
        let at = route.unproject(FrenetPoint { s_m: s_m + ahead_m, d_m: to.x });
        let heading_rad = route.line().at(s_m + ahead_m).pose.heading_rad + math::atan(to.v);
        Pose2::new(at.x_m, at.y_m, heading_rad)
    };
    core::iter::once(start.pose).chain((1..=steps).map(beside)).collect()
}

/// Largest second derivative of a quintic from rest to rest, for unit distance and duration: 10 / sqrt(3).
const QUINTIC_PEAK: f64 = 5.773_502_691_896_258;

/// Largest second derivative of a quintic that ends an initial slope, for unit slope and duration.
const SLOPE_PEAK: f64 = 3.941;

/// Rest of the previous plan, if it is still collision-free and the ego is on it; `None` if it ends at rest in the lane
/// of oncoming traffic.
pub fn kept(request: &Request<'_>, obstacles: &Obstacles, clearance_m: f64) -> Option<Plan> {
    let previous = request.previous?;
    if stops(Some(previous)) && !rests_in_lane(request, previous) {
        return None;
    }
    let from = request.start.stamp;
    if previous.end() <= from {
        return None;
    }
    let rest = previous.points.iter().filter(|p| p.at > from).copied();
    let begun = previous.points.first().is_some_and(|p| p.at <= from);
    let now = previous.at(from).filter(|_| begun).map(|p| PlanPoint { at: from, ..p });
    let points: Vec<PlanPoint> = now.into_iter().chain(rest).collect();
    let first = points.first()?;
    let wait_s = (first.at - from).as_secs();
    let off_m = first.pose.point().distance(request.start.pose.point());
    if off_m > OFF_PLAN_M + wait_s * request.start.speed_mps.max(0.0) {
        return None;
    }
    let path: Vec<(Pose2, Time)> = points.iter().map(|p| (p.pose, p.at)).collect();
    let free =
        |path: &[(Pose2, Time)]| obstacles.path_free(|pose| request.shape.footprint(pose), path, clearance_m);
    // An ego beside its plan may stay beside it: that has to be free as well.
    let beside = || -> Vec<(Pose2, Time)> {
        let off = if now.is_some() {
            first.pose.to_local(request.start.pose.point())
        } else {
            Point2::<Ego>::new(0.0, 0.0)
        };
        let moved = |pose: Pose2| {
            let point = pose.from_local(off);
            Pose2::new(point.x_m, point.y_m, pose.heading_rad)
        };
        path.iter().map(|&(pose, at)| (moved(pose), at)).collect()
    };
    // The state after the plan counts too: the plan is kept only while the ego can still come to a stop, at its end or
    // while it is being driven.
    let stops_from = |k: usize| {
        let p = &points[k];
        let start = EgoState { stamp: p.at, pose: p.pose, speed_mps: p.speed_mps, ..request.start };
        let poses: Vec<Pose2> = points[k..].iter().map(|p| p.pose).collect();
        let braking = brake_along(&Request { start, ..*request }, &with_curvature(&poses), PlanStatus::Brake);
        let stop: Vec<(Pose2, Time)> = braking.points.iter().map(|p| (p.pose, p.at)).collect();
        free(&stop)
    };
    let soon = points.iter().position(|p| p.at >= from + BRAKE_LATER).unwrap_or(points.len() - 1);
    let stops = stops_from(points.len() - 1) || stops_from(soon);
    (free(&path) && stops && free(&beside())).then_some(Plan {
        stamp: request.stamp,
        status: PlanStatus::Kept,
        points,
        work: 0,
    })
}

/// An ego further than this from its plan is not on it, metres.
const OFF_PLAN_M: f64 = 2.0;

/// Longest time for which a plan that can only be followed by braking is kept: several planning periods.
const BRAKE_LATER: Span = Span::from_ms(300);

/// A stop before the ground ahead that the obstacles may cover: gentle if that suffices, otherwise as hard as
/// necessary. `None` if the hardest braking within the limits does not keep `clearance_m`.
///
/// For [`CollisionMode::MayStop`](crate::collision::CollisionMode::MayStop): a plan that gives way to a pedestrian
/// always leaves a stop, wherever the pedestrian stops. To be called again on every frame: once the path is free, the
/// ego drives on.
pub fn give_way(request: &Request<'_>, obstacles: &Obstacles, clearance_m: f64) -> Option<Plan> {
    let free = |plan: &Plan, clearance_m: f64| {
        let path: Vec<(Pose2, Time)> = plan.points.iter().map(|p| (p.pose, p.at)).collect();
        obstacles.path_free(|pose| request.shape.footprint(pose), &path, clearance_m)
    };
    let path = with_curvature(&way_ahead(request));
    let path = Measured::new(&path);
    let covered = |s_m: f64| {
        let footprint = request.shape.footprint(path.at(s_m).pose);
        !obstacles.free(&footprint, Time::MAX, clearance_m)
    };
    let v = request.start.speed_mps.max(0.0);
    let reach_m = v * v / (2.0 * COMFORT_BRAKE_MPS2) + YIELD_GAP_M + v * YIELD_AHEAD_S;
    let steps = (reach_m / PATH_STEP_M).ceil() as usize;
    let covered_m = (0..=steps).map(|k| k as f64 * PATH_STEP_M).find(|&s_m| covered(s_m)).unwrap_or(reach_m);
    let way_m = covered_m - PATH_STEP_M - YIELD_GAP_M;
    let brake_max_mps2 = COMFORT_BRAKE_MPS2.max(v * v / (2.0 * way_m));
    if way_m > 0.0 && brake_max_mps2 <= request.limits.brake_max_mps2 {
        let limits = Limits { brake_max_mps2, ..*request.limits };
        let plan = stop_after(request, &path, way_m, &limits);
        if free(&plan, clearance_m) && rests_in_lane(request, &plan) {
            return Some(plan);
        }
    }
    // A stop under way is abandoned only if it would touch something.
    let needed_m = if stops(request.previous) { 0.0 } else { clearance_m };
    Some(brake(request)).filter(|plan| free(plan, needed_m) && rests_in_lane(request, plan))
}

/// Limits for a plan that gives way, or goes round everything that pedestrians may cover: only part of the braking,
/// which leaves a reserve for delays and errors; all of it once a stop is under way.
pub fn comfort_limits(request: &Request<'_>) -> Limits {
    let share = if stops(request.previous) { 1.0 } else { GIVE_WAY_SHARE };
    Limits { brake_max_mps2: share * request.limits.brake_max_mps2, ..*request.limits }
}

/// Largest fraction of the deceleration used to give way. Beyond it, pedestrians are taken as predicted: a swerve may
/// still clear them.
const GIVE_WAY_SHARE: f64 = 0.75;

/// Returns true if a plan ends at rest.
fn stops(plan: Option<&Plan>) -> bool {
    plan.and_then(|plan| plan.points.last()).is_some_and(|p| p.speed_mps < CREEP_MPS)
}

/// Deceleration for giving way if there is enough room, m/s².
const COMFORT_BRAKE_MPS2: f64 = 3.0;

/// Gap left before the ground that others may cover if there is enough room, metres.
const YIELD_GAP_M: f64 = 1.0;

/// A stop is searched for over this much more than the gentle braking distance, seconds.
const YIELD_AHEAD_S: f64 = 1.0;

/// Plan along `path` at no more than the current speed, at rest after `way_m`.
fn stop_after(request: &Request<'_>, path: &Measured<'_>, way_m: f64, limits: &Limits) -> Plan {
    let steps = (way_m / PATH_STEP_M).ceil().max(1.0) as usize;
    let path: Vec<PathPoint> = (0..=steps).map(|k| path.at(way_m * k as f64 / steps as f64)).collect();
    let target_mps = request.target_speed_mps.min(request.start.speed_mps.max(CREEP_MPS));
    let points = timed_points(&path, &request.start, target_mps, SpeedProfile::LimitedToStop, limits);
    Plan { stamp: request.stamp, status: PlanStatus::Found, points, work: 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::CollisionMode;
    use crate::path::route::follow_route;
    use crate::testing::World;
    use swerve_map::Borders;
    use swerve_msg::ActorKind;

    #[test]
    fn free_plan_is_kept_and_blocked_plan_is_braked_along() {
        let world = World::straight(10.0);
        let request = world.request();
        let before = follow_route(&request, SpeedProfile::Limited, 4.0, PlanStatus::Route);
        let mut later = Request { previous: Some(&before), ..request };
        later.start.stamp = request.start.stamp + Span::from_ms(350);
        later.start.pose = later.start.pose.ahead(3.5);
        let clear = Obstacles::new(&[], CollisionMode::TimeIndexed);
        let plan = keep_or_brake(&later, &clear, 0.0);
        assert_eq!(plan.status, PlanStatus::Kept);
        assert_eq!(plan.points[0].at, later.start.stamp);
        assert!((plan.points[0].pose.x_m - 3.5).abs() < 1e-6);

        let blocked = World::straight(10.0).with_person((25.0, 0.0), (0.0, 0.0));
        let person = Obstacles::new(&blocked.predictions, CollisionMode::TimeIndexed);
        let plan = keep_or_brake(&later, &person, 0.0);
        assert_eq!(plan.status, PlanStatus::Brake);
        let last = plan.points[plan.points.len() - 1];
        assert!(last.speed_mps == 0.0);
        assert!((last.pose.x_m - (3.5 + 100.0 / 16.0)).abs() < 0.01, "{last:?}");
    }

    /// At 10 m/s, 3 m to the left of the line, an oncoming truck ahead. Half of 8 m/s² stops after 100 / 8 = 12.5 m,
    /// 12.1 m of them ahead; the path back with the lateral acceleration left by the friction circle, 6.9 m/s², is
    /// √(5.77 * 3 m * 100 / 6.9) = 15.8 m long: 0.26 m are left then.
    #[test]
    fn stop_ends_in_the_own_lane_unless_that_does_more_harm() {
        let mut world = World::straight(10.0);
        world.route = world.route.in_lane(Borders::constant(2.0, 2.0));
        world.limits.lateral_accel_max_mps2 = 8.0;
        world.start.pose = Pose2::new(0.0, 3.0, 0.0);
        let stop = |world: &World| {
            let obstacles = Obstacles::new(&world.predictions, CollisionMode::TimeIndexed);
            let plan = keep_or_brake(&world.request(), &obstacles, 0.2);
            assert_eq!(plan.status, PlanStatus::Brake);
            let (hardest, end) = (plan.points[0].accel_mps2, plan.points[plan.points.len() - 1]);
            assert!(end.speed_mps < 1e-9);
            (world.clearance_m(&plan, CollisionMode::TimeIndexed), hardest, end.pose)
        };
        let truck = |world: World| world.with(ActorKind::Truck, (8.0, 2.5), (45.0, 4.0), (-10.0, 0.0));
        let oncoming = truck(world);
        let (clearance_m, hardest, end) = stop(&oncoming);
        assert!(clearance_m > 0.15 && (hardest + 4.0).abs() < 1e-9, "{clearance_m} {hardest}");
        assert!((end.x_m - 12.1).abs() < 0.1 && (end.y_m - 0.26).abs() < 0.05, "{end:?}");
        // The truck would reach the ego at rest there, too; a person in the ego's lane would be hit at speed.
        let blocked = oncoming.with_person((9.0, 0.0), (0.0, 0.0));
        let (_, hardest, end) = stop(&blocked);
        assert!((hardest + 8.0).abs() < 1e-9 && (end.y_m - 3.0).abs() < 1e-6, "{hardest} {end:?}");
    }

    /// An ego that heads away from its lane first has to turn: near the line, a path as short as its offset alone allows
    /// would turn within a metre.
    #[test]
    fn stop_on_the_way_back_turns_no_tighter_than_the_tyres_allow() {
        for (y_m, heading_rad) in [(0.1, 0.2), (-0.3, 0.3), (1.5, 0.25), (0.0, -0.2), (2.0, 0.0)] {
            let mut world = World::straight(15.0);
            world.start.pose = Pose2::new(0.0, y_m, heading_rad);
            for share in SHARES {
                let plan = stop_on_way_back(&world.request(), share);
                let lateral = |p: &PlanPoint| p.curvature_1pm.abs() * p.speed_mps * p.speed_mps;
                let most_mps2 = plan.points.iter().map(lateral).fold(0.0, f64::max);
                let left_mps2 = world.limits.lateral_accel_max_mps2 * (1.0 - share * share).sqrt();
                assert!(
                    most_mps2 < 1.05 * left_mps2,
                    "{y_m} {heading_rad} {share}: {most_mps2} of {left_mps2}"
                );
            }
        }
    }

    #[test]
    fn plan_that_ends_at_rest_in_the_oncoming_lane_is_not_kept() {
        let mut world = World::straight(2.0);
        world.route = world.route.in_lane(Borders::constant(2.0, 2.0));
        let clear = Obstacles::new(&[], CollisionMode::TimeIndexed);
        let at = |ms: i64, x_m: f64, y_m: f64, speed_mps: f64| PlanPoint {
            at: world.start.stamp + Span::from_ms(ms),
            pose: Pose2::new(x_m, y_m, 0.0),
            speed_mps,
            ..PlanPoint::default()
        };
        let ends_at = |y_m: f64| {
            let points = vec![at(0, 0.0, 0.0, 2.0), at(2000, 2.0, y_m, 0.0)];
            let previous = Plan { points, ..Plan::default() };
            kept(&Request { previous: Some(&previous), ..world.request() }, &clear, 0.2).is_some()
        };
        // The lane ends at 2 m, the outline extends 0.93 m to the side, and 0.3 m over the border are allowed.
        assert!(ends_at(1.3) && !ends_at(1.5));
    }

    #[test]
    fn giving_way_stops_before_all_ground_that_a_pedestrian_may_cover() {
        // She approaches from the left and may stop anywhere between 4 m left and 6 m right of the line, 24.75 m ahead.
        let stopping = |speed_mps: f64, previous: Option<&Plan>| {
            let world = World::straight(speed_mps).with_person((25.0, 4.0), (0.0, -2.0));
            let obstacles = Obstacles::new(&world.predictions, CollisionMode::MayStop);
            let request = Request { previous, ..world.request() };
            let limits = comfort_limits(&request);
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
        // From 17 m/s it takes 7 of 8 m/s²: too much to start, but not to continue.
        assert_eq!(stopping(17.0, None), None);
        let stop = Plan { points: vec![PlanPoint::default()], ..Plan::default() };
        assert!(stopping(17.0, Some(&stop)).is_some());
        assert_eq!(stopping(20.0, Some(&stop)), None);
    }
}
