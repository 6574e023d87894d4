//! Common checks of several packages: poses, covariances, frames, physical limits.

use super::{Invalid, Why, invalid, within};
use crate::msg::geometry_msgs::{Pose, Quaternion, Transform, Twist};

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
/// Maximum deviation of a quaternion's norm from one.
const QUATERNION_TOLERANCE: f64 = 0.01;
/// Maximum plausible wheel speed, rad/s.
pub(crate) const WHEEL_SPEED_MAX_RADPS: f64 = 1000.0;

pub(crate) fn quaternion(field: &str, q: &Quaternion) -> Result<(), Invalid> {
    let length = (q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w).sqrt();
    if (length - 1.0).abs() <= QUATERNION_TOLERANCE {
        return Ok(());
    }
    invalid(field, Why::Quaternion(length))
}

pub(crate) fn pose(field: &str, pose: &Pose) -> Result<(), Invalid> {
    quaternion(&format!("{field}.orientation"), &pose.orientation)
}

pub(crate) fn twist(field: &str, twist: &Twist) -> Result<(), Invalid> {
    for (axis, v) in [("x", twist.linear.x), ("y", twist.linear.y), ("z", twist.linear.z)] {
        within(&format!("{field}.linear.{axis}"), v, -SPEED_MAX_MPS, SPEED_MAX_MPS)?;
    }
    for (axis, v) in [("x", twist.angular.x), ("y", twist.angular.y), ("z", twist.angular.z)] {
        within(&format!("{field}.angular.{axis}"), v, -TURN_MAX_RADPS, TURN_MAX_RADPS)?;
    }
    Ok(())
}

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

pub(crate) fn transform(field: &str, transform: &Transform) -> Result<(), Invalid> {
    quaternion(&format!("{field}.rotation"), &transform.rotation)
}

pub(crate) fn frame(field: &str, frame_id: &str) -> Result<(), Invalid> {
    if frame_id.is_empty() { invalid(field, Why::Name(String::new())) } else { Ok(()) }
}
