//! The route as a path.

use swerve_geom::Polyline;
use swerve_msg::{Plan, PlanStatus};

use super::points::PathPoint;
use super::speed::{SpeedProfile, timed_points};
use crate::request::Request;

/// Spacing of points of plans made from geometry alone, metres.
pub const PATH_STEP_M: f64 = 1.0;

/// Points of the route from arc length `s_m` on, for `length_m`.
pub fn route_path(route: &Polyline, s_m: f64, length_m: f64) -> Vec<PathPoint> {
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
    let path = route_path(request.route.line(), request.place().s_m, fastest_mps * horizon_s);
    let points = timed_points(&path, &request.start, request.target_speed_mps, profile, request.limits);
    Plan { stamp: request.stamp, status, points, work: 0 }
}
