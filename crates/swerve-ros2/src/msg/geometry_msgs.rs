//! `geometry_msgs`.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::Matrix;
use super::std_msgs::Header;
use crate::check::parts::{ACCEL_MAX_MPS2, SPEED_MAX_MPS, TURN_MAX_RADPS, frame, variances};
use crate::check::{Check, Invalid, Why, invalid, within};

/// Maximum deviation of a quaternion's norm from one.
const QUATERNION_TOLERANCE: f64 = 0.01;

/// A position, metres.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Point {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// A position in single precision, metres.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Point32 {
    pub x: f32,
    pub y: f32,
    pub z: f32,
}

/// A vector.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Vector3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// A rotation: `x, y, z` are the vector part.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Quaternion {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub w: f64,
}

impl Default for Quaternion {
    /// The identity.
    fn default() -> Self {
        Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
    }
}

/// Position and orientation.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Pose {
    pub position: Point,
    pub orientation: Quaternion,
}

/// A pose with its stamp and frame.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PoseStamped {
    pub header: Header,
    pub pose: Pose,
}

/// A pose with the covariance of x, y, z and the rotations about them, 6 x 6, row by row.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PoseWithCovariance {
    pub pose: Pose,
    pub covariance: Matrix<36>,
}

/// A pose with its covariance, stamp and frame.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PoseWithCovarianceStamped {
    pub header: Header,
    pub pose: PoseWithCovariance,
}

/// Velocity, m/s, and angular velocity, rad/s.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Twist {
    pub linear: Vector3,
    pub angular: Vector3,
}

/// A twist with its stamp and frame.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TwistStamped {
    pub header: Header,
    pub twist: Twist,
}

/// A twist with its covariance, 6 x 6, row by row.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TwistWithCovariance {
    pub twist: Twist,
    pub covariance: Matrix<36>,
}

/// A twist with its covariance, stamp and frame.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TwistWithCovarianceStamped {
    pub header: Header,
    pub twist: TwistWithCovariance,
}

/// Acceleration, m/s², and angular acceleration, rad/s².
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Accel {
    pub linear: Vector3,
    pub angular: Vector3,
}

/// An acceleration with its covariance, 6 x 6, row by row.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct AccelWithCovariance {
    pub accel: Accel,
    pub covariance: Matrix<36>,
}

/// An acceleration with its covariance, stamp and frame.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct AccelWithCovarianceStamped {
    pub header: Header,
    pub accel: AccelWithCovariance,
}

/// Transform of coordinates from the child frame to the header's frame.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Transform {
    pub translation: Vector3,
    pub rotation: Quaternion,
}

/// One edge of the transform tree.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TransformStamped {
    pub header: Header,
    pub child_frame_id: String,
    pub transform: Transform,
}

/// A polygon: corners in order.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Polygon {
    pub points: Vec<Point32>,
}

impl Check for PoseStamped {
    fn check(&self) -> Result<(), Invalid> {
        frame("header.frame_id", &self.header.frame_id)?;
        pose("pose", &self.pose)
    }
}

impl Check for PoseWithCovarianceStamped {
    fn check(&self) -> Result<(), Invalid> {
        frame("header.frame_id", &self.header.frame_id)?;
        pose("pose.pose", &self.pose.pose)?;
        variances("pose.covariance", &self.pose.covariance.0, 6)
    }
}

impl Check for TwistStamped {
    fn check(&self) -> Result<(), Invalid> {
        twist("twist", &self.twist)
    }
}

impl Check for TwistWithCovarianceStamped {
    fn check(&self) -> Result<(), Invalid> {
        twist("twist.twist", &self.twist.twist)?;
        variances("twist.covariance", &self.twist.covariance.0, 6)
    }
}

impl Check for AccelWithCovarianceStamped {
    fn check(&self) -> Result<(), Invalid> {
        let a = &self.accel.accel.linear;
        for (axis, v) in [("x", a.x), ("y", a.y), ("z", a.z)] {
            within(&format!("accel.accel.linear.{axis}"), v, -ACCEL_MAX_MPS2, ACCEL_MAX_MPS2)?;
        }
        variances("accel.covariance", &self.accel.covariance.0, 6)
    }
}

impl Check for TransformStamped {
    fn check(&self) -> Result<(), Invalid> {
        frame("header.frame_id", &self.header.frame_id)?;
        frame("child_frame_id", &self.child_frame_id)?;
        transform("transform", &self.transform)
    }
}

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

pub(crate) fn transform(field: &str, transform: &Transform) -> Result<(), Invalid> {
    quaternion(&format!("{field}.rotation"), &transform.rotation)
}
