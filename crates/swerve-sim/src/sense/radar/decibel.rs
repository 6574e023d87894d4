//! Decibels.

use swerve_geom::math;

/// Converts a ratio to decibels.
pub(super) fn decibels(ratio: f64) -> f64 {
    10.0 * core::f64::consts::LOG10_E * math::ln(ratio)
}

/// Converts [`decibels`] to a ratio.
pub(super) fn ratio(decibels: f64) -> f64 {
    math::exp(decibels / (10.0 * core::f64::consts::LOG10_E))
}
