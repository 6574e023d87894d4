//! Conversion of a target acceleration to pedals.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Positions of the two pedals.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
pub struct Pedals {
    /// Accelerator, 0 to 1.
    pub throttle: f64,
    /// Brake, 0 to 1.
    pub brake: f64,
}

/// Conversion of accelerations to pedals: the inverse of a drivetrain.
///
/// Implemented by any function of (acceleration along the heading in m/s², speed in m/s).
pub trait AccelToPedals: Send {
    /// Pedals that give `accel_mps2` at `speed_mps`, within the vehicle's capability.
    fn pedals(&self, accel_mps2: f64, speed_mps: f64) -> Pedals;
}

impl<F: Fn(f64, f64) -> Pedals + Send> AccelToPedals for F {
    fn pedals(&self, accel_mps2: f64, speed_mps: f64) -> Pedals {
        self(accel_mps2, speed_mps)
    }
}

/// Pedals proportional to the acceleration, at any speed.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LinearPedals {
    /// Acceleration at full throttle, m/s².
    pub accel_max_mps2: f64,
    /// Deceleration at full brake, m/s² (positive).
    pub brake_max_mps2: f64,
}

impl AccelToPedals for LinearPedals {
    fn pedals(&self, accel_mps2: f64, _speed_mps: f64) -> Pedals {
        Pedals {
            throttle: (accel_mps2 / self.accel_max_mps2).clamp(0.0, 1.0),
            brake: (-accel_mps2 / self.brake_max_mps2).clamp(0.0, 1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pedals_are_used_one_at_a_time_within_their_travel() {
        let linear = LinearPedals { accel_max_mps2: 3.0, brake_max_mps2: 8.0 };
        assert_eq!(linear.pedals(1.5, 10.0), Pedals { throttle: 0.5, brake: 0.0 });
        assert_eq!(linear.pedals(-2.0, 10.0), Pedals { throttle: 0.0, brake: 0.25 });
        assert_eq!(linear.pedals(-99.0, 10.0), Pedals { throttle: 0.0, brake: 1.0 });
    }
}
