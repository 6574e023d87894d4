//! Speed law of the path trackers: feed-forward of the planned acceleration, with proportional and integral feedback.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Ranges, Time};

use crate::{AccelToPedals, Pedals};

/// Gains and limits of [`SpeedLaw`].
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Proportional gain: acceleration per m/s of speed error, 1/s. Higher values follow more closely but jerk more.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub kp_ps: f64,
    /// Integral gain: acceleration per metre of accumulated speed error, 1/s². Compensates drag and slope.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub ki_ps2: f64,
    /// Bound of the integral part, m/s².
    #[schemars(range(min = 0.0, max = 100.0))]
    pub integral_max_mps2: f64,
    /// Deceleration commanded to hold the car at rest, m/s².
    #[schemars(range(min = 0.0, max = 100.0))]
    pub hold_mps2: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self { kp_ps: 2.0, ki_ps2: 0.4, integral_max_mps2: 1.5, hold_mps2: 3.0 }
    }
}

/// Target speed and acceleration.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Target {
    /// Target speed, m/s.
    pub speed_mps: f64,
    /// Target acceleration, m/s².
    pub accel_mps2: f64,
}

/// Feed-forward plus PI on speed, in acceleration.
#[derive(Clone, PartialEq, Debug)]
pub struct SpeedLaw {
    params: Params,
    integral_mps2: f64,
    /// Acceleration of the previous call, m/s².
    last_mps2: f64,
}

/// Time in which the holding brake builds up, seconds: applied at once it would jolt a rolling car.
const HOLD_GROWS_S: f64 = 0.5;

impl SpeedLaw {
    /// Creates a speed law without past errors.
    pub fn new(params: Params) -> Self {
        Self { params, integral_mps2: 0.0, last_mps2: 0.0 }
    }

    /// Acceleration to command, m/s², `dt_s` seconds after the previous call.
    pub fn accel(&mut self, target: Target, speed_mps: f64, dt_s: f64) -> f64 {
        self.accel_within(f64::INFINITY, target, speed_mps, dt_s)
    }

    /// As [`accel`](Self::accel), but at most `most_mps2`; an error that this leaves is not integrated.
    pub(crate) fn accel_within(&mut self, most_mps2: f64, target: Target, speed_mps: f64, dt_s: f64) -> f64 {
        let integral_mps2 = self.integral_mps2;
        let wanted_mps2 = self.wanted(target, speed_mps, dt_s);
        if wanted_mps2 > most_mps2 {
            self.integral_mps2 = self.integral_mps2.min(integral_mps2);
        }
        self.last_mps2 = wanted_mps2.min(most_mps2);
        self.last_mps2
    }

    fn wanted(&mut self, target: Target, speed_mps: f64, dt_s: f64) -> f64 {
        let Params { kp_ps, ki_ps2, integral_max_mps2, hold_mps2 } = self.params;
        if target.speed_mps < 0.05 && target.accel_mps2 <= 0.0 && speed_mps.abs() < 0.3 {
            self.integral_mps2 = 0.0;
            return (self.last_mps2.min(0.0) - hold_mps2 * dt_s / HOLD_GROWS_S).max(-hold_mps2);
        }
        let error = target.speed_mps - speed_mps;
        // Large errors are transients: integrating them would only cause overshoot.
        if error.abs() < 1.0 {
            let raised = self.integral_mps2 + ki_ps2 * error * dt_s;
            self.integral_mps2 = raised.clamp(-integral_max_mps2, integral_max_mps2);
        }
        target.accel_mps2 + kp_ps * error + self.integral_mps2
    }

    /// As [`accel`](Self::accel), converted to pedals.
    pub fn step(&mut self, target: Target, speed_mps: f64, dt_s: f64, drive: &dyn AccelToPedals) -> Pedals {
        let accel = self.accel(target, speed_mps, dt_s);
        drive.pedals(accel, speed_mps)
    }
}

/// A stop: start time, initial speed and deceleration.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Stop {
    pub(crate) since: Time,
    pub(crate) from_mps: f64,
    pub(crate) decel_mps2: f64,
}

impl Stop {
    /// Target speed and acceleration.
    pub(crate) fn target(&self, instant: Time) -> Target {
        let left_mps = (self.from_mps - self.decel_mps2 * (instant - self.since).as_secs()).max(0.0);
        Target { speed_mps: left_mps, accel_mps2: if left_mps > 0.0 { -self.decel_mps2 } else { 0.0 } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LinearPedals;

    const DRIVE: LinearPedals = LinearPedals { accel_max_mps2: 3.0, brake_max_mps2: 8.0 };

    /// Speeds of a point mass with an unknown drag of 0.3 m/s² over 20 s at 100 Hz.
    fn drive(target: impl Fn(f64) -> Target, from_mps: f64) -> Vec<f64> {
        let mut law = SpeedLaw::new(Params::default());
        let mut speed = from_mps;
        (0..2000)
            .map(|k| {
                let pedals = law.step(target(k as f64 * 0.01), speed, 0.01, &DRIVE);
                let accel = 3.0 * pedals.throttle - 8.0 * pedals.brake - 0.3;
                speed = (speed + accel * 0.01).max(0.0);
                speed
            })
            .collect()
    }

    #[test]
    fn a_step_settles_without_error_and_overshoots_little() {
        let speeds = drive(|_| Target { speed_mps: 15.0, accel_mps2: 0.0 }, 10.0);
        assert!((speeds[1999] - 15.0).abs() < 0.02, "{}", speeds[1999]);
        let peak = speeds.iter().fold(0.0f64, |a, &b| a.max(b));
        assert!(peak < 15.15, "{peak}");
    }

    #[test]
    fn the_planned_acceleration_keeps_a_ramp_close() {
        let ramp = |t: f64| Target {
            speed_mps: 10.0 + 1.5 * t.min(4.0),
            accel_mps2: if t < 4.0 { 1.5 } else { 0.0 },
        };
        let speeds = drive(ramp, 10.0);
        let worst = (0..400).map(|k| (speeds[k] - ramp(k as f64 * 0.01).speed_mps).abs()).fold(0.0, f64::max);
        assert!(worst < 0.2, "{worst}");
    }

    #[test]
    fn speed_law_comes_to_rest_and_stays_there() {
        let speeds = drive(
            |t| Target { speed_mps: (5.0 - 2.0 * t).max(0.0), accel_mps2: if t < 2.5 { -2.0 } else { 0.0 } },
            5.0,
        );
        assert_eq!(speeds[1999], 0.0);
        let mut law = SpeedLaw::new(Params::default());
        // The holding brake builds up from zero to 3 m/s², of 8, within half a second.
        let brakes: Vec<f64> =
            (0..60).map(|_| law.step(Target::default(), 0.0, 0.01, &DRIVE).brake).collect();
        assert!(brakes[0] < 0.01 && brakes[24] < 0.2 && (brakes[59] - 3.0 / 8.0).abs() < 1e-9, "{brakes:?}");
    }
}
