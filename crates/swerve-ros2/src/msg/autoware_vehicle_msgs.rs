//! `autoware_vehicle_msgs`.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::builtin_interfaces::Time;
use super::std_msgs::Header;
use crate::check::parts::{SPEED_MAX_MPS, TIRE_ANGLE_MAX_RAD, TURN_MAX_RADPS};
use crate::check::{Check, Invalid, within};

/// Longitudinal and lateral speed of base_link, m/s, and yaw rate, rad/s; positive to the left.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct VelocityReport {
    pub header: Header,
    pub longitudinal_velocity: f32,
    pub lateral_velocity: f32,
    pub heading_rate: f32,
}

/// Angle of the front road wheels, radians, positive to the left.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct SteeringReport {
    pub stamp: Time,
    pub steering_tire_angle: f32,
}

/// Control mode.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct ControlModeReport {
    pub stamp: Time,
    pub mode: u8,
}

impl ControlModeReport {
    pub const NO_COMMAND: u8 = 0;
    pub const AUTONOMOUS: u8 = 1;
    pub const AUTONOMOUS_STEER_ONLY: u8 = 2;
    pub const AUTONOMOUS_VELOCITY_ONLY: u8 = 3;
    pub const MANUAL: u8 = 4;
    pub const DISENGAGED: u8 = 5;
    pub const NOT_READY: u8 = 6;
}

/// Requested gear.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct GearCommand {
    pub stamp: Time,
    pub command: u8,
}

/// Present gear.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct GearReport {
    pub stamp: Time,
    pub report: u8,
}

impl GearReport {
    pub const NONE: u8 = 0;
    pub const NEUTRAL: u8 = 1;
    pub const DRIVE: u8 = 2;
    pub const REVERSE: u8 = 20;
    pub const PARK: u8 = 22;
    pub const LAST: u8 = 24;
}

/// Requested turn indicators: 0 no command, 1 off, 2 left, 3 right.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TurnIndicatorsCommand {
    pub stamp: Time,
    pub command: u8,
}

/// Turn indicators: 1 off, 2 left, 3 right.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TurnIndicatorsReport {
    pub stamp: Time,
    pub report: u8,
}

/// Requested hazard lights: 0 no command, 1 off, 2 on.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct HazardLightsCommand {
    pub stamp: Time,
    pub command: u8,
}

/// Hazard lights: 1 off, 2 on.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct HazardLightsReport {
    pub stamp: Time,
    pub report: u8,
}

/// True to engage the stack.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Engage {
    pub stamp: Time,
    pub engage: bool,
}

/// Request of the service `ControlModeCommand`: modes as in [`ControlModeReport`], 1 to 4.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct ControlModeCommandRequest {
    pub stamp: Time,
    pub mode: u8,
}

/// Reply of the service `ControlModeCommand`.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct ControlModeCommandResponse {
    pub success: bool,
}

impl Check for VelocityReport {
    fn check(&self) -> Result<(), Invalid> {
        let speed = f64::from(self.longitudinal_velocity);
        within("longitudinal_velocity", speed, -SPEED_MAX_MPS, SPEED_MAX_MPS)?;
        within("lateral_velocity", f64::from(self.lateral_velocity), -SPEED_MAX_MPS, SPEED_MAX_MPS)?;
        within("heading_rate", f64::from(self.heading_rate), -TURN_MAX_RADPS, TURN_MAX_RADPS)
    }
}

impl Check for SteeringReport {
    fn check(&self) -> Result<(), Invalid> {
        let angle = f64::from(self.steering_tire_angle);
        within("steering_tire_angle", angle, -TIRE_ANGLE_MAX_RAD, TIRE_ANGLE_MAX_RAD)
    }
}

impl Check for ControlModeReport {
    fn check(&self) -> Result<(), Invalid> {
        within("mode", f64::from(self.mode), 0.0, 6.0)
    }
}

impl Check for GearCommand {
    fn check(&self) -> Result<(), Invalid> {
        let last = f64::from(GearReport::LAST);
        within("command", f64::from(self.command), 0.0, last)
    }
}

impl Check for GearReport {
    fn check(&self) -> Result<(), Invalid> {
        within("report", f64::from(self.report), 0.0, f64::from(Self::LAST))
    }
}

impl Check for TurnIndicatorsCommand {
    fn check(&self) -> Result<(), Invalid> {
        within("command", f64::from(self.command), 0.0, 3.0)
    }
}

impl Check for TurnIndicatorsReport {
    fn check(&self) -> Result<(), Invalid> {
        within("report", f64::from(self.report), 0.0, 3.0)
    }
}

impl Check for HazardLightsCommand {
    fn check(&self) -> Result<(), Invalid> {
        within("command", f64::from(self.command), 0.0, 2.0)
    }
}

impl Check for HazardLightsReport {
    fn check(&self) -> Result<(), Invalid> {
        within("report", f64::from(self.report), 0.0, 2.0)
    }
}

impl Check for Engage {
    fn check(&self) -> Result<(), Invalid> {
        Ok(())
    }
}
