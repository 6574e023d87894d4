use swerve_core::Time;
use swerve_msg::{Command, MotionCommand};

use super::{ConvertError, Epoch};
use crate::AnyMessage;
use crate::msg::autoware_control_msgs::{Control, Lateral, Longitudinal};
use crate::msg::{autoware_vehicle_msgs, ds_dbw_msgs, raptor_dbw_msgs};

/// A command as Autoware's control message.
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

/// The motion that Autoware's control message asks for; an acceleration that it does not define is zero.
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

/// Between the road wheels and the steering wheel.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SteeringGear {
    /// Turns of the steering wheel for a turn of the road wheels.
    pub ratio: f64,
    /// How far the steering wheel turns to a side, degrees.
    pub wheel_max_deg: f64,
    /// How fast it is turned, degrees/s; 0 leaves that to the vehicle.
    pub wheel_rate_degps: f64,
}

impl Default for SteeringGear {
    /// A Lincoln MKZ.
    fn default() -> Self {
        Self { ratio: 14.8, wheel_max_deg: 470.0, wheel_rate_degps: 0.0 }
    }
}

impl SteeringGear {
    /// The steering wheel's angle for the road wheels' angle, degrees, within its travel.
    pub fn wheel_deg(&self, steering_rad: f64) -> f64 {
        (steering_rad.to_degrees() * self.ratio).clamp(-self.wheel_max_deg, self.wheel_max_deg)
    }

    /// The road wheels' angle for the steering wheel's angle.
    pub fn steering_rad(&self, wheel_deg: f64) -> f64 {
        (wheel_deg / self.ratio).to_radians()
    }
}

/// The accelerations that a vehicle's own controller keeps within; both are positive.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct AccelLimits {
    /// When it gets faster, m/s².
    pub accel_mps2: f64,
    /// When it gets slower, m/s².
    pub decel_mps2: f64,
}

/// Commands for a vehicle with Dataspeed's interface. `ignore` is never set: the driver always wins.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Dataspeed {
    /// Steering wheel and road wheels.
    pub gear: SteeringGear,
    /// Which instant of ROS's clock the run's time zero is.
    pub epoch: Epoch,
}

impl Dataspeed {
    /// Steering by angle. `clear` asks to forget an earlier takeover: set for the first command after enabling.
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

    /// Pedals by travel: throttle and brake.
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

    /// Speed through the universal longitudinal controller, which keeps within the accelerations given.
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

/// The road wheels' angle of Dataspeed's report.
///
/// # Errors
/// The vehicle does not measure it.
pub fn dataspeed_steering_from_ros(
    report: &ds_dbw_msgs::SteeringReport,
    gear: &SteeringGear,
) -> Result<f64, ConvertError> {
    if report.steering_wheel_angle.is_nan() {
        return Err(ConvertError::NotMeasured("steering_wheel_angle"));
    }
    Ok(gear.steering_rad(f64::from(report.steering_wheel_angle)))
}

/// The speed of Dataspeed's report: as the brakes measure it, else as the drivetrain does, m/s.
///
/// # Errors
/// The vehicle measures neither.
pub fn dataspeed_speed_from_ros(report: &ds_dbw_msgs::VehicleVelocity) -> Result<f64, ConvertError> {
    let both = [report.vehicle_velocity_brake, report.vehicle_velocity_propulsion];
    let measured = both.into_iter().find(|speed| !speed.is_nan());
    measured.map(f64::from).ok_or(ConvertError::NotMeasured("vehicle_velocity_brake"))
}

/// Whether a report says that the driver acts or drives; `None` from messages that say nothing of it.
///
/// Autoware's control mode: any mode in which steering or speed is not ours. Dataspeed: an override that is active,
/// here or at another actuator. Raptor: the driver's activity.
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

/// Commands for a vehicle with New Eagle's Raptor: they carry a counter that shows that the sender lives.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Raptor {
    /// Steering wheel and road wheels.
    pub gear: SteeringGear,
}

impl Raptor {
    /// Steering by the angle of the steering wheel.
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

    /// Pedals by travel: accelerator and brake.
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

/// The speed of Raptor's report, which is in km/h, m/s.
pub fn raptor_speed_from_ros(report: &raptor_dbw_msgs::MiscReport) -> f64 {
    f64::from(report.vehicle_speed) / 3.6
}
