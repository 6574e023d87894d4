//! `ds_dbw_msgs` of Dataspeed (2.3): angles of the steering **wheel** in **degrees**, positive to the left; pedals
//! in percent. Values of a report are NaN if the vehicle has no such signal.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::std_msgs::Header;
use crate::check::parts::{SPEED_MAX_MPS, WHEEL_ANGLE_MAX_DEG, WHEEL_SPEED_MAX_RADPS};
use crate::check::{Check, Invalid, one_of, within, within_if_any};

/// Steering command: `cmd_rate` in degrees/s, 0 for the vehicle's default.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct SteeringCmd {
    pub header: Header,
    pub cmd: f32,
    pub cmd_rate: f32,
    pub cmd_accel: f32,
    pub cmd_type: u8,
    pub enable: bool,
    pub clear: bool,
    pub ignore: bool,
}

impl SteeringCmd {
    pub const CMD_NONE: u8 = 0;
    pub const CMD_TORQUE: u8 = 1;
    pub const CMD_ANGLE: u8 = 2;
    pub const CMD_CURVATURE: u8 = 3;
    pub const CMD_YAW_RATE: u8 = 4;
    pub const CMD_PERCENT: u8 = 14;
    pub const CMD_CALIBRATE: u8 = 15;
}

/// Brake command.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct BrakeCmd {
    pub header: Header,
    pub cmd: f32,
    pub rate_inc: f32,
    pub rate_dec: f32,
    pub cmd_type: u8,
    pub enable: bool,
    pub clear: bool,
    pub ignore: bool,
}

impl BrakeCmd {
    pub const CMD_NONE: u8 = 0;
    pub const CMD_PRESSURE: u8 = 1;
    pub const CMD_TORQUE: u8 = 2;
    pub const CMD_ACCEL: u8 = 8;
    pub const CMD_ACCEL_ACC: u8 = 9;
    pub const CMD_ACCEL_AEB: u8 = 10;
    pub const CMD_PEDAL_RAW: u8 = 13;
    pub const CMD_PERCENT: u8 = 14;
}

/// Throttle command.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct ThrottleCmd {
    pub header: Header,
    pub cmd: f32,
    pub rate_inc: f32,
    pub rate_dec: f32,
    pub cmd_type: u8,
    pub enable: bool,
    pub clear: bool,
    pub ignore: bool,
}

impl ThrottleCmd {
    pub const CMD_NONE: u8 = 0;
    pub const CMD_PEDAL_RAW: u8 = 13;
    pub const CMD_PERCENT: u8 = 14;
}

/// Command to the universal longitudinal controller: speed (m/s) or acceleration (m/s²).
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct UlcCmd {
    pub header: Header,
    pub cmd: f32,
    pub limit_accel: f32,
    pub limit_decel: f32,
    pub limit_jerk_throttle: f32,
    pub limit_jerk_brake: f32,
    pub cmd_type: u8,
    pub enable: bool,
    pub clear: bool,
    pub enable_shift: bool,
    pub enable_shift_park: bool,
    pub coast_decel: bool,
}

impl UlcCmd {
    pub const CMD_NONE: u8 = 0;
    pub const CMD_VELOCITY: u8 = 1;
    pub const CMD_ACCEL: u8 = 2;
}

/// A gear: 0 none, 1 park, 2 reverse, 3 neutral, 4 drive, 5 low, 6 manual, 7 sport, 15 calibrate.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Gear {
    pub value: u8,
}

/// Command source: 0 user, 1 universal controller, 2 remote, 3 button, 4 loss of communication, 5 lockout.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct CmdSrc {
    pub value: u8,
}

/// Reason for rejecting a gear; 0 if it was not rejected.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct GearReject {
    pub value: u8,
}

/// Gear command.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct GearCmd {
    pub header: Header,
    pub cmd: Gear,
}

/// Report of the steering.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct SteeringReport {
    pub header: Header,
    pub steering_wheel_angle: f32,
    pub steering_column_torque: f32,
    pub cmd: f32,
    pub cmd_type: u8,
    pub limiting_value: bool,
    pub limiting_rate: bool,
    pub external_control: bool,
    pub ready: bool,
    pub enabled: bool,
    pub override_active: bool,
    pub override_other: bool,
    pub override_latched: bool,
    pub timeout: bool,
    pub fault: bool,
    pub bad_crc: bool,
    pub bad_rc: bool,
    pub degraded: bool,
    pub limit_rate: f32,
    pub limit_value: f32,
    pub cmd_src: CmdSrc,
}

/// Report of the brake.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct BrakeReport {
    pub header: Header,
    pub cmd_type: u8,
    pub pressure_input: f32,
    pub pressure_cmd: f32,
    pub pressure_output: f32,
    pub torque_input: f32,
    pub torque_cmd: f32,
    pub torque_output: f32,
    pub accel_cmd: f32,
    pub accel_output: f32,
    pub percent_input: f32,
    pub percent_cmd: f32,
    pub percent_output: f32,
    pub btsi_cmd: bool,
    pub yield_request: bool,
    pub limiting_value: bool,
    pub limiting_rate: bool,
    pub external_control: bool,
    pub ready: bool,
    pub enabled: bool,
    pub override_active: bool,
    pub override_other: bool,
    pub override_latched: bool,
    pub timeout: bool,
    pub fault: bool,
    pub bad_crc: bool,
    pub bad_rc: bool,
    pub degraded: bool,
    pub limit_value: f32,
    pub brake_available_duration: f32,
    pub brake_available_full: bool,
    pub req_shift_park: bool,
    pub req_park_brake: bool,
    pub external_button: bool,
    pub comms_loss_armed: bool,
    pub cmd_src: CmdSrc,
}

/// Report of the throttle.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct ThrottleReport {
    pub header: Header,
    pub cmd_type: u8,
    pub percent_input: f32,
    pub percent_cmd: f32,
    pub percent_output: f32,
    pub yield_request: bool,
    pub limiting_value: bool,
    pub limiting_rate: bool,
    pub external_control: bool,
    pub ready: bool,
    pub enabled: bool,
    pub override_active: bool,
    pub override_other: bool,
    pub override_latched: bool,
    pub timeout: bool,
    pub fault: bool,
    pub bad_crc: bool,
    pub bad_rc: bool,
    pub degraded: bool,
    pub limit_value: f32,
    pub cmd_src: CmdSrc,
}

/// Report of the universal longitudinal controller.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct UlcReport {
    pub header: Header,
    pub cmd_type: u8,
    pub vel_ref: f32,
    pub vel_meas: f32,
    pub accel_ref: f32,
    pub accel_meas: f32,
    pub coast_decel: bool,
    pub ready: bool,
    pub enabled: bool,
    pub override_active: bool,
    pub override_latched: bool,
    pub preempted: bool,
    pub timeout: bool,
    pub bad_crc: bool,
    pub bad_rc: bool,
}

/// Report of the gear.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct GearReport {
    pub header: Header,
    pub gear: Gear,
    pub cmd: Gear,
    pub driver: Gear,
    pub reject: GearReject,
    pub power_latched: bool,
    pub external_control: bool,
    pub ready: bool,
    pub override_active: bool,
    pub override_other: bool,
    pub fault: bool,
    pub bad_crc: bool,
    pub degraded: bool,
    pub cmd_src: CmdSrc,
}

/// Speed measured by brakes and drivetrain, m/s.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct VehicleVelocity {
    pub header: Header,
    pub vehicle_velocity_brake: f32,
    pub vehicle_velocity_propulsion: f32,
    pub dir_src: u8,
}

/// Wheel speeds, rad/s.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct WheelSpeeds {
    pub header: Header,
    pub front_left: f32,
    pub front_right: f32,
    pub rear_left: f32,
    pub rear_right: f32,
}

/// Fields that are NaN on vehicles without the signal.
const NOT_MEASURED: &[&str] = &[
    "steering_wheel_angle",
    "steering_column_torque",
    "cmd",
    "limit_rate",
    "limit_value",
    "pressure_input",
    "pressure_cmd",
    "pressure_output",
    "torque_input",
    "torque_cmd",
    "torque_output",
    "accel_cmd",
    "accel_output",
    "percent_input",
    "percent_cmd",
    "percent_output",
    "brake_available_duration",
    "vel_ref",
    "vel_meas",
    "accel_ref",
    "accel_meas",
    "vehicle_velocity_brake",
    "vehicle_velocity_propulsion",
    "front_left",
    "front_right",
    "rear_left",
    "rear_right",
];

impl Check for SteeringCmd {
    fn check(&self) -> Result<(), Invalid> {
        one_of("cmd_type", self.cmd_type, &[0, 1, 2, 3, 4, 14, 15])?;
        within("cmd", f64::from(self.cmd), -WHEEL_ANGLE_MAX_DEG, WHEEL_ANGLE_MAX_DEG)?;
        within("cmd_rate", f64::from(self.cmd_rate), 0.0, 2000.0)
    }
}

impl Check for BrakeCmd {
    fn check(&self) -> Result<(), Invalid> {
        one_of("cmd_type", self.cmd_type, &[0, 1, 2, 8, 9, 10, 13, 14])
    }
}

impl Check for ThrottleCmd {
    fn check(&self) -> Result<(), Invalid> {
        one_of("cmd_type", self.cmd_type, &[0, 13, 14])
    }

    fn fit(&mut self) {
        self.cmd_type = Self::CMD_PERCENT;
    }
}

impl Check for UlcCmd {
    fn check(&self) -> Result<(), Invalid> {
        one_of("cmd_type", self.cmd_type, &[0, 1, 2])?;
        within("cmd", f64::from(self.cmd), -SPEED_MAX_MPS, SPEED_MAX_MPS)
    }
}

impl Check for GearCmd {
    fn check(&self) -> Result<(), Invalid> {
        dataspeed_gear("cmd.value", self.cmd)
    }
}

impl Check for SteeringReport {
    const MAY_BE_NAN: &[&str] = NOT_MEASURED;

    fn check(&self) -> Result<(), Invalid> {
        let most = WHEEL_ANGLE_MAX_DEG;
        within_if_any("steering_wheel_angle", self.steering_wheel_angle, -most, most)?;
        within("cmd_type", f64::from(self.cmd_type), 0.0, 15.0)
    }
}

impl Check for BrakeReport {
    const MAY_BE_NAN: &[&str] = NOT_MEASURED;

    fn check(&self) -> Result<(), Invalid> {
        within("cmd_type", f64::from(self.cmd_type), 0.0, 15.0)?;
        within_if_any("percent_input", self.percent_input, -1.0, 110.0)?;
        within_if_any("percent_output", self.percent_output, -1.0, 110.0)
    }
}

impl Check for ThrottleReport {
    const MAY_BE_NAN: &[&str] = NOT_MEASURED;

    fn check(&self) -> Result<(), Invalid> {
        within("cmd_type", f64::from(self.cmd_type), 0.0, 15.0)?;
        within_if_any("percent_input", self.percent_input, -1.0, 110.0)?;
        within_if_any("percent_output", self.percent_output, -1.0, 110.0)
    }
}

impl Check for UlcReport {
    const MAY_BE_NAN: &[&str] = NOT_MEASURED;

    fn check(&self) -> Result<(), Invalid> {
        within("cmd_type", f64::from(self.cmd_type), 0.0, 15.0)?;
        within_if_any("vel_meas", self.vel_meas, -SPEED_MAX_MPS, SPEED_MAX_MPS)
    }
}

impl Check for GearReport {
    fn check(&self) -> Result<(), Invalid> {
        for (field, gear) in
            [("gear.value", self.gear), ("cmd.value", self.cmd), ("driver.value", self.driver)]
        {
            dataspeed_gear(field, gear)?;
        }
        within("reject.value", f64::from(self.reject.value), 0.0, 15.0)
    }
}

impl Check for VehicleVelocity {
    const MAY_BE_NAN: &[&str] = NOT_MEASURED;

    fn check(&self) -> Result<(), Invalid> {
        let most = SPEED_MAX_MPS;
        within_if_any("vehicle_velocity_brake", self.vehicle_velocity_brake, -most, most)?;
        within_if_any("vehicle_velocity_propulsion", self.vehicle_velocity_propulsion, -most, most)
    }
}

impl Check for WheelSpeeds {
    const MAY_BE_NAN: &[&str] = NOT_MEASURED;

    fn check(&self) -> Result<(), Invalid> {
        let most = WHEEL_SPEED_MAX_RADPS;
        within_if_any("front_left", self.front_left, -most, most)?;
        within_if_any("front_right", self.front_right, -most, most)?;
        within_if_any("rear_left", self.rear_left, -most, most)?;
        within_if_any("rear_right", self.rear_right, -most, most)
    }
}

fn dataspeed_gear(field: &str, gear: Gear) -> Result<(), Invalid> {
    one_of(field, gear.value, &[0, 1, 2, 3, 4, 5, 6, 7, 15])
}
