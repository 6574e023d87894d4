//! The speed controller of Pylot.
//!
//! Pylot (`pylot/control/pid.py`, after CARLA's agents) runs a PID on the speed error in **km/h**: proportional
//! gain 1.0 per km/h, integral 0.05 per km/h and second over the last ten samples only, differential 0, and
//! clips the sum to one pedal or the other. Here the error is in m/s and the gains are the same physical ones:
//! 1 m/s is 3.6 km/h, so 3.6 per m/s, 0.18 per metre and 0. An error of 0.28 m/s is thus a full pedal.
//!
//! Carried over: gains, ten-sample buffer, clipping, the full brake that holds the car (below 1 m/s with target 0, or
//! rolling back faster than 0.3 m/s). Not carried over: the unit mix (the original documents m/s and computes km/h),
//! the wall clock as time step, and the warning without an output for negative speeds (they count as 0, as in the
//! original).

use std::collections::VecDeque;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;

use crate::Pedals;

/// km/h in one m/s.
const KMPH_PER_MPS: f64 = 3.6;

/// Gains and limits of [`Pid`].
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Pedal per m/s of speed error. Pylot: 1.0 per km/h.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub kp_spm: f64,
    /// Pedal per metre: per m/s of error, held for one second. Pylot: 0.05 per km/h and second.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub ki_pm: f64,
    /// Pedal per m/s² of change of the error. Pylot: 0.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub kd_s2pm: f64,
    /// Number of errors kept for the integral, i.e. its time window in steps. Pylot: 10.
    pub samples: usize,
    /// Largest throttle, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub throttle_max: f64,
    /// Largest brake, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub brake_max: f64,
}

impl Default for Params {
    /// Pylot's values.
    fn default() -> Self {
        Self {
            kp_spm: 1.0 * KMPH_PER_MPS,
            ki_pm: 0.05 * KMPH_PER_MPS,
            kd_s2pm: 0.0,
            samples: 10,
            throttle_max: 1.0,
            brake_max: 1.0,
        }
    }
}

/// PID controller of the speed with a short integration window.
#[derive(Clone, PartialEq, Debug)]
pub struct Pid {
    params: Params,
    errors_mps: VecDeque<f64>,
}

impl Pid {
    /// Creates a controller without past errors.
    pub fn new(params: Params) -> Self {
        Self { params, errors_mps: VecDeque::with_capacity(params.samples + 1) }
    }

    /// Clears the past errors.
    pub fn reset(&mut self) {
        self.errors_mps.clear();
    }

    /// Pedals that take `speed_mps` to `target_mps`, `dt_s` seconds after the previous call.
    pub fn step(&mut self, target_mps: f64, speed_mps: f64, dt_s: f64) -> Pedals {
        let rolls_back = speed_mps < -0.3;
        let stands = speed_mps < 1.0 && target_mps == 0.0;
        let effort = self.effort(target_mps - speed_mps.max(0.0), dt_s);
        if stands || rolls_back {
            return Pedals { throttle: 0.0, brake: 1.0 };
        }
        Pedals {
            throttle: effort.clamp(0.0, self.params.throttle_max),
            brake: (-effort).clamp(0.0, self.params.brake_max),
        }
    }

    /// Weighted sum of error, its integral over the buffer and its slope, in `[-1, 1]`.
    fn effort(&mut self, error_mps: f64, dt_s: f64) -> f64 {
        let Params { kp_spm, ki_pm, kd_s2pm, samples, .. } = self.params;
        let before = self.errors_mps.back().copied();
        self.errors_mps.push_back(error_mps);
        if self.errors_mps.len() > samples.max(1) {
            self.errors_mps.pop_front();
        }
        // The first call has no time step.
        let (integral_m, slope_mps2) = match before {
            Some(before) if dt_s > 0.0 => {
                (self.errors_mps.iter().sum::<f64>() * dt_s, (error_mps - before) / dt_s)
            }
            _ => (0.0, 0.0),
        };
        (kp_spm * error_mps + ki_pm * integral_m + kd_s2pm * slope_mps2).clamp(-1.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pid() -> Pid {
        Pid::new(Params::default())
    }

    #[test]
    fn gains_match_those_of_pylot_in_its_unit() {
        // 0.2 m/s = 0.72 km/h: first 0.72, then with the integral of two samples over 0.1 s.
        let mut pid = pid();
        assert!((pid.step(10.2, 10.0, 0.1).throttle - 0.72).abs() < 1e-12);
        let want = 1.0 * 0.72 + 0.05 * (0.72 + 0.72) * 0.1;
        assert!((pid.step(10.2, 10.0, 0.1).throttle - want).abs() < 1e-12);
    }

    #[test]
    fn the_integral_reaches_ten_samples_back() {
        let mut pid = pid();
        for _ in 0..50 {
            pid.step(10.1, 10.0, 0.1);
        }
        let want = 0.36 + 0.05 * 10.0 * 0.36 * 0.1;
        assert!((pid.step(10.1, 10.0, 0.1).throttle - want).abs() < 1e-12);
    }

    #[test]
    fn an_error_above_one_kmph_is_a_full_pedal() {
        assert_eq!(pid().step(20.0, 10.0, 0.01), Pedals { throttle: 1.0, brake: 0.0 });
        assert_eq!(pid().step(10.0, 10.3, 0.01), Pedals { throttle: 0.0, brake: 1.0 });
    }

    #[test]
    fn pid_holds_the_car_at_rest_and_when_rolling_back() {
        let full = Pedals { throttle: 0.0, brake: 1.0 };
        assert_eq!(pid().step(0.0, 0.9, 0.01), full);
        assert_eq!(pid().step(5.0, -0.31, 0.01), full);
        assert_eq!(pid().step(5.0, -0.29, 0.01), Pedals { throttle: 1.0, brake: 0.0 });
    }

    #[test]
    fn a_step_from_10_to_15_settles_on_a_point_mass() {
        let (mut pid, mut speed, mut peak) = (pid(), 10.0, 0.0f64);
        for _ in 0..1000 {
            let pedals = pid.step(15.0, speed, 0.01);
            speed += (3.0 * pedals.throttle - 8.0 * pedals.brake - 0.1) * 0.01;
            peak = peak.max(speed);
        }
        assert!((speed - 15.0).abs() < 0.02, "{speed}");
        assert!(peak < 15.02, "{peak}");
    }
}
