//! Full brake, along a path or without one.

use swerve_core::Span;
use swerve_geom::{Ego, Point2, Pose2};
use swerve_msg::{EgoState, Plan, PlanPoint, PlanStatus};

use crate::path::points::{Measured, PathPoint, with_curvature};
use crate::path::route::PATH_STEP_M;
use crate::request::Request;
use crate::start::moved_steadily;

/// Time step of braking plans, seconds.
const BRAKE_STEP_S: f64 = 0.1;

/// Stopping distance under full brake plus one path step, metres.
pub fn brake_length_m(request: &Request<'_>) -> f64 {
    let v = request.start.speed_mps.max(0.0);
    v * v / (2.0 * request.limits.brake_max_mps2) + PATH_STEP_M
}

/// Full brake along the rest of the previous plan's path, or along the current arc if there is no previous plan.
pub fn brake(request: &Request<'_>) -> Plan {
    brake_along(request, &with_curvature(&way_ahead(request)), PlanStatus::Brake)
}

/// Rest of the previous plan's path from the start on, or the current arc if there is none.
pub(crate) fn way_ahead(request: &Request<'_>) -> Vec<Pose2> {
    let start = request.start.pose;
    let mut poses = vec![start];
    if let Some(previous) = request.previous {
        let ahead = |pose: Pose2| {
            let local: Point2<Ego> = start.to_local(pose.point());
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

/// Poses along the ego's current circle, for `length_m`.
fn present_arc(start: &EgoState, length_m: f64) -> Vec<Pose2> {
    let curvature = if start.speed_mps > 1.0 { start.yaw_rate_radps / start.speed_mps } else { 0.0 };
    let steps = (length_m / PATH_STEP_M).ceil().clamp(1.0, 1000.0) as usize;
    let on_arc = |k: usize| {
        let unit = EgoState { speed_mps: 1.0, yaw_rate_radps: curvature, ..*start };
        moved_steadily(&unit, Span::from_secs(k as f64 * PATH_STEP_M)).pose
    };
    (0..=steps).map(on_arc).collect()
}

/// Full brake along `path` to standstill; a path that is too short is extended straight.
pub fn brake_along(request: &Request<'_>, path: &[PathPoint], status: PlanStatus) -> Plan {
    let (v0, brake) = (request.start.speed_mps.max(0.0), request.limits.brake_max_mps2);
    let stop_s = v0 / brake;
    let steps = (stop_s / BRAKE_STEP_S).ceil().max(1.0) as usize;
    let mut points = Vec::with_capacity(steps + 1);
    let path = Measured::new(path);
    for k in 0..=steps {
        let t = k as f64 * BRAKE_STEP_S;
        let moving = t.min(stop_s);
        let p = path.at(v0 * moving - 0.5 * brake * moving * moving);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::World;

    #[test]
    fn braking_without_a_plan_stays_on_the_circle() {
        let mut world = World::straight(10.0);
        world.start.yaw_rate_radps = 0.5;
        let plan = brake(&world.request());
        let center = Point2::new(0.0, 20.0);
        for p in &plan.points {
            assert!((p.pose.point().distance(center) - 20.0).abs() < 0.01, "{p:?}");
        }
    }
}
