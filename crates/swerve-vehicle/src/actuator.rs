//! Actuators of steering, motor and brakes: dead time, lag, rate and torque limits.

use std::collections::VecDeque;

use swerve_geom::math;

use crate::VehicleParams;

/// Demands on the car.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Controls {
    /// Target angle of the front road wheels, radians; positive to the left.
    pub steering_rad: f64,
    /// Accelerator pedal, 0 to 1.
    pub throttle: f64,
    /// Brake pedal, 0 to 1.
    pub brake: f64,
}

impl Controls {
    /// The command clamped to the car's range; `None` if any of its numbers is not finite.
    pub fn within(self, params: &VehicleParams) -> Option<Self> {
        let finite = self.steering_rad.is_finite() && self.throttle.is_finite() && self.brake.is_finite();
        let max = params.limits.steering_max_rad;
        finite.then(|| Self {
            steering_rad: self.steering_rad.clamp(-max, max),
            throttle: self.throttle.clamp(0.0, 1.0),
            brake: self.brake.clamp(0.0, 1.0),
        })
    }
}

/// Commands in transit to the actuators: each takes effect in the first step that begins at least `dead_time` after its
/// own. Whole nanoseconds, so that rounding never shifts it by a step.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct DeadTime {
    delay_ns: i64,
    now_ns: i64,
    waiting: VecDeque<(i64, Controls)>,
    acting: Controls,
}

fn whole_ns(seconds: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "spans of a run fit; the cast saturates")]
    let ns = (seconds * 1e9).round() as i64;
    ns
}

impl DeadTime {
    pub(crate) fn new(dead_time_s: f64, acting: Controls) -> Self {
        Self { delay_ns: whole_ns(dead_time_s), now_ns: 0, waiting: VecDeque::new(), acting }
    }

    /// Takes the command given at the start of this step, if any, and returns the one in effect during the step.
    pub(crate) fn step(&mut self, given: Option<Controls>, dt_s: f64) -> Controls {
        if let Some(command) = given
            && self.waiting.back().map_or(&self.acting, |(_, last)| last) != &command
        {
            self.waiting.push_back((self.now_ns.saturating_add(self.delay_ns), command));
        }
        while let Some((_, command)) = self.waiting.pop_front_if(|(due_ns, _)| *due_ns <= self.now_ns) {
            self.acting = command;
        }
        self.now_ns += whole_ns(dt_s);
        self.acting
    }
}

/// State of the actuators.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) struct Actuators {
    /// Angle of the front road wheels, radians.
    pub(crate) steering_rad: f64,
    /// Total torque at the driven wheels, N m.
    pub(crate) drive_nm: f64,
    /// Total brake torque requested by the pedal, N m.
    pub(crate) brake_nm: f64,
}

/// Fraction of the way to its target that a first-order lag covers in `dt_s`: the exact solution for a constant target,
/// so that the curve is independent of the step length.
fn lag_share(lag_s: f64, dt_s: f64) -> f64 {
    if lag_s > 0.0 { 1.0 - math::exp(-dt_s / lag_s) } else { 1.0 }
}

impl Actuators {
    pub(crate) fn step(
        &mut self,
        params: &VehicleParams,
        controls: Controls,
        wheel_speed_radps: f64,
        dt_s: f64,
    ) {
        let steer_most = params.limits.steering_rate_max_radps * dt_s;
        let wanted_rad =
            controls.steering_rad * params.steering.share_at(wheel_speed_radps * params.wheel.radius_m);
        let steer = (wanted_rad - self.steering_rad) * lag_share(params.steering.lag_s, dt_s);
        self.steering_rad += steer.clamp(-steer_most, steer_most);
        // A pressed brake overrides the accelerator, as in drive-by-wire cars.
        let throttle = if controls.brake > 0.0 { 0.0 } else { controls.throttle };
        let available = params.drive_torque_max_nm(wheel_speed_radps);
        let lag = lag_share(params.drivetrain.lag_s, dt_s);
        self.drive_nm += (throttle * available - self.drive_nm) * lag;
        let brake_goal = controls.brake * params.brakes.torque_max_nm;
        self.brake_nm = if params.brakes.build_up_s > 0.0 {
            let most = params.brakes.torque_max_nm * dt_s / params.brakes.build_up_s;
            self.brake_nm + (brake_goal - self.brake_nm).clamp(-most, most)
        } else {
            brake_goal
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steer(steering_rad: f64) -> Controls {
        Controls { steering_rad, ..Controls::default() }
    }

    #[test]
    fn dead_time_delays_every_command_by_the_same_whole_steps() {
        let mut line = DeadTime::new(0.015, steer(0.0));
        let given = [0.1, 0.2, 0.2, 0.3, 0.4, 0.4, 0.4, 0.4];
        let acted: Vec<f64> =
            given.iter().map(|&angle| line.step(Some(steer(angle)), 0.005).steering_rad).collect();
        assert_eq!(acted, [0.0, 0.0, 0.0, 0.1, 0.2, 0.2, 0.3, 0.4]);
    }

    #[test]
    fn a_dead_time_between_two_steps_ends_with_the_next_step() {
        let mut line = DeadTime::new(0.012, steer(0.0));
        let acted: Vec<f64> = (0..5).map(|_| line.step(Some(steer(0.1)), 0.005).steering_rad).collect();
        assert_eq!(acted, [0.0, 0.0, 0.0, 0.1, 0.1]);
    }

    #[test]
    fn missing_command_leaves_the_last_one_in_effect() {
        let mut line = DeadTime::new(0.0, steer(0.0));
        assert_eq!(line.step(Some(steer(0.1)), 0.005), steer(0.1));
        assert_eq!(line.step(None, 0.005), steer(0.1));
    }

    #[test]
    fn steering_follows_its_lag_and_never_beats_its_rate() {
        let params = VehicleParams::default();
        let mut actuators = Actuators::default();
        let mut last = 0.0;
        for _ in 0..200 {
            actuators.step(&params, steer(0.5), 0.0, 0.005);
            assert!(actuators.steering_rad - last <= 0.7 * 0.005 + 1e-12);
            last = actuators.steering_rad;
        }
        assert!((last - 0.5).abs() < 1e-3, "{last}");
        // Small steps follow the first-order lag alone: 63 % after its time constant.
        let mut actuators = Actuators::default();
        for _ in 0..10 {
            actuators.step(&params, steer(0.01), 0.0, 0.005);
        }
        assert!((actuators.steering_rad / 0.01 - 0.632).abs() < 1e-3);
    }

    #[test]
    fn brake_builds_up_in_its_time_and_overrides_the_accelerator() {
        let params = VehicleParams::default();
        let mut actuators = Actuators::default();
        let both = Controls { steering_rad: 0.0, throttle: 1.0, brake: 1.0 };
        for _ in 0..15 {
            actuators.step(&params, both, 0.0, 0.005);
        }
        assert!((actuators.brake_nm / params.brakes.torque_max_nm - 0.5).abs() < 1e-9);
        for _ in 0..15 {
            actuators.step(&params, both, 0.0, 0.005);
        }
        assert!((actuators.brake_nm - params.brakes.torque_max_nm).abs() < 1e-6);
        assert_eq!(actuators.drive_nm, 0.0);
    }

    #[test]
    fn non_finite_commands_are_refused_and_others_clamped() {
        let params = VehicleParams::default();
        assert_eq!(steer(f64::NAN).within(&params), None);
        assert_eq!(Controls { throttle: f64::INFINITY, ..steer(0.0) }.within(&params), None);
        let clamped = Controls { steering_rad: -9.0, throttle: 2.0, brake: -1.0 }.within(&params);
        assert_eq!(clamped, Some(Controls { steering_rad: -0.61, throttle: 1.0, brake: 0.0 }));
    }
}
