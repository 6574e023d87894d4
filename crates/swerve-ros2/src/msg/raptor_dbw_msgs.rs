//! `raptor_dbw_msgs` of New Eagle: angles of the steering **wheel** in **degrees**, positive to the left; pedals in
//! percent. Commands have no stamp but a counter that wraps.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::std_msgs::Header;
use crate::check::parts::{SPEED_MAX_MPS, WHEEL_ANGLE_MAX_DEG, WHEEL_SPEED_MAX_RADPS};
use crate::check::{Check, Invalid, one_of, within};

/// Control mode of an actuator: 0 open loop, 1 closed at the actuator, 2 closed at the vehicle, 255 none.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct ActuatorControlMode {
    pub value: u8,
}

impl ActuatorControlMode {
    pub const OPEN_LOOP: u8 = 0;
    pub const CLOSED_LOOP_ACTUATOR: u8 = 1;
    pub const CLOSED_LOOP_VEHICLE: u8 = 2;
    pub const NONE: u8 = 255;
}

/// Parking brake: 0 none, 1 off, 2 on, 3 fault.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct ParkingBrake {
    pub status: u8,
}

/// A gear: 0 none, 1 park, 2 reverse, 3 neutral, 4 drive, 5 low.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Gear {
    pub gear: u8,
}

/// Command of the accelerator pedal (%), torque (%) or speed (m/s).
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct AcceleratorPedalCmd {
    pub pedal_cmd: f32,
    pub torque_cmd: f32,
    pub speed_cmd: f32,
    pub enable: bool,
    pub ignore: bool,
    pub rolling_counter: u8,
    pub road_slope: f32,
    pub control_type: ActuatorControlMode,
    pub accel_limit: f32,
    pub accel_positive_jerk_limit: f32,
}

/// Command of the brake pedal (%).
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct BrakeCmd {
    pub pedal_cmd: f32,
    pub enable: bool,
    pub rolling_counter: u8,
    pub torque_cmd: f32,
    pub decel_limit: f32,
    pub control_type: ActuatorControlMode,
    pub decel_negative_jerk_limit: f32,
    pub park_brake_cmd: ParkingBrake,
}

/// Command of the steering wheel (degrees; degrees/s, 0 for the maximum) or curvature (1/m).
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct SteeringCmd {
    pub angle_cmd: f32,
    pub angle_velocity: f32,
    pub enable: bool,
    pub ignore: bool,
    pub rolling_counter: u8,
    pub torque_cmd: f32,
    pub vehicle_curvature_cmd: f32,
    pub control_type: ActuatorControlMode,
}

/// Gear command.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct GearCmd {
    pub cmd: Gear,
    pub enable: bool,
    pub rolling_counter: u8,
}

/// Master enable switch.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct GlobalEnableCmd {
    pub global_enable: bool,
    pub enable_joystick_limits: bool,
    pub ecu_build_number: u16,
    pub rolling_counter: u8,
}

/// Report of the steering.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct SteeringReport {
    pub header: Header,
    pub steering_wheel_angle: f32,
    pub steering_wheel_angle_cmd: f32,
    pub steering_wheel_torque: f32,
    pub enabled: bool,
    pub driver_activity: bool,
    pub fault_steering_system: bool,
    pub overheat_prevention_mode: bool,
    pub rolling_counter: u8,
    pub control_type: ActuatorControlMode,
    pub steering_overheat_warning: bool,
}

/// Report of the accelerator pedal.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct AcceleratorPedalReport {
    pub header: Header,
    pub pedal_input: f32,
    pub pedal_output: f32,
    pub enabled: bool,
    pub ignore_driver: bool,
    pub driver_activity: bool,
    pub fault_accel_pedal_system: bool,
    pub fault_ch1: bool,
    pub fault_ch2: bool,
    pub rolling_counter: u8,
    pub torque_actual: f32,
    pub control_type: ActuatorControlMode,
}

/// Report of the brake.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct BrakeReport {
    pub header: Header,
    pub pedal_position: f32,
    pub pedal_output: f32,
    pub enabled: bool,
    pub driver_activity: bool,
    pub fault_brake_system: bool,
    pub rolling_counter: u8,
    pub brake_torque_actual: f32,
    pub intervention_active: bool,
    pub intervention_ready: bool,
    pub parking_brake: ParkingBrake,
    pub control_type: ActuatorControlMode,
}

/// Report of the whole vehicle; speed in **km/h**.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct MiscReport {
    pub header: Header,
    pub fuel_level: f32,
    pub drive_by_wire_enabled: bool,
    pub vehicle_speed: f32,
    pub software_build_number: u16,
    pub general_actuator_fault: bool,
    pub by_wire_ready: bool,
    pub general_driver_activity: bool,
    pub comms_fault: bool,
    pub ambient_temp: f32,
}

/// Wheel speeds, rad/s.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct WheelSpeedReport {
    pub header: Header,
    pub front_left: f32,
    pub front_right: f32,
    pub rear_left: f32,
    pub rear_right: f32,
}

impl Check for AcceleratorPedalCmd {
    fn check(&self) -> Result<(), Invalid> {
        within("pedal_cmd", f64::from(self.pedal_cmd), 0.0, 100.0)?;
        within("speed_cmd", f64::from(self.speed_cmd), 0.0, SPEED_MAX_MPS)?;
        raptor_mode("control_type.value", self.control_type)
    }
}

impl Check for BrakeCmd {
    fn check(&self) -> Result<(), Invalid> {
        within("pedal_cmd", f64::from(self.pedal_cmd), 0.0, 100.0)?;
        within("park_brake_cmd.status", f64::from(self.park_brake_cmd.status), 0.0, 3.0)?;
        raptor_mode("control_type.value", self.control_type)
    }
}

impl Check for SteeringCmd {
    fn check(&self) -> Result<(), Invalid> {
        within("angle_cmd", f64::from(self.angle_cmd), -WHEEL_ANGLE_MAX_DEG, WHEEL_ANGLE_MAX_DEG)?;
        within("angle_velocity", f64::from(self.angle_velocity), 0.0, 2000.0)?;
        raptor_mode("control_type.value", self.control_type)
    }
}

impl Check for GearCmd {
    fn check(&self) -> Result<(), Invalid> {
        within("cmd.gear", f64::from(self.cmd.gear), 0.0, 8.0)
    }
}

impl Check for GlobalEnableCmd {
    fn check(&self) -> Result<(), Invalid> {
        Ok(())
    }
}

impl Check for SteeringReport {
    fn check(&self) -> Result<(), Invalid> {
        let angle = f64::from(self.steering_wheel_angle);
        within("steering_wheel_angle", angle, -WHEEL_ANGLE_MAX_DEG, WHEEL_ANGLE_MAX_DEG)?;
        raptor_mode("control_type.value", self.control_type)
    }
}

impl Check for AcceleratorPedalReport {
    fn check(&self) -> Result<(), Invalid> {
        within("pedal_output", f64::from(self.pedal_output), -1.0, 110.0)?;
        raptor_mode("control_type.value", self.control_type)
    }
}

impl Check for BrakeReport {
    fn check(&self) -> Result<(), Invalid> {
        within("pedal_output", f64::from(self.pedal_output), -1.0, 110.0)?;
        within("parking_brake.status", f64::from(self.parking_brake.status), 0.0, 3.0)?;
        raptor_mode("control_type.value", self.control_type)
    }
}

impl Check for MiscReport {
    fn check(&self) -> Result<(), Invalid> {
        within("vehicle_speed", f64::from(self.vehicle_speed), -500.0, 500.0)?;
        within("fuel_level", f64::from(self.fuel_level), -1.0, 110.0)
    }
}

impl Check for WheelSpeedReport {
    fn check(&self) -> Result<(), Invalid> {
        let most = WHEEL_SPEED_MAX_RADPS;
        within("front_left", f64::from(self.front_left), -most, most)?;
        within("front_right", f64::from(self.front_right), -most, most)?;
        within("rear_left", f64::from(self.rear_left), -most, most)?;
        within("rear_right", f64::from(self.rear_right), -most, most)
    }
}

fn raptor_mode(field: &str, mode: ActuatorControlMode) -> Result<(), Invalid> {
    one_of(field, mode.value, &[0, 1, 2, 255])
}
