//! Conversion between ROS messages and `swerve-msg`: units, frames, axes, stamps, covariances.
//!
//! ROS (REP 103, 105) uses SI, radians, x forward, y left, z up, the map's x to the east; `base_link` is the centre
//! of the rear axle, as in Autoware; optical frames have x right, y down, z forward. Swerve uses the same
//! conventions, except for
//!
//! - stamps: Swerve's count from the start of the run, those of ROS from the epoch of its clock ([`Epoch`]);
//! - pixels: the centre of the first is (0, 0) in ROS and (0.5, 0.5) here;
//! - intensities: 0 to 255 in ROS, 0 to 1 here;
//! - steering: the steering wheel in degrees for drive-by-wire vehicles, the road wheels in radians here.

mod actuation;
mod cloud;
mod image;
mod objects;
mod plan;
mod pose;
mod report;
mod show;
mod state;

use swerve_core::Time;

use crate::msg::builtin_interfaces as builtin;
use crate::msg::std_msgs::Header;

pub use actuation::{
    AccelLimits, Dataspeed, Raptor, SteeringGear, ackermann_from_ros, ackermann_to_ros, carla_control,
    carla_steering_from_ros, control_from_ros, control_to_ros, dataspeed_speed_from_ros,
    dataspeed_steering_from_ros, driver_active, raptor_speed_from_ros,
};
pub use cloud::{cloud_from_ros, cloud_to_ros};
pub use image::{camera_from_ros, camera_to_ros, image_from_ros, image_to_ros};
pub use objects::{Identities, objects_from_ros, objects_to_ros};
pub use plan::{path_to_ros, plan_from_ros, plan_to_ros};
pub use pose::{Sensor, edge_to_ros, pose_from_ros, pose_to_ros, transform_from_ros, transform_to_ros};
pub use report::{VehicleState, accel_to_ros, is_mode_taken, report_to_ros};
pub use show::{map_to_markers, obstacles_to_markers, plan_to_marker};
pub use state::{
    Beside, ego_from_pose, ego_from_ros, ego_to_ros, ego_to_transform, gnss_from_ros, gnss_to_ros,
    imu_from_ros, imu_to_ros, steering_to_ros, velocity_to_ros,
};

/// Instant of the ROS clock at run time zero.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Epoch {
    /// Nanoseconds since the epoch of the ROS clock; 0 if the simulator provides the clock.
    pub ns: i64,
}

impl Epoch {
    /// Run time of a stamp.
    pub fn time(self, stamp: builtin::Time) -> Time {
        Time::from_ns(stamp.ns().saturating_sub(self.ns))
    }

    /// Stamp of an instant of the run, clamped to the range of a stamp (1901 to 2038).
    pub fn stamp(self, time: Time) -> builtin::Time {
        builtin::Time::from_ns(time.ns().saturating_add(self.ns))
    }

    /// Header with the stamp of `time` and the frame `frame_id`.
    pub fn header(self, time: Time, frame_id: &str) -> Header {
        Header { stamp: self.stamp(time), frame_id: frame_id.to_owned() }
    }
}

impl builtin::Time {
    /// Nanoseconds since the epoch of the clock.
    pub fn ns(self) -> i64 {
        i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec)
    }

    /// Stamp from nanoseconds, clamped to its range.
    pub fn from_ns(ns: i64) -> Self {
        let (sec, nanosec) = split(ns);
        Self { sec, nanosec }
    }
}

impl builtin::Duration {
    /// Length in nanoseconds.
    pub fn ns(self) -> i64 {
        i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec)
    }

    /// Duration from nanoseconds, clamped to its range.
    pub fn from_ns(ns: i64) -> Self {
        let (sec, nanosec) = split(ns);
        Self { sec, nanosec }
    }
}

fn split(ns: i64) -> (i32, u32) {
    let sec = ns.div_euclid(1_000_000_000);
    match i32::try_from(sec) {
        Ok(sec) => (sec, ns.rem_euclid(1_000_000_000) as u32),
        Err(_) if sec < 0 => (i32::MIN, 0),
        Err(_) => (i32::MAX, 999_999_999),
    }
}

/// A valid message cannot be converted.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum ConvertError {
    /// Unexpected frame.
    #[error("it is in frame `{found}`, not in `{wanted}`")]
    Frame {
        /// Actual frame.
        found: String,
        /// Expected frame.
        wanted: String,
    },
    /// Unsupported pixel encoding.
    #[error("pixels in `{0}` are not read; `rgb8`, `bgr8`, `rgba8`, `bgra8`, `mono8` and `32FC1` are")]
    Encoding(String),
    /// A point cloud without coordinates, or whose coordinates are not floating-point numbers.
    #[error("the point cloud has no field `{0}` of a type that is read")]
    Field(&'static str),
    /// No satellite fix.
    #[error("there is no fix")]
    NoFix,
    /// The vehicle does not measure this quantity.
    #[error("`{0}` is not measured")]
    NotMeasured(&'static str),
    /// Instants do not increase, and there are no speeds to compute them from.
    #[error("point {0} is not later than the one before it, and nothing moves there")]
    NotLater(usize),
    /// Unsupported lens model.
    #[error("the lens is of model `{0}`, not `plumb_bob`")]
    Lens(String),
}

/// Checks that `found` is the frame `wanted`, ignoring a leading slash.
pub(crate) fn expect_frame(found: &str, wanted: &str) -> Result<(), ConvertError> {
    if found.trim_start_matches('/') == wanted.trim_start_matches('/') {
        return Ok(());
    }
    Err(ConvertError::Frame { found: found.to_owned(), wanted: wanted.to_owned() })
}

#[cfg(test)]
mod tests;
