//! Range checks of controller parameters.

use swerve_core::param::{ParamError, require, require_all_within};

use crate::{Law, Params};

/// Longest horizon, in steps; beyond it a program takes far longer than a control period.
const HORIZON_MAX: usize = 200;

impl Params {
    /// Checks that all parameters are in range; returns the first that is not.
    pub fn validate(&self) -> Result<(), ParamError> {
        let Self { stop, pid, waypoint, pure_pursuit, stanley, speed, along, slip, mpc, .. } = self;
        let (gain, weight) = ([0.0, 1000.0], [0.0, 1e9]);
        require_all_within(&[
            ("stop.decel_mps2", stop.decel_mps2, [0.1, 20.0]),
            ("stop.blind_decel_mps2", stop.blind_decel_mps2, [0.1, 20.0]),
            ("stop.blind_after_s", stop.blind_after_s, [0.001, 60.0]),
            ("pid.kp_spm", pid.kp_spm, gain),
            ("pid.ki_pm", pid.ki_pm, gain),
            ("pid.kd_s2pm", pid.kd_s2pm, gain),
            ("pid.throttle_max", pid.throttle_max, [0.0, 1.0]),
            ("pid.brake_max", pid.brake_max, [0.0, 1.0]),
            ("waypoint.steer_full_rad", waypoint.steer_full_rad, [0.01, 10.0]),
            ("waypoint.steer_gain", waypoint.steer_gain, gain),
            ("waypoint.waypoint_min_m", waypoint.waypoint_min_m, [0.0, 1000.0]),
            ("pure_pursuit.lookahead_min_m", pure_pursuit.lookahead_min_m, [0.1, 1000.0]),
            ("pure_pursuit.lookahead_max_m", pure_pursuit.lookahead_max_m, [0.1, 1000.0]),
            ("pure_pursuit.lookahead_s", pure_pursuit.lookahead_s, [0.0, 60.0]),
            ("pure_pursuit.preview_s", pure_pursuit.preview_s, [0.0, 10.0]),
            ("stanley.gain_ps", stanley.gain_ps, gain),
            ("stanley.softening_mps", stanley.softening_mps, [0.001, 100.0]),
            ("stanley.full_gain_mps", stanley.full_gain_mps, [0.001, 1000.0]),
            ("stanley.yaw_damping_s", stanley.yaw_damping_s, [0.0, 10.0]),
            ("stanley.preview_s", stanley.preview_s, [0.0, 10.0]),
            ("speed.kp_ps", speed.kp_ps, gain),
            ("speed.ki_ps2", speed.ki_ps2, gain),
            ("speed.integral_max_mps2", speed.integral_max_mps2, [0.0, 100.0]),
            ("speed.hold_mps2", speed.hold_mps2, [0.0, 100.0]),
            ("along.gain_ps", along.gain_ps, [0.001, 100.0]),
            ("along.speed_max_mps", along.speed_max_mps, [0.0, 100.0]),
            ("along.reach_m", along.reach_m, [0.1, 1000.0]),
            ("comfort_jerk_mps3", self.comfort_jerk_mps3, [0.1, 1000.0]),
            ("slip.rear_s2pm", slip.rear_s2pm, [-1.0, 1.0]),
            ("slip.understeer_s2pm", slip.understeer_s2pm, [-1.0, 1.0]),
            ("slip.braking_s4pm2", slip.braking_s4pm2, [-1.0, 1.0]),
            ("mpc.dt_s", mpc.dt_s, [0.01, 1.0]),
            ("mpc.speed_max_mps", mpc.speed_max_mps, [0.0, 200.0]),
            ("mpc.jerk_max_mps3", mpc.jerk_max_mps3, [0.1, 1000.0]),
            ("mpc.corridor_m", mpc.corridor_m, [0.01, 100.0]),
            ("mpc.edge_m", mpc.edge_m, [0.0, 100.0]),
            ("mpc.lead_s", mpc.lead_s, [0.0, 10.0]),
            ("mpc.shift_max_s", mpc.shift_max_s, [0.0, 60.0]),
            ("mpc.fallback_brake_mps2", mpc.fallback_brake_mps2, [0.0, 20.0]),
            ("mpc.weights.along", mpc.weights.along, weight),
            ("mpc.weights.across", mpc.weights.across, weight),
            ("mpc.weights.heading", mpc.weights.heading, weight),
            ("mpc.weights.speed", mpc.weights.speed, weight),
            ("mpc.weights.steering", mpc.weights.steering, weight),
            ("mpc.weights.accel", mpc.weights.accel, weight),
            ("mpc.weights.terminal", mpc.weights.terminal, weight),
            ("mpc.weights.slack", mpc.weights.slack, weight),
            ("mpc.weights.steering_rate", mpc.weights.steering_rate, [1e-6, 1e9]),
            ("mpc.weights.jerk", mpc.weights.jerk, [1e-6, 1e9]),
            ("mpc.weights.slack_squared", mpc.weights.slack_squared, [1e-6, 1e9]),
        ])?;
        let (reach, least) = (pure_pursuit.lookahead_max_m, pure_pursuit.lookahead_min_m);
        require("pure_pursuit.lookahead_max_m", reach, reach >= least, "at least lookahead_min_m")?;
        let fits = self.law != Law::Mpc || (1..=HORIZON_MAX).contains(&mpc.horizon);
        require("mpc.horizon", mpc.horizon, fits, "1 to 200")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_presets_are_in_range() {
        assert_eq!(Params::default().validate(), Ok(()));
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let check = |spoil: fn(&mut Params), want: &str| {
            let mut params = Params { law: Law::Mpc, ..Params::default() };
            spoil(&mut params);
            assert_eq!(params.validate().unwrap_err().to_string(), want);
        };
        check(|p| p.mpc.horizon = 0, "`mpc.horizon` is 0, expected 1 to 200");
        check(|p| p.mpc.dt_s = f64::NAN, "`mpc.dt_s` is NaN, expected 0.01 to 1");
        check(|p| p.pid.kp_spm = -1.0, "`pid.kp_spm` is -1, expected 0 to 1000");
        check(|p| p.stop.blind_after_s = 0.0, "`stop.blind_after_s` is 0, expected 0.001 to 60");
        check(
            |p| p.pure_pursuit.lookahead_max_m = 1.0,
            "`pure_pursuit.lookahead_max_m` is 1, expected at least lookahead_min_m",
        );
    }
}
