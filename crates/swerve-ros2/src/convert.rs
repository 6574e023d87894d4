//! Between ROS messages and ours: units, frames, axes, stamps, covariances.
//!
//! ROS (REP 103, 105): SI, radians, x forward, y left, z up, the map's x to the east; `base_link` is the centre
//! of the rear axle, as Autoware has it; an optical frame has x right, y down, z forward. All of that is ours too,
//! so that what is left to convert is
//!
//! - stamps: ours count from the start of the run, ROS's from the epoch of its clock ([`Epoch`]);
//! - pixels: the centre of the first is (0, 0) in ROS and (0.5, 0.5) here;
//! - intensities: 0 to 255 in ROS, 0 to 1 here;
//! - steering wheels in degrees of vehicles driven by wire, road wheels in radians here.

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
    AccelLimits, Dataspeed, Raptor, SteeringGear, control_from_ros, control_to_ros, dataspeed_speed_from_ros,
    dataspeed_steering_from_ros, driver_active, raptor_speed_from_ros,
};
pub use cloud::{cloud_from_ros, cloud_to_ros};
pub use image::{camera_from_ros, camera_to_ros, image_from_ros, image_to_ros};
pub use objects::{Identities, objects_from_ros, objects_to_ros};
pub use plan::{path_to_ros, plan_from_ros, plan_to_ros};
pub use pose::{Sensor, edge_to_ros, pose_from_ros, pose_to_ros, transform_from_ros, transform_to_ros};
pub use report::{VehicleState, accel_to_ros, is_mode_taken, report_to_ros};
pub use show::{obstacles_to_markers, plan_to_marker};
pub use state::{
    Beside, ego_from_pose, ego_from_ros, ego_to_ros, ego_to_transform, gnss_from_ros, gnss_to_ros,
    imu_from_ros, imu_to_ros, steering_to_ros, velocity_to_ros,
};

/// Which instant of ROS's clock the run's time zero is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Epoch {
    /// Nanoseconds since the epoch of ROS's clock: 0 where the simulator is the clock.
    pub ns: i64,
}

impl Epoch {
    /// The run's time of a stamp.
    pub fn time(self, stamp: builtin::Time) -> Time {
        Time::from_ns(stamp.ns().saturating_sub(self.ns))
    }

    /// The stamp of an instant of the run; what a stamp cannot hold (before 1902, after 2038) stays at its ends.
    pub fn stamp(self, time: Time) -> builtin::Time {
        builtin::Time::from_ns(time.ns().saturating_add(self.ns))
    }

    /// A header for what describes `time` in `frame_id`.
    pub fn header(self, time: Time, frame_id: &str) -> Header {
        Header { stamp: self.stamp(time), frame_id: frame_id.to_owned() }
    }
}

impl builtin::Time {
    /// Nanoseconds since the epoch of the clock.
    pub fn ns(self) -> i64 {
        i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec)
    }

    /// The other way; stays at the ends of what it can hold.
    pub fn from_ns(ns: i64) -> Self {
        let (sec, nanosec) = split(ns);
        Self { sec, nanosec }
    }
}

impl builtin::Duration {
    /// Nanoseconds.
    pub fn ns(self) -> i64 {
        i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec)
    }

    /// The other way; stays at the ends of what it can hold.
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

/// Why a message that is sound says nothing that we can use.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum ConvertError {
    /// It is about another frame.
    #[error("it is in frame `{found}`, not in `{wanted}`")]
    Frame {
        /// The frame that it names.
        found: String,
        /// The frame that was to be.
        wanted: String,
    },
    /// Pixels that we do not read.
    #[error("pixels in `{0}` are not read; `rgb8`, `bgr8`, `rgba8`, `bgra8`, `mono8` and `32FC1` are")]
    Encoding(String),
    /// A point cloud without coordinates, or with coordinates that are no numbers with a point.
    #[error("the point cloud has no field `{0}` of a type that is read")]
    Field(&'static str),
    /// No satellites.
    #[error("there is no fix")]
    NoFix,
    /// A number that the vehicle does not measure.
    #[error("`{0}` is not measured")]
    NotMeasured(&'static str),
    /// Points at instants that do not increase, and without speeds to get instants from.
    #[error("point {0} is not later than the one before it, and nothing moves there")]
    NotLater(usize),
    /// A lens that we do not know.
    #[error("the lens is of model `{0}`, not `plumb_bob`")]
    Lens(String),
}

/// Whether `found` is the frame `wanted`; a slash in front means nothing.
pub(crate) fn expect_frame(found: &str, wanted: &str) -> Result<(), ConvertError> {
    if found.trim_start_matches('/') == wanted.trim_start_matches('/') {
        return Ok(());
    }
    Err(ConvertError::Frame { found: found.to_owned(), wanted: wanted.to_owned() })
}

#[cfg(test)]
mod tests;
