//! Whether parameters are in range.

use swerve_core::param::{ParamError, require, require_not_negative, require_positive};

use crate::{Law, Params};

/// Steps ahead beyond which a program no longer fits into a tick by far.
const HORIZON_MAX: usize = 200;

impl Params {
    /// The first parameter outside its range, if there is one.
    pub fn validate(&self) -> Result<(), ParamError> {
        let weights = &self.mpc.weights;
        above_zero(&[
            ("stop.decel_mps2", self.stop.decel_mps2),
            ("waypoint.steer_full_rad", self.waypoint.steer_full_rad),
            ("pure_pursuit.lookahead_min_m", self.pure_pursuit.lookahead_min_m),
            ("stanley.softening_mps", self.stanley.softening_mps),
            ("along.gain_ps", self.along.gain_ps),
            ("along.reach_m", self.along.reach_m),
            ("comfort_jerk_mps3", self.comfort_jerk_mps3),
            ("mpc.dt_s", self.mpc.dt_s),
            ("mpc.jerk_max_mps3", self.mpc.jerk_max_mps3),
            ("mpc.corridor_m", self.mpc.corridor_m),
            ("mpc.weights.steering_rate", weights.steering_rate),
            ("mpc.weights.jerk", weights.jerk),
            ("mpc.weights.slack_squared", weights.slack_squared),
            ("stanley.full_gain_mps", self.stanley.full_gain_mps),
            ("stop.blind_after_s", self.stop.blind_after_s),
            ("stop.blind_decel_mps2", self.stop.blind_decel_mps2),
        ])?;
        not_negative(&[
            ("pid.kp_spm", self.pid.kp_spm),
            ("pid.ki_pm", self.pid.ki_pm),
            ("pid.kd_s2pm", self.pid.kd_s2pm),
            ("waypoint.steer_gain", self.waypoint.steer_gain),
            ("waypoint.waypoint_min_m", self.waypoint.waypoint_min_m),
            ("pure_pursuit.lookahead_s", self.pure_pursuit.lookahead_s),
            ("pure_pursuit.preview_s", self.pure_pursuit.preview_s),
            ("stanley.gain_ps", self.stanley.gain_ps),
            ("stanley.yaw_damping_s", self.stanley.yaw_damping_s),
            ("stanley.preview_s", self.stanley.preview_s),
            ("speed.kp_ps", self.speed.kp_ps),
            ("speed.ki_ps2", self.speed.ki_ps2),
            ("speed.integral_max_mps2", self.speed.integral_max_mps2),
            ("speed.hold_mps2", self.speed.hold_mps2),
            ("along.speed_max_mps", self.along.speed_max_mps),
            ("mpc.speed_max_mps", self.mpc.speed_max_mps),
            ("mpc.edge_m", self.mpc.edge_m),
            ("mpc.lead_s", self.mpc.lead_s),
            ("mpc.shift_max_s", self.mpc.shift_max_s),
            ("mpc.fallback_brake_mps2", self.mpc.fallback_brake_mps2),
            ("mpc.weights.along", weights.along),
            ("mpc.weights.across", weights.across),
            ("mpc.weights.heading", weights.heading),
            ("mpc.weights.speed", weights.speed),
            ("mpc.weights.steering", weights.steering),
            ("mpc.weights.accel", weights.accel),
            ("mpc.weights.terminal", weights.terminal),
            ("mpc.weights.slack", weights.slack),
        ])?;
        let share = "0 to 1";
        for (key, value) in
            [("pid.throttle_max", self.pid.throttle_max), ("pid.brake_max", self.pid.brake_max)]
        {
            require(key, value, (0.0..=1.0).contains(&value), share)?;
        }
        let reach = self.pure_pursuit.lookahead_max_m;
        let ordered = reach >= self.pure_pursuit.lookahead_min_m;
        require("pure_pursuit.lookahead_max_m", reach, ordered, "finite and at least lookahead_min_m")?;
        let horizon = self.mpc.horizon;
        let fits = self.law != Law::Mpc || (1..=HORIZON_MAX).contains(&horizon);
        require("mpc.horizon", horizon, fits, "1 to 200")?;
        require("slip.rear_s2pm", self.slip.rear_s2pm, true, "a finite number")?;
        require("slip.understeer_s2pm", self.slip.understeer_s2pm, true, "a finite number")?;
        require("slip.braking_s4pm2", self.slip.braking_s4pm2, true, "a finite number")
    }
}

fn above_zero(values: &[(&'static str, f64)]) -> Result<(), ParamError> {
    values.iter().try_for_each(|&(key, value)| require_positive(key, value))
}

fn not_negative(values: &[(&'static str, f64)]) -> Result<(), ParamError> {
    values.iter().try_for_each(|&(key, value)| require_not_negative(key, value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_presets_are_in_range() {
        assert_eq!(Params::default().validate(), Ok(()));
    }

    #[test]
    fn what_is_out_of_range_is_named() {
        let check = |spoil: fn(&mut Params), want: &str| {
            let mut params = Params { law: Law::Mpc, ..Params::default() };
            spoil(&mut params);
            assert_eq!(params.validate().unwrap_err().to_string(), want);
        };
        check(|p| p.mpc.horizon = 0, "`mpc.horizon` is 0, expected 1 to 200");
        check(|p| p.mpc.dt_s = f64::NAN, "`mpc.dt_s` is NaN, expected a finite number above 0");
        check(|p| p.pid.kp_spm = -1.0, "`pid.kp_spm` is -1, expected a finite number that is not negative");
        check(|p| p.stop.blind_after_s = 0.0, "`stop.blind_after_s` is 0, expected a finite number above 0");
        check(
            |p| p.pure_pursuit.lookahead_max_m = 1.0,
            "`pure_pursuit.lookahead_max_m` is 1, expected finite and at least lookahead_min_m",
        );
    }
}
