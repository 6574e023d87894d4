//! `autoware_control_msgs`.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::builtin_interfaces::Time;

/// Angle of the front road wheels, radians, positive to the left, and its rate.
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

/// What the vehicle is to do.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Control {
    pub stamp: Time,
    pub control_time: Time,
    pub lateral: Lateral,
    pub longitudinal: Longitudinal,
}
