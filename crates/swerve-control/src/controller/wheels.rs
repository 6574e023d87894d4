//! Limits on the steering change per step.

use swerve_geom::angle_between;

use super::{Here, Input, Law, LawController, Status, StopReason};

/// Below this speed the steering rate on a comfortable plan is limited as at this speed, m/s.
const SLOW_MPS: f64 = 6.0;

/// Tolerances of position and heading within which an ego is on its plan.
const ON_PLAN_M: f64 = 0.2;
const ON_PLAN_RAD: f64 = 0.03;

impl LawController {
    /// Largest change of the steering angle in one step, radians: on a comfortable plan limited by the lateral jerk of
    /// comfort (`v² κ`, with the wheels' angle close to wheelbase times curvature); off it not limited.
    pub(super) fn steering_change_rad(
        &self,
        input: &Input<'_>,
        status: Status,
        here: &Here,
        dt_s: f64,
    ) -> f64 {
        if self.params.law == Law::Pid {
            return f64::INFINITY;
        }
        let v = input.ego.speed_mps.abs().max(SLOW_MPS);
        let gentle = self.shape.wheelbase_m * self.params.comfort_jerk_mps3 / (v * v) * dt_s;
        // Before the first plan nothing is known that would justify a swerve.
        if status == Status::Route {
            return gentle;
        }
        let is_outdated = status == Status::Stopping(StopReason::PlanOutdated);
        if !input.is_gentle() || !(is_outdated || status == Status::Plan) {
            return f64::INFINITY;
        }
        // An ego beside an outdated plan is led back by the next one.
        if is_outdated {
            return gentle;
        }
        let (ego, beside) = (input.ego, self.at(here.s_m).pose);
        let off_m = beside.point().distance(ego.pose.point());
        let off_rad = angle_between(beside.heading_rad, ego.pose.heading_rad).abs();
        if off_m > ON_PLAN_M || off_rad > ON_PLAN_RAD {
            return f64::INFINITY;
        }
        gentle
    }
}
