//! Common checks of several packages: poses, covariances, frames, physical limits.

use super::{Invalid, Why, invalid, within};

/// Maximum plausible speed, m/s.
pub(crate) const SPEED_MAX_MPS: f64 = 150.0;
/// Maximum plausible yaw rate, rad/s.
pub(crate) const TURN_MAX_RADPS: f64 = 100.0;
/// Maximum plausible acceleration, m/s²: about 50 g.
pub(crate) const ACCEL_MAX_MPS2: f64 = 500.0;
/// Maximum plausible road wheel angle, radians.
pub(crate) const TIRE_ANGLE_MAX_RAD: f64 = 1.6;
/// Maximum plausible steering wheel angle, degrees.
pub(crate) const WHEEL_ANGLE_MAX_DEG: f64 = 2000.0;
/// Maximum plausible wheel speed, rad/s.
pub(crate) const WHEEL_SPEED_MAX_RADPS: f64 = 1000.0;

/// Checks that variances are not negative; `row` is the side length of the matrix.
pub(crate) fn variances(field: &str, covariance: &[f64], row: usize) -> Result<(), Invalid> {
    for i in 0..row {
        within(&format!("{field}[{}]", i * (row + 1)), covariance[i * (row + 1)], 0.0, f64::MAX)?;
    }
    Ok(())
}

/// Checks a covariance that starts with -1 if the quantity is not measured.
pub(crate) fn variances_or_none(field: &str, covariance: &[f64; 9]) -> Result<(), Invalid> {
    if covariance[0] == -1.0 { Ok(()) } else { variances(field, covariance, 3) }
}

pub(crate) fn frame(field: &str, frame_id: &str) -> Result<(), Invalid> {
    if frame_id.is_empty() { invalid(field, Why::Name(String::new())) } else { Ok(()) }
}
