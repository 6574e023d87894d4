//! What the motion planners share around their search: where a plan starts, when to search at all, how a
//! path becomes a plan, and what to do when there is none.

use swerve_core::{Span, Time};
use swerve_geom::{Ego, Point2, Polyline, Pose2, angle_between, math};
use swerve_msg::{EgoState, Plan, PlanPoint, PlanStatus, Prediction};
use swerve_vehicle::Limits;

use crate::collision::{Obstacles, between};
use crate::request::Request;

/// Distance between the points of plans made from geometry alone, metres.
pub const PATH_STEP_M: f64 = 1.0;

/// Time between the points of braking plans, seconds.
const BRAKE_STEP_S: f64 = 0.1;

/// Slowest mean speed that a stretch of a plan is timed with, m/s: keeps times finite at standstill.
const CREEP_MPS: f64 = 0.1;

/// The state expected `ahead` after `measured`.
///
/// With a previous plan that covers both instants the ego is moved as the plan moves between them (its
/// present offset from the plan is carried along); with one that begins in between, the ego is taken to be
/// on it then; else it goes on with constant speed and yaw rate.
pub fn predicted_start(measured: &EgoState, previous: Option<&Plan>, ahead: Span) -> EgoState {
    let stamp = measured.stamp + ahead;
    let steadily = moved_steadily(measured, ahead);
    let Some(plan) = previous.filter(|plan| stamp <= plan.end()) else { return steadily };
    let (Some(first), Some(then)) = (plan.points.first(), plan.at(stamp)) else { return steadily };
    if stamp < first.at {
        return steadily;
    }
    if measured.stamp < first.at {
        // The plan has not begun yet: its own first point is the best guess of where it will be taken up.
        return moved_with_plan(&on_plan(measured, first), first, &then, stamp);
    }
    match plan.at(measured.stamp) {
        Some(now) => moved_with_plan(measured, &now, &then, stamp),
        None => steadily,
    }
}

fn on_plan(measured: &EgoState, p: &PlanPoint) -> EgoState {
    EgoState { stamp: p.at, pose: p.pose, speed_mps: p.speed_mps, ..*measured }
}

fn moved_with_plan(measured: &EgoState, now: &PlanPoint, then: &PlanPoint, stamp: Time) -> EgoState {
    let local: swerve_geom::Point2<swerve_geom::Ego> = now.pose.to_local(then.pose.point());
    let point = measured.pose.from_local(local);
    let turn = angle_between(now.pose.heading_rad, then.pose.heading_rad);
    let speed_mps = (measured.speed_mps + then.speed_mps - now.speed_mps).max(0.0);
    let yaw_rate_radps = speed_mps * then.curvature_1pm;
    EgoState {
        stamp,
        pose: Pose2::new(point.x_m, point.y_m, measured.pose.heading_rad + turn),
        speed_mps,
        accel_mps2: then.accel_mps2,
        lateral_accel_mps2: speed_mps * yaw_rate_radps,
        yaw_rate_radps,
        steering_rad: measured.steering_rad,
    }
}

fn moved_steadily(measured: &EgoState, ahead: Span) -> EgoState {
    let (t, turn) = (ahead.as_secs(), measured.yaw_rate_radps * ahead.as_secs());
    // Chord of the arc: length v t sinc(turn / 2), direction half way through the turn.
    let half = 0.5 * turn;
    let sinc = if half.abs() < 1e-6 { 1.0 } else { math::sin(half) / half };
    let chord: Pose2 = Pose2::new(measured.pose.x_m, measured.pose.y_m, measured.pose.heading_rad + half)
        .ahead(measured.speed_mps * t * sinc);
    let pose = Pose2::new(chord.x_m, chord.y_m, measured.pose.heading_rad + turn);
    EgoState { stamp: measured.stamp + ahead, pose, ..*measured }
}

/// Whether anything predicted is ever within `range_m` (centre to ego origin) of where the ego starts.
pub fn obstacle_in_range(predictions: &[Prediction], start: Pose2, range_m: f64) -> bool {
    predictions
        .iter()
        .any(|p| p.path.iter().any(|place| place.pose.point().distance(start.point()) <= range_m))
}

/// The predictions that have a place within `range_m` of `start`, in their order.
pub fn within_range(predictions: &[Prediction], start: Pose2, range_m: f64) -> Vec<Prediction> {
    let near = |p: &&Prediction| obstacle_in_range(core::slice::from_ref(*p), start, range_m);
    predictions.iter().filter(near).cloned().collect()
}

/// The pose on the route `ahead_m` after the place nearest to `from`.
pub fn route_pose_ahead(route: &Polyline, from: Pose2, ahead_m: f64) -> Pose2 {
    route.at(route.project(from.point()).s_m + ahead_m).pose
}

/// How fast a path is driven.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum SpeedProfile {
    /// The target speed from the first point on, whatever the start: what Pylot does.
    Constant,
    /// From the start's speed within acceleration, braking and lateral limits.
    Limited,
    /// The same, and at rest in the path's last point.
    LimitedToStop,
}

/// One point of a path without times.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct PathPoint {
    /// Pose of the ego origin.
    pub pose: Pose2,
    /// Curvature, 1/m; positive turns left.
    pub curvature_1pm: f64,
}

/// Path points with curvatures from the change of heading between neighbours (centred inside).
pub fn with_curvature(poses: &[Pose2]) -> Vec<PathPoint> {
    let last = poses.len().saturating_sub(1);
    poses
        .iter()
        .enumerate()
        .map(|(i, &pose)| {
            let (a, b) = (i.saturating_sub(1), (i + 1).min(last));
            let length_m: f64 = poses[a..=b].windows(2).map(|p| p[0].point().distance(p[1].point())).sum();
            let turn = angle_between(poses[a].heading_rad, poses[b].heading_rad);
            let curvature_1pm = if length_m > 1e-9 { turn / length_m } else { 0.0 };
            PathPoint { pose, curvature_1pm }
        })
        .collect()
}

/// A path driven from `start` (its stamp, its speed) towards `target_mps`; appends to `points`.
///
/// Under [`SpeedProfile::Limited`] speeds keep `limits`: lateral acceleration everywhere, braking before
/// curves, acceleration out of them; the start's speed is taken as it is, so where it is too high for what
/// follows the plan brakes as hard as it may.
pub fn timed_points(
    path: &[PathPoint],
    start: &EgoState,
    target_mps: f64,
    profile: SpeedProfile,
    limits: &Limits,
) -> Vec<PlanPoint> {
    let gaps_m: Vec<f64> = path.windows(2).map(|p| p[0].pose.point().distance(p[1].pose.point())).collect();
    let speeds_mps = match profile {
        SpeedProfile::Constant => vec![target_mps; path.len()],
        SpeedProfile::Limited => limited_speeds(path, &gaps_m, start.speed_mps, (target_mps, false), limits),
        SpeedProfile::LimitedToStop => {
            limited_speeds(path, &gaps_m, start.speed_mps, (target_mps, true), limits)
        }
    };
    let mut at = start.stamp;
    let mut points: Vec<PlanPoint> = Vec::with_capacity(path.len());
    for (i, p) in path.iter().enumerate() {
        let (mut accel_mps2, speed_mps) = (0.0, speeds_mps[i]);
        if let Some(gap_m) = gaps_m.get(i) {
            let next_mps = speeds_mps[i + 1];
            if *gap_m > 1e-9 {
                accel_mps2 = (next_mps * next_mps - speed_mps * speed_mps) / (2.0 * gap_m);
            }
        }
        if i > 0 {
            let mean_mps = (0.5 * (speeds_mps[i - 1] + speed_mps)).max(CREEP_MPS);
            at += Span::from_secs(gaps_m[i - 1] / mean_mps);
        }
        // Repeated poses give no time to pass: keep instants strictly increasing.
        if points.last().is_some_and(|last| at <= last.at) {
            continue;
        }
        points.push(PlanPoint { at, pose: p.pose, curvature_1pm: p.curvature_1pm, speed_mps, accel_mps2 });
    }
    points
}

/// Forward and backward pass over `v² = v0² + 2 a s`; where it `stops` the last speed is zero.
fn limited_speeds(
    path: &[PathPoint],
    gaps_m: &[f64],
    start_mps: f64,
    (target_mps, stops): (f64, bool),
    limits: &Limits,
) -> Vec<f64> {
    let mut speeds: Vec<f64> = path
        .iter()
        .map(|p| {
            let curve = p.curvature_1pm.abs().max(1e-9);
            target_mps.max(0.0).min((limits.lateral_accel_max_mps2 / curve).sqrt())
        })
        .collect();
    if let Some(last) = speeds.last_mut().filter(|_| stops) {
        *last = 0.0;
    }
    let reach = |from: f64, a: f64, gap: f64| (from * from + 2.0 * a * gap).max(0.0).sqrt();
    for i in (0..gaps_m.len()).rev() {
        speeds[i] = speeds[i].min(reach(speeds[i + 1], limits.brake_max_mps2, gaps_m[i]));
    }
    if let Some(first) = speeds.first_mut() {
        *first = start_mps.max(0.0);
    }
    for (i, &gap) in gaps_m.iter().enumerate() {
        let slowest = reach(speeds[i], -limits.brake_max_mps2, gap);
        let fastest = reach(speeds[i], limits.accel_max_mps2, gap);
        speeds[i + 1] = speeds[i + 1].clamp(slowest.min(fastest), fastest);
    }
    speeds
}

/// Points of the route from beside `from` on, for `length_m`.
pub fn route_path(route: &Polyline, from: Pose2, length_m: f64) -> Vec<PathPoint> {
    let s_m = route.project(from.point()).s_m;
    let steps = (length_m.max(0.0) / PATH_STEP_M).ceil().clamp(1.0, 10_000.0) as usize;
    (0..=steps)
        .map(|k| {
            let p = route.at(s_m + k as f64 * PATH_STEP_M);
            PathPoint { pose: p.pose, curvature_1pm: p.curvature_1pm }
        })
        .collect()
}

/// Follows the route at the target speed for `horizon_s`.
pub fn follow_route(
    request: &Request<'_>,
    profile: SpeedProfile,
    horizon_s: f64,
    status: PlanStatus,
) -> Plan {
    let fastest_mps = request.target_speed_mps.max(request.start.speed_mps).max(1.0);
    let path = route_path(request.route.line(), request.start.pose, fastest_mps * horizon_s);
    let points = timed_points(&path, &request.start, request.target_speed_mps, profile, request.limits);
    Plan { stamp: request.stamp, status, points, work: 0 }
}

/// What to do when no path is found.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Fallback {
    /// Speed zero along the route: Pylot's FOT.
    StopOnRoute,
    /// The route, regardless: Pylot's RRT* and Hybrid A*.
    FollowRoute,
    /// The previous plan while it is free of collision, else full brake along it.
    KeepOrBrake,
}

/// The plan when no path is found.
///
/// `clearance_m` is what a kept plan must keep. `horizon_s` is the length of a followed route.
pub fn fall_back(
    fallback: Fallback,
    request: &Request<'_>,
    obstacles: &Obstacles,
    clearance_m: f64,
    horizon_s: f64,
) -> Plan {
    match fallback {
        Fallback::FollowRoute => follow_route(request, SpeedProfile::Constant, horizon_s, PlanStatus::GaveUp),
        Fallback::StopOnRoute => {
            let path = route_path(request.route.line(), request.start.pose, brake_length_m(request));
            let mut plan = brake_along(request, &path, PlanStatus::Stop);
            plan.points.iter_mut().for_each(|p| p.speed_mps = 0.0);
            plan
        }
        Fallback::KeepOrBrake => kept(request, obstacles, clearance_m).unwrap_or_else(|| brake(request)),
    }
}

/// Way to standstill under full brake, with something to spare, metres.
pub fn brake_length_m(request: &Request<'_>) -> f64 {
    let v = request.start.speed_mps.max(0.0);
    v * v / (2.0 * request.limits.brake_max_mps2) + PATH_STEP_M
}

/// What is left of the previous plan, if it is still free of collision and the ego is on it.
pub fn kept(request: &Request<'_>, obstacles: &Obstacles, clearance_m: f64) -> Option<Plan> {
    let previous = request.previous?;
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
    // What comes after it counts too: it is kept only as long as the ego can still come to a stop, be it at its end or
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

/// An ego further from its plan than this is not on it, metres.
const OFF_PLAN_M: f64 = 2.0;

/// How long a plan may be driven on where only braking can follow it: some periods of planning.
const BRAKE_LATER: Span = Span::from_ms(300);

/// A stop before what the obstacles may come to cover of the way ahead: gently if that suffices, else as hard as it
/// must be. `None` where braking as hard as the limits allow does not keep `clearance_m`.
///
/// For [`CollisionMode::MayStop`](crate::collision::CollisionMode::MayStop): who gives way to a walker has a stop left
/// wherever the walker stops. Meant to be asked anew with every frame: once the way is free, it is driven on.
pub fn give_way(request: &Request<'_>, obstacles: &Obstacles, clearance_m: f64) -> Option<Plan> {
    let free = |plan: &Plan, clearance_m: f64| {
        let path: Vec<(Pose2, Time)> = plan.points.iter().map(|p| (p.pose, p.at)).collect();
        obstacles.path_free(|pose| request.shape.footprint(pose), &path, clearance_m)
    };
    let path = with_curvature(&way_ahead(request));
    let covered = |s_m: f64| {
        let footprint = request.shape.footprint(along(&path, s_m).pose);
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
        if free(&plan, clearance_m) {
            return Some(plan);
        }
    }
    // A stop that is under way is not given up for less than a touch.
    let needed_m = if stops(request.previous) { 0.0 } else { clearance_m };
    Some(brake(request)).filter(|plan| free(plan, needed_m))
}

/// What a plan may ask for that gives way, or goes round all that walkers may do: not all of the brakes, so that what is
/// late or off is made up for; all of them once a stop is under way.
pub fn eased_limits(request: &Request<'_>) -> Limits {
    let share = if stops(request.previous) { 1.0 } else { GIVE_WAY_SHARE };
    Limits { brake_max_mps2: share * request.limits.brake_max_mps2, ..*request.limits }
}

/// Share of the deceleration that giving way may need. Where it takes more, walkers are taken as predicted: a swerve
/// may still clear them.
const GIVE_WAY_SHARE: f64 = 0.75;

/// Whether a plan ends at rest.
fn stops(plan: Option<&Plan>) -> bool {
    plan.and_then(|plan| plan.points.last()).is_some_and(|p| p.speed_mps < CREEP_MPS)
}

/// Deceleration that giving way gets by with where there is room, m/s².
const COMFORT_BRAKE_MPS2: f64 = 3.0;

/// What is left before the ground that others may come to cover, where there is room, metres.
const YIELD_GAP_M: f64 = 1.0;

/// A stop is looked for this much further than it takes to brake gently, seconds.
const YIELD_AHEAD_S: f64 = 1.0;

/// Along `path` at no more than the present speed, at rest after `way_m`.
fn stop_after(request: &Request<'_>, path: &[PathPoint], way_m: f64, limits: &Limits) -> Plan {
    let steps = (way_m / PATH_STEP_M).ceil().max(1.0) as usize;
    let path: Vec<PathPoint> = (0..=steps).map(|k| along(path, way_m * k as f64 / steps as f64)).collect();
    let target_mps = request.target_speed_mps.min(request.start.speed_mps.max(CREEP_MPS));
    let points = timed_points(&path, &request.start, target_mps, SpeedProfile::LimitedToStop, limits);
    Plan { stamp: request.stamp, status: PlanStatus::Found, points, work: 0 }
}

/// Full brake along the rest of the previous plan's path, or along the present arc without one.
pub fn brake(request: &Request<'_>) -> Plan {
    brake_along(request, &with_curvature(&way_ahead(request)), PlanStatus::Brake)
}

/// The rest of the previous plan's path from the start on, or the present arc without one.
fn way_ahead(request: &Request<'_>) -> Vec<Pose2> {
    let start = request.start.pose;
    let mut poses = vec![start];
    if let Some(previous) = request.previous {
        let ahead = |pose: Pose2| {
            let local: swerve_geom::Point2<swerve_geom::Ego> = start.to_local(pose.point());
            local.x_m > 0.1
        };
        let rest = previous.points.iter().filter(|p| p.at > request.start.stamp).map(|p| p.pose);
        poses.extend(rest.skip_while(|&pose| !ahead(pose)));
    }
    if poses.len() == 1 {
        poses = present_arc(&request.start, brake_length_m(request));
    }
    poses
}

/// Poses on the circle that the ego is on, for `length_m`.
fn present_arc(start: &EgoState, length_m: f64) -> Vec<Pose2> {
    let curvature = if start.speed_mps > 1.0 { start.yaw_rate_radps / start.speed_mps } else { 0.0 };
    let steps = (length_m / PATH_STEP_M).ceil().clamp(1.0, 1000.0) as usize;
    let on_arc = |k: usize| {
        let unit = EgoState { speed_mps: 1.0, yaw_rate_radps: curvature, ..*start };
        moved_steadily(&unit, Span::from_secs(k as f64 * PATH_STEP_M)).pose
    };
    (0..=steps).map(on_arc).collect()
}

/// Full brake along `path` (extended straight where it is too short) until standstill.
pub fn brake_along(request: &Request<'_>, path: &[PathPoint], status: PlanStatus) -> Plan {
    let (v0, brake) = (request.start.speed_mps.max(0.0), request.limits.brake_max_mps2);
    let stop_s = v0 / brake;
    let steps = (stop_s / BRAKE_STEP_S).ceil().max(1.0) as usize;
    let mut points = Vec::with_capacity(steps + 1);
    for k in 0..=steps {
        let t = k as f64 * BRAKE_STEP_S;
        let moving = t.min(stop_s);
        let p = along(path, v0 * moving - 0.5 * brake * moving * moving);
        points.push(PlanPoint {
            at: request.start.stamp + Span::from_secs(t),
            pose: p.pose,
            curvature_1pm: p.curvature_1pm,
            speed_mps: (v0 - brake * t).max(0.0),
            accel_mps2: if t < stop_s { -brake } else { 0.0 },
        });
    }
    Plan { stamp: request.stamp, status, points, work: 0 }
}

/// The point `s_m` along a path; straight on beyond its end. The path has at least one point.
fn along(path: &[PathPoint], s_m: f64) -> PathPoint {
    let mut left_m = s_m;
    for pair in path.windows(2) {
        let gap_m = pair[0].pose.point().distance(pair[1].pose.point());
        if left_m <= gap_m && gap_m > 0.0 {
            let u = left_m / gap_m;
            let curvature_1pm = pair[0].curvature_1pm + (pair[1].curvature_1pm - pair[0].curvature_1pm) * u;
            return PathPoint { pose: between(pair[0].pose, pair[1].pose, u), curvature_1pm };
        }
        left_m -= gap_m;
    }
    let last = path.last().copied().unwrap_or_default();
    PathPoint { pose: last.pose.ahead(left_m.max(0.0)), curvature_1pm: 0.0 }
}

#[cfg(test)]
mod tests;
