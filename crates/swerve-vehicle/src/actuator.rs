//! From a command to what steering, motor and brakes really do: dead time, lag, rate and torque limits.

use std::collections::VecDeque;

use swerve_geom::math;

use crate::VehicleParams;

/// What is asked of the car.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Controls {
    /// Wanted angle of the front road wheels, radians; positive to the left.
    pub steering_rad: f64,
    /// Accelerator pedal, 0 to 1.
    pub throttle: f64,
    /// Brake pedal, 0 to 1.
    pub brake: f64,
}

impl Controls {
    /// The command within the car's range, or nothing when any of its numbers is not finite.
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

/// Commands on their way to the actuators: each takes effect in the first step that begins `dead_time`
/// after its own, to the tick. Whole nanoseconds, so that no rounding moves it by a step.
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

    /// Takes the command given at the start of this step, if there is one, and returns the one that acts
    /// during the step.
    pub(crate) fn step(&mut self, given: Option<Controls>, dt_s: f64) -> Controls {
        if let Some(command) = given
            && self.waiting.back().map_or(&self.acting, |(_, last)| last) != &command
        {
            self.waiting.push_back((self.now_ns + self.delay_ns, command));
        }
        while let Some((_, command)) = self.waiting.pop_front_if(|(due_ns, _)| *due_ns <= self.now_ns) {
            self.acting = command;
        }
        self.now_ns += whole_ns(dt_s);
        self.acting
    }
}

/// Where the actuators are.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) struct Actuators {
    /// Angle of the front road wheels, radians.
    pub(crate) steering_rad: f64,
    /// Torque at the driven wheels together, N m.
    pub(crate) drive_nm: f64,
    /// Torque that the pedal asks of all brakes together, N m.
    pub(crate) brake_nm: f64,
}

/// Share of the way to its goal that a first-order lag covers in `dt_s`: the exact solution for a goal
/// that holds over the step, hence the same curve at any step length.
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
        let steer = (controls.steering_rad - self.steering_rad) * lag_share(params.steering.lag_s, dt_s);
        self.steering_rad += steer.clamp(-steer_most, steer_most);
        // A pressed brake wins over the accelerator, as drive-by-wire cars have it.
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
