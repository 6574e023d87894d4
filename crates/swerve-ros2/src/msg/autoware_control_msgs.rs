//! `autoware_control_msgs`.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::builtin_interfaces::Time;
use crate::check::parts::{ACCEL_MAX_MPS2, SPEED_MAX_MPS, TIRE_ANGLE_MAX_RAD};
use crate::check::{Check, Invalid, within};

/// Angle of the front road wheels, radians, positive to the left, and its rate, rad/s.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Lateral {
    pub stamp: Time,
    pub control_time: Time,
    pub steering_tire_angle: f32,
    pub steering_tire_rotation_rate: f32,
    pub is_defined_steering_tire_rotation_rate: bool,
}

/// Speed (m/s), acceleration (m/s²), jerk (m/s³).
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Longitudinal {
    pub stamp: Time,
    pub control_time: Time,
    pub velocity: f32,
    pub acceleration: f32,
    pub jerk: f32,
    pub is_defined_acceleration: bool,
    pub is_defined_jerk: bool,
}

/// Motion command.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Control {
    pub stamp: Time,
    pub control_time: Time,
    pub lateral: Lateral,
    pub longitudinal: Longitudinal,
}

impl Check for Control {
    fn check(&self) -> Result<(), Invalid> {
        let (lateral, longitudinal) = (&self.lateral, &self.longitudinal);
        let angle = f64::from(lateral.steering_tire_angle);
        within("lateral.steering_tire_angle", angle, -TIRE_ANGLE_MAX_RAD, TIRE_ANGLE_MAX_RAD)?;
        let speed = f64::from(longitudinal.velocity);
        within("longitudinal.velocity", speed, -SPEED_MAX_MPS, SPEED_MAX_MPS)?;
        let accel = f64::from(longitudinal.acceleration);
        within("longitudinal.acceleration", accel, -ACCEL_MAX_MPS2, ACCEL_MAX_MPS2)
    }
}
