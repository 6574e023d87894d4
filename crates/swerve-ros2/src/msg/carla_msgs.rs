//! `carla_msgs` of `carla_ros_bridge`, and of the server of CARLA itself (`--ros2`).
//!
//! `steer` is a share of the largest angle of the road wheels, **positive to the right**, unlike all angles of ROS.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::geometry_msgs::{Accel, Quaternion};
use super::std_msgs::Header;
use crate::check::parts::{ACCEL_MAX_MPS2, SPEED_MAX_MPS};
use crate::check::{Check, Invalid, within};

/// Command of the pedals (0 to 1) and the steering (-1 to 1). The server applies it until the next one.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct CarlaEgoVehicleControl {
    pub header: Header,
    pub throttle: f32,
    pub steer: f32,
    pub brake: f32,
    pub hand_brake: bool,
    pub reverse: bool,
    pub gear: i32,
    pub manual_gear_shift: bool,
}

/// State of the vehicle: absolute speed in m/s, acceleration and orientation in the map frame, and the present command.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct CarlaEgoVehicleStatus {
    pub header: Header,
    pub velocity: f32,
    pub acceleration: Accel,
    pub orientation: Quaternion,
    pub control: CarlaEgoVehicleControl,
}

impl Check for CarlaEgoVehicleControl {
    fn check(&self) -> Result<(), Invalid> {
        within("throttle", f64::from(self.throttle), 0.0, 1.0)?;
        within("steer", f64::from(self.steer), -1.0, 1.0)?;
        within("brake", f64::from(self.brake), 0.0, 1.0)
    }
}

impl Check for CarlaEgoVehicleStatus {
    fn check(&self) -> Result<(), Invalid> {
        within("velocity", f64::from(self.velocity), -SPEED_MAX_MPS, SPEED_MAX_MPS)?;
        // Collisions in CARLA last one step: their peaks are beyond those of a road vehicle.
        let most = 100.0 * ACCEL_MAX_MPS2;
        within("acceleration.linear.x", self.acceleration.linear.x, -most, most)?;
        self.control
            .check()
            .map_err(|invalid| Invalid { field: format!("control.{}", invalid.field), ..invalid })
    }
}
