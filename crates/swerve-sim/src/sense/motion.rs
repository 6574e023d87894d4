//! Pose of the ego with optional noise and bias, and the error draws of motion sensors.
//!
//! A **bias** is drawn once per (seed, sensor) and constant for the run; **noise** is drawn per (seed, sensor, stamp).
//! Both are normal with the given standard deviations; zero gives the truth.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Ranges, Rng, Time};
use swerve_geom::Pose2;
use swerve_msg::EgoState;
use swerve_msg::truth::WorldState;

/// Errors of a pose source; all zero by default: perfect localization.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct PoseParams {
    /// Noise of x and of y, standard deviation, metres.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub position_noise_m: f64,
    /// Bias of x and of y, standard deviation, metres.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub position_bias_m: f64,
    /// Noise of the heading, standard deviation, radians.
    #[schemars(range(min = 0.0, max = PI))]
    pub heading_noise_rad: f64,
    /// Bias of the heading, standard deviation, radians.
    #[schemars(range(min = 0.0, max = PI))]
    pub heading_bias_rad: f64,
    /// Noise of the speed, standard deviation, m/s.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub speed_noise_mps: f64,
}

/// Random draws of one sensor at one stamp.
pub(super) struct Errors {
    bias: Rng,
    noise: Rng,
}

impl Errors {
    pub(super) fn new(seed: u64, sensor: &str, stamp: Time) -> Self {
        Self {
            bias: Rng::keyed(seed, "sensor bias", &[key(sensor)]),
            noise: Rng::keyed(seed, "sensor noise", &[key(sensor), stamp.ns()]),
        }
    }

    /// Error of the next axis: one draw of bias, one of noise.
    pub(super) fn next(&mut self, bias: f64, noise: f64) -> f64 {
        bias * self.bias.normal() + noise * self.noise.normal()
    }
}

/// Key component for a sensor's name.
pub(super) fn key(sensor: &str) -> i64 {
    Rng::keyed(0, sensor, &[]).bits().cast_signed()
}

/// Pose and motion of the ego as reported by localization with these errors.
pub fn pose(world: &WorldState, sensor: &str, params: &PoseParams, seed: u64) -> EgoState {
    let truth = world.ego.state;
    let mut errors = Errors::new(seed, sensor, world.stamp);
    let x = errors.next(params.position_bias_m, params.position_noise_m);
    let y = errors.next(params.position_bias_m, params.position_noise_m);
    let heading = errors.next(params.heading_bias_rad, params.heading_noise_rad);
    let speed = errors.next(0.0, params.speed_noise_mps);
    EgoState {
        stamp: world.stamp,
        pose: Pose2::new(truth.pose.x_m + x, truth.pose.y_m + y, truth.pose.heading_rad + heading),
        speed_mps: truth.speed_mps + speed,
        ..truth
    }
}
