//! `autoware_planning_msgs`.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::builtin_interfaces::Duration;
use super::geometry_msgs::{Pose, pose};
use super::std_msgs::Header;
use crate::check::parts::{SPEED_MAX_MPS, TIRE_ANGLE_MAX_RAD, frame};
use crate::check::{Check, Invalid, within};

/// Pose of base_link at an instant, and its motion there.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TrajectoryPoint {
    pub time_from_start: Duration,
    pub pose: Pose,
    pub longitudinal_velocity_mps: f32,
    pub lateral_velocity_mps: f32,
    pub acceleration_mps2: f32,
    pub heading_rate_rps: f32,
    pub front_wheel_angle_rad: f32,
    pub rear_wheel_angle_rad: f32,
}

/// Points in the order of travel.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Trajectory {
    pub header: Header,
    pub points: Vec<TrajectoryPoint>,
}

impl Check for Trajectory {
    fn check(&self) -> Result<(), Invalid> {
        frame("header.frame_id", &self.header.frame_id)?;
        for (i, point) in self.points.iter().enumerate() {
            let at = |part: &str| format!("points[{i}].{part}");
            pose(&at("pose"), &point.pose)?;
            let speed = f64::from(point.longitudinal_velocity_mps);
            within(&at("longitudinal_velocity_mps"), speed, -SPEED_MAX_MPS, SPEED_MAX_MPS)?;
            let angle = f64::from(point.front_wheel_angle_rad);
            within(&at("front_wheel_angle_rad"), angle, -TIRE_ANGLE_MAX_RAD, TIRE_ANGLE_MAX_RAD)?;
        }
        Ok(())
    }
}
