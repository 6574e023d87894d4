//! Properties of a plan: its end state and its largest deceleration.

use swerve_geom::Ego;
use swerve_msg::Plan;

use crate::request::Request;

/// Below this speed the ego is at rest, m/s.
pub(super) const AT_REST_MPS: f64 = 0.5;

/// Returns true if a plan ends at rest.
pub(super) fn rests(plan: &Plan) -> bool {
    ends_slower(plan, AT_REST_MPS)
}

/// Returns true if a plan ends below this speed, m/s.
pub(super) fn ends_slower(plan: &Plan, speed_mps: f64) -> bool {
    plan.points.last().is_some_and(|end| end.speed_mps < speed_mps)
}

/// Returns true if a plan ends at rest outside the ego's lane.
pub(super) fn ends_beside(plan: &Plan, request: &Request<'_>) -> bool {
    rests(plan) && plan.points.last().is_some_and(|end| !request.may_rest_at(end.pose))
}

/// Returns true if a plan ends further along the route than another.
pub(super) fn ends_beyond(plan: &Plan, other: &Plan) -> bool {
    let (Some(end), Some(its)) = (plan.points.last(), other.points.last()) else { return true };
    its.pose.to_local::<Ego>(end.pose.point()).x_m > 0.0
}

/// Largest deceleration of a plan, m/s².
pub(super) fn brakes_mps2(plan: &Plan) -> f64 {
    plan.points.iter().map(|p| -p.accel_mps2).fold(0.0, f64::max)
}
