//! The route as a path.

use swerve_geom::{Polyline, Pose2};
use swerve_msg::{Plan, PlanStatus};

use super::points::PathPoint;
use super::speed::{SpeedProfile, timed_points};
use crate::request::Request;

/// Distance between the points of plans made from geometry alone, metres.
pub const PATH_STEP_M: f64 = 1.0;

/// The pose on the route `ahead_m` after the place nearest to `from`.
pub fn route_pose_ahead(route: &Polyline, from: Pose2, ahead_m: f64) -> Pose2 {
    route.at(route.project(from.point()).s_m + ahead_m).pose
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::World;

    #[test]
    fn ahead_is_measured_along_the_route() {
        let world = World::straight(10.0);
        assert_eq!(route_pose_ahead(world.route.line(), world.start.pose, 12.0), Pose2::new(12.0, 0.0, 0.0));
    }
}
