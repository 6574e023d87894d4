//! `ackermann_msgs`.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::std_msgs::Header;
use crate::check::parts::{ACCEL_MAX_MPS2, SPEED_MAX_MPS, TIRE_ANGLE_MAX_RAD};
use crate::check::{Check, Invalid, within};

/// Angle of the road wheels (radians, positive to the left) and speed; a rate of zero is the largest one.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct AckermannDrive {
    pub steering_angle: f32,
    pub steering_angle_velocity: f32,
    pub speed: f32,
    pub acceleration: f32,
    pub jerk: f32,
}

/// A command with its stamp.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct AckermannDriveStamped {
    pub header: Header,
    pub drive: AckermannDrive,
}

impl Check for AckermannDrive {
    fn check(&self) -> Result<(), Invalid> {
        within("steering_angle", f64::from(self.steering_angle), -TIRE_ANGLE_MAX_RAD, TIRE_ANGLE_MAX_RAD)?;
        within("speed", f64::from(self.speed), -SPEED_MAX_MPS, SPEED_MAX_MPS)?;
        within("acceleration", f64::from(self.acceleration), -ACCEL_MAX_MPS2, ACCEL_MAX_MPS2)
    }
}

impl Check for AckermannDriveStamped {
    fn check(&self) -> Result<(), Invalid> {
        self.drive.check().map_err(|invalid| Invalid { field: format!("drive.{}", invalid.field), ..invalid })
    }
}
