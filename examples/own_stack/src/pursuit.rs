//! A controller: pure pursuit of the plan, and its speed by a proportional law.

use serde::{Deserialize, Serialize};
use swerve_control::{Controller, Input, Output, Status};
use swerve_core::Span;
use swerve_core::param::{ParamError, require_within};
use swerve_geom::math;
use swerve_msg::Command;
use swerve_stack::{ControllerSetup, NamedController};
use swerve_vehicle::{VehicleParams, pedals_for_accel};

/// Parameters, in `control.params`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Acceleration for each m/s below the planned speed, 0.1 to 5 1/s.
    gain_ps: f64,
}

/// Steers for the plan's point one second ahead.
pub struct Pursuit(Params, VehicleParams);

impl Controller for Pursuit {
    fn step(&mut self, input: &Input<'_>) -> Output {
        let (gain_ps, ego) = (self.0.gain_ps, input.ego);
        let at = |ahead_s: f64| input.plan?.at(input.now + Span::from_secs(ahead_s));
        // Stops at the end of a plan; coasts without one.
        let is_over = input.plan.is_some_and(|plan| input.now > plan.end());
        let planned_mps = if is_over { 0.0 } else { at(0.3).map_or(ego.speed_mps, |point| point.speed_mps) };
        let accel_mps2 = (gain_ps * (planned_mps - ego.speed_mps)).clamp(-6.0, 3.0);
        let curvature_1pm = at(1.0).map_or(0.0, |ahead| {
            let ahead = ego.pose.to_local::<()>(ahead.pose.point());
            2.0 * ahead.y_m / (ahead.x_m.powi(2) + ahead.y_m.powi(2)).max(9.0)
        });
        let steering_rad = math::atan(curvature_1pm * self.1.shape.wheelbase_m);
        let pedals = pedals_for_accel(&self.1, ego.speed_mps, accel_mps2);
        let command = Command { steering_rad, throttle: pedals.throttle, brake: pedals.brake };
        let accel_mps2 = Some(accel_mps2);
        Output { command, speed_mps: planned_mps, accel_mps2, status: Status::Plan, mpc: None }
    }
}

impl NamedController for Pursuit {
    const NAME: &'static str = "pursuit";
    type Params = Params;

    fn defaults(_: ControllerSetup<'_>) -> Params {
        Params { gain_ps: 1.0 }
    }

    fn with_params(params: Params, of: ControllerSetup<'_>) -> Result<Self, ParamError> {
        require_within("gain_ps", params.gain_ps, [0.1, 5.0])?;
        Ok(Self(params, of.vehicle.clone()))
    }
}
