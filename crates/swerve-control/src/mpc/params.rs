//! Parameters of the controller, and weights of its cost.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;

use super::model;

/// Parameters of the controller.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Number of steps of the horizon.
    pub horizon: usize,
    /// Duration of a step, seconds.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub dt_s: f64,
    /// Weights of the cost.
    #[ranges(nested)]
    pub weights: Weights,
    /// Largest jerk, m/s³.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub jerk_max_mps3: f64,
    /// Upper bound on the speed, m/s.
    #[schemars(range(min = 0.0, max = 200.0))]
    pub speed_max_mps: f64,
    /// Half width of the corridor around the path, metres, limited by the drivable ground.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub corridor_m: f64,
    /// Distance that the corridor keeps between the car's side and the edge of the drivable ground, metres.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub edge_m: f64,
    /// Time offset between the measured state and the command taken from the solution, seconds: the delay of actuators
    /// and tyres, which the model lacks.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub lead_s: f64,
    /// Largest age of an earlier solution that replaces a failed one, seconds.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub shift_max_s: f64,
    /// Deceleration without a solution to shift, m/s² (positive).
    #[schemars(range(min = 0.0, max = 20.0))]
    pub fallback_brake_mps2: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            horizon: 20,
            dt_s: 0.1,
            weights: Weights::default(),
            jerk_max_mps3: 30.0,
            speed_max_mps: 40.0,
            corridor_m: 1.2,
            edge_m: 0.2,
            lead_s: 0.25,
            shift_max_s: 0.5,
            fallback_brake_mps2: 5.0,
        }
    }
}

/// Weights of the cost, per square of the unit named, each multiplied by 1/2.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Weights {
    /// Weight of the longitudinal error along the path, metres.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub along: f64,
    /// Weight of the lateral error from the path, metres.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub across: f64,
    /// Weight of the heading error, radians.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub heading: f64,
    /// Weight of the speed error, m/s.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub speed: f64,
    /// Weight of the steering deviation from the path's curvature, radians.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub steering: f64,
    /// Weight of the acceleration error, m/s².
    #[schemars(range(min = 0.0, max = 1e9))]
    pub accel: f64,
    /// Weight of the steering rate, rad/s.
    #[schemars(range(min = 1e-6, max = 1e9))]
    pub steering_rate: f64,
    /// Weight of the jerk, m/s³.
    #[schemars(range(min = 1e-6, max = 1e9))]
    pub jerk: f64,
    /// Factor on the costs of the last state.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub terminal: f64,
    /// Linear cost of leaving the corridor, per metre.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub slack: f64,
    /// Quadratic cost of leaving the corridor, metres.
    #[schemars(range(min = 1e-6, max = 1e9))]
    pub slack_squared: f64,
}

impl Default for Weights {
    fn default() -> Self {
        Self {
            along: 1.0,
            across: 4.0,
            heading: 20.0,
            speed: 1.0,
            steering: 1.0,
            accel: 0.05,
            steering_rate: 5.0,
            jerk: 0.001,
            terminal: 2.0,
            slack: 50.0,
            slack_squared: 50.0,
        }
    }
}

impl Weights {
    /// Pylot's weights: Q = diag(1, 1, 0.01, 0.01) on x, y, speed and heading, R = diag(0.01, 0.1) on acceleration and
    /// steering, Rd = diag(0.01, 1) on their change per step of 0.1 s. Pylot's R weights the steering itself; here it
    /// weights the deviation from the path's curvature.
    pub fn pylot() -> Self {
        Self {
            along: 1.0,
            across: 1.0,
            heading: 0.01,
            speed: 0.01,
            steering: 0.1,
            accel: 0.01,
            steering_rate: 1.0 * 0.1 * 0.1,
            jerk: 0.01 * 0.1 * 0.1,
            terminal: 1.0,
            ..Self::default()
        }
    }

    pub(super) fn states(&self) -> [f64; model::N_STATES] {
        [self.along, self.across, self.heading, self.speed, self.steering, self.accel]
    }
}
