//! Conversion of commands and of drive-by-wire reports.

use swerve_core::Time;
use swerve_msg::{Command, MotionCommand};

use super::{ConvertError, Epoch};
use crate::AnyMessage;
use crate::msg::ackermann_msgs::{AckermannDrive, AckermannDriveStamped};
use crate::msg::autoware_control_msgs::{Control, Lateral, Longitudinal};
use crate::msg::std_msgs::Header;
use crate::msg::{autoware_vehicle_msgs, carla_msgs, ds_dbw_msgs, raptor_dbw_msgs};

/// Converts a command to Autoware's control message.
pub fn control_to_ros(command: &MotionCommand, epoch: Epoch) -> Control {
    let stamp = epoch.stamp(command.stamp);
    Control {
        stamp,
        control_time: stamp,
        lateral: Lateral {
            stamp,
            control_time: stamp,
            steering_tire_angle: command.steering_rad as f32,
            steering_tire_rotation_rate: 0.0,
            is_defined_steering_tire_rotation_rate: false,
        },
        longitudinal: Longitudinal {
            stamp,
            control_time: stamp,
            velocity: command.speed_mps as f32,
            acceleration: command.accel_mps2 as f32,
            jerk: 0.0,
            is_defined_acceleration: true,
            is_defined_jerk: false,
        },
    }
}

/// Converts Autoware's control message; an undefined acceleration becomes zero.
pub fn control_from_ros(control: &Control, epoch: Epoch) -> MotionCommand {
    let longitudinal = &control.longitudinal;
    let accel = if longitudinal.is_defined_acceleration { longitudinal.acceleration } else { 0.0 };
    MotionCommand {
        stamp: epoch.time(control.stamp),
        steering_rad: f64::from(control.lateral.steering_tire_angle),
        speed_mps: f64::from(longitudinal.velocity),
        accel_mps2: f64::from(accel),
    }
}

/// Converts a command to `AckermannDriveStamped`: angle of the road wheels in radians, positive to the left; speed in
/// m/s and acceleration in m/s^2, negative while braking. The rates of angle and acceleration are zero, which leaves them
/// to the vehicle. `base_link` is the frame at the centre of the rear axle.
pub fn ackermann_to_ros(command: &MotionCommand, epoch: Epoch, base_link: &str) -> AckermannDriveStamped {
    AckermannDriveStamped {
        header: Header { stamp: epoch.stamp(command.stamp), frame_id: base_link.to_owned() },
        drive: AckermannDrive {
            steering_angle: command.steering_rad as f32,
            steering_angle_velocity: 0.0,
            speed: command.speed_mps as f32,
            acceleration: command.accel_mps2 as f32,
            jerk: 0.0,
        },
    }
}

/// Converts `AckermannDriveStamped`; the rates of angle and acceleration are not used.
pub fn ackermann_from_ros(command: &AckermannDriveStamped, epoch: Epoch) -> MotionCommand {
    MotionCommand {
        stamp: epoch.time(command.header.stamp),
        steering_rad: f64::from(command.drive.steering_angle),
        speed_mps: f64::from(command.drive.speed),
        accel_mps2: f64::from(command.drive.acceleration),
    }
}

/// Steering gear between the steering wheel and the road wheels.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SteeringGear {
    /// Steering ratio: steering wheel angle over road wheel angle.
    pub ratio: f64,
    /// Maximum steering wheel angle to each side, degrees.
    pub wheel_max_deg: f64,
    /// Steering wheel rate, degrees/s; 0 for the vehicle's default.
    pub wheel_rate_degps: f64,
}

impl Default for SteeringGear {
    /// Values of a Lincoln MKZ.
    fn default() -> Self {
        Self { ratio: 14.8, wheel_max_deg: 470.0, wheel_rate_degps: 0.0 }
    }
}

impl SteeringGear {
    /// Steering wheel angle for a road wheel angle in radians, degrees, clamped to the maximum.
    pub fn wheel_deg(&self, steering_rad: f64) -> f64 {
        (steering_rad.to_degrees() * self.ratio).clamp(-self.wheel_max_deg, self.wheel_max_deg)
    }

    /// Road wheel angle for a steering wheel angle in degrees, radians.
    pub fn steering_rad(&self, wheel_deg: f64) -> f64 {
        (wheel_deg / self.ratio).to_radians()
    }
}

/// Acceleration limits of a vehicle's own controller; both are positive.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct AccelLimits {
    /// While accelerating, m/s².
    pub accel_mps2: f64,
    /// While decelerating, m/s².
    pub decel_mps2: f64,
}

/// Builds commands for Dataspeed's interface. Never sets `ignore`: the driver always has priority.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Dataspeed {
    /// Steering gear.
    pub gear: SteeringGear,
    /// Instant of the ROS clock at run time zero.
    pub epoch: Epoch,
}

impl Dataspeed {
    /// Steering wheel angle command. `clear` resets an earlier driver override: set it in the first command after
    /// enabling.
    pub fn steering(
        &self,
        at: Time,
        steering_rad: f64,
        enable: bool,
        clear: bool,
    ) -> ds_dbw_msgs::SteeringCmd {
        ds_dbw_msgs::SteeringCmd {
            header: self.epoch.header(at, ""),
            cmd: self.gear.wheel_deg(steering_rad) as f32,
            cmd_rate: self.gear.wheel_rate_degps as f32,
            cmd_accel: 0.0,
            cmd_type: ds_dbw_msgs::SteeringCmd::CMD_ANGLE,
            enable,
            clear,
            ignore: false,
        }
    }

    /// Throttle and brake pedal commands, by travel.
    pub fn pedals(
        &self,
        at: Time,
        command: &Command,
        enable: bool,
        clear: bool,
    ) -> (ds_dbw_msgs::ThrottleCmd, ds_dbw_msgs::BrakeCmd) {
        let percent = |pedal: f64| (100.0 * pedal.clamp(0.0, 1.0)) as f32;
        let throttle = ds_dbw_msgs::ThrottleCmd {
            header: self.epoch.header(at, ""),
            cmd: percent(command.throttle),
            cmd_type: ds_dbw_msgs::ThrottleCmd::CMD_PERCENT,
            enable,
            clear,
            ..ds_dbw_msgs::ThrottleCmd::default()
        };
        let brake = ds_dbw_msgs::BrakeCmd {
            header: self.epoch.header(at, ""),
            cmd: percent(command.brake),
            cmd_type: ds_dbw_msgs::BrakeCmd::CMD_PERCENT,
            enable,
            clear,
            ..ds_dbw_msgs::BrakeCmd::default()
        };
        (throttle, brake)
    }

    /// Speed command for the universal longitudinal controller, within the given accelerations.
    pub fn speed(
        &self,
        command: &MotionCommand,
        limits: AccelLimits,
        enable: bool,
        clear: bool,
    ) -> ds_dbw_msgs::UlcCmd {
        ds_dbw_msgs::UlcCmd {
            header: self.epoch.header(command.stamp, ""),
            cmd: command.speed_mps.max(0.0) as f32,
            limit_accel: limits.accel_mps2 as f32,
            limit_decel: limits.decel_mps2 as f32,
            cmd_type: ds_dbw_msgs::UlcCmd::CMD_VELOCITY,
            enable,
            clear,
            ..ds_dbw_msgs::UlcCmd::default()
        }
    }
}

/// Road wheel angle of Dataspeed's report, radians.
///
/// # Errors
/// If the vehicle does not measure it.
pub fn dataspeed_steering_from_ros(
    report: &ds_dbw_msgs::SteeringReport,
    gear: &SteeringGear,
) -> Result<f64, ConvertError> {
    if report.steering_wheel_angle.is_nan() {
        return Err(ConvertError::NotMeasured("steering_wheel_angle"));
    }
    Ok(gear.steering_rad(f64::from(report.steering_wheel_angle)))
}

/// Speed of Dataspeed's report, m/s: measured by the brakes, else by the drivetrain.
///
/// # Errors
/// If the vehicle measures neither.
pub fn dataspeed_speed_from_ros(report: &ds_dbw_msgs::VehicleVelocity) -> Result<f64, ConvertError> {
    let both = [report.vehicle_velocity_brake, report.vehicle_velocity_propulsion];
    let measured = both.into_iter().find(|speed| !speed.is_nan());
    measured.map(f64::from).ok_or(ConvertError::NotMeasured("vehicle_velocity_brake"))
}

/// Returns true if a report indicates driver activity or manual driving; `None` for messages without that
/// information.
///
/// Autoware: any control mode in which steering or speed is not ours. Dataspeed: an active override, at this or
/// another actuator. Raptor: driver activity.
pub fn driver_active(report: &AnyMessage) -> Option<bool> {
    use autoware_vehicle_msgs::ControlModeReport;
    match report {
        AnyMessage::ControlModeReport(report) => Some(report.mode != ControlModeReport::AUTONOMOUS),
        AnyMessage::DataspeedSteeringReport(r) => Some(r.override_active || r.override_other),
        AnyMessage::DataspeedBrakeReport(r) => Some(r.override_active || r.override_other),
        AnyMessage::DataspeedThrottleReport(r) => Some(r.override_active || r.override_other),
        AnyMessage::RaptorSteeringReport(r) => Some(r.driver_activity),
        AnyMessage::RaptorBrakeReport(r) => Some(r.driver_activity),
        AnyMessage::RaptorAcceleratorPedalReport(r) => Some(r.driver_activity),
        AnyMessage::RaptorMiscReport(r) => Some(r.general_driver_activity),
        _ => None,
    }
}

/// Command for CARLA: the steering as a share of the largest angle of the road wheels, `gear.wheel_max_deg` over
/// `gear.ratio`, positive to the right; pedals from 0 to 1. The forward gear is selected.
pub fn carla_control(
    command: &Command,
    gear: &SteeringGear,
    at: Time,
    epoch: Epoch,
    frame: &str,
) -> carla_msgs::CarlaEgoVehicleControl {
    let pedal = |pedal: f64| pedal.clamp(0.0, 1.0) as f32;
    carla_msgs::CarlaEgoVehicleControl {
        header: epoch.header(at, frame),
        throttle: pedal(command.throttle),
        steer: -(gear.wheel_deg(command.steering_rad) / gear.wheel_max_deg) as f32,
        brake: pedal(command.brake),
        gear: 1,
        ..carla_msgs::CarlaEgoVehicleControl::default()
    }
}

/// Angle of the front road wheels commanded in a message of CARLA, radians; positive to the left.
pub fn carla_steering_from_ros(control: &carla_msgs::CarlaEgoVehicleControl, gear: &SteeringGear) -> f64 {
    -gear.steering_rad(f64::from(control.steer) * gear.wheel_max_deg)
}

/// Builds commands for New Eagle's Raptor, which contain a rolling counter as a heartbeat.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Raptor {
    /// Steering gear.
    pub gear: SteeringGear,
}

impl Raptor {
    /// Steering wheel angle command.
    pub fn steering(&self, steering_rad: f64, enable: bool, counter: u32) -> raptor_dbw_msgs::SteeringCmd {
        raptor_dbw_msgs::SteeringCmd {
            angle_cmd: self.gear.wheel_deg(steering_rad) as f32,
            angle_velocity: self.gear.wheel_rate_degps as f32,
            enable,
            rolling_counter: (counter % 256) as u8,
            control_type: mode(raptor_dbw_msgs::ActuatorControlMode::CLOSED_LOOP_ACTUATOR),
            ..raptor_dbw_msgs::SteeringCmd::default()
        }
    }

    /// Accelerator and brake pedal commands, by travel.
    pub fn pedals(
        &self,
        command: &Command,
        enable: bool,
        counter: u32,
    ) -> (raptor_dbw_msgs::AcceleratorPedalCmd, raptor_dbw_msgs::BrakeCmd) {
        let percent = |pedal: f64| (100.0 * pedal.clamp(0.0, 1.0)) as f32;
        let control_type = mode(raptor_dbw_msgs::ActuatorControlMode::OPEN_LOOP);
        let rolling_counter = (counter % 256) as u8;
        let accelerator = raptor_dbw_msgs::AcceleratorPedalCmd {
            pedal_cmd: percent(command.throttle),
            enable,
            rolling_counter,
            control_type,
            ..raptor_dbw_msgs::AcceleratorPedalCmd::default()
        };
        let brake = raptor_dbw_msgs::BrakeCmd {
            pedal_cmd: percent(command.brake),
            enable,
            rolling_counter,
            control_type,
            ..raptor_dbw_msgs::BrakeCmd::default()
        };
        (accelerator, brake)
    }
}

fn mode(value: u8) -> raptor_dbw_msgs::ActuatorControlMode {
    raptor_dbw_msgs::ActuatorControlMode { value }
}

/// Speed of Raptor's report, converted from km/h to m/s.
pub fn raptor_speed_from_ros(report: &raptor_dbw_msgs::MiscReport) -> f64 {
    f64::from(report.vehicle_speed) / 3.6
}
