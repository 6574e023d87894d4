//! Steering actuator: from the requested angle to that of the wheels.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;

/// Steering actuator; the angle and rate limits are in [`Limits`](crate::Limits).
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct SteeringParams {
    /// Time constant of the first-order lag before the rate limit, seconds; 0 disables the lag.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub lag_s: f64,
    /// Speeds in m/s (0 to 200), increasing, each with the fraction (0 to 1) of the requested angle by which the wheels
    /// turn; interpolated linearly. A real car has 1 at all speeds.
    pub curve: [[f64; 2]; 4],
}

impl SteeringParams {
    /// Fraction of the requested angle by which the wheels turn, 0 to 1.
    pub fn share_at(&self, speed_mps: f64) -> f64 {
        let [mut from, rest @ ..] = self.curve;
        for to in rest {
            if speed_mps <= to[0] {
                let u = (speed_mps - from[0]) / (to[0] - from[0]);
                return from[1] + (to[1] - from[1]) * u.max(0.0);
            }
            from = to;
        }
        from[1]
    }

    pub(crate) fn curve_is_sound(&self) -> bool {
        let shares =
            self.curve.iter().all(|[v, share]| (0.0..=200.0).contains(v) && (0.0..=1.0).contains(share));
        shares && self.curve.windows(2).all(|pair| pair[0][0] < pair[1][0])
    }
}

impl Default for SteeringParams {
    /// \[E\]: bandwidth near 3 Hz, usual for drive-by-wire steering.
    fn default() -> Self {
        Self { lag_s: 0.05, curve: [[0.0, 1.0], [10.0, 1.0], [20.0, 1.0], [30.0, 1.0]] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steering_curve_reduces_the_angle_with_speed() {
        let steering =
            SteeringParams { curve: [[0.0, 1.0], [5.0, 0.9], [15.0, 0.8], [30.0, 0.7]], lag_s: 0.0 };
        for (speed_mps, share) in [(-1.0, 1.0), (0.0, 1.0), (2.5, 0.95), (15.0, 0.8), (99.0, 0.7)] {
            assert!((steering.share_at(speed_mps) - share).abs() < 1e-12, "{speed_mps}");
        }
        assert_eq!(SteeringParams::default().share_at(17.3), 1.0);
    }
}
