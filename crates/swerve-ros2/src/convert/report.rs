//! Reports of a simulated vehicle.

use swerve_msg::{Command, EgoState, WheelOdometry};

use super::{Epoch, SteeringGear, carla_control, steering_to_ros, velocity_to_ros};
use crate::msg::autoware_vehicle_msgs::{
    ControlModeReport, GearReport, HazardLightsReport, TurnIndicatorsReport,
};
use crate::msg::{carla_msgs, ds_dbw_msgs as ds, geometry_msgs as geo, raptor_dbw_msgs as raptor, std_msgs};
use crate::{AnyMessage, Kind};

/// Autoware's value for turn indicators and hazard lights that are off.
const LIGHTS_OFF: u8 = 1;
/// Value of the forward gear in Dataspeed's and Raptor's messages.
const GEAR_DRIVE: u8 = 4;

/// State of a vehicle for its reports.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct VehicleState {
    /// Speed, yaw rate, steering angle and wheels, with their stamp.
    pub wheels: WheelOdometry,
    /// Present pedal positions.
    pub pedals: Command,
    /// True if the vehicle follows commands; otherwise its driver drives.
    pub is_engaged: bool,
}

/// Acceleration of the ego in `base_link`, as reported by Autoware's localization.
pub fn accel_to_ros(ego: &EgoState, epoch: Epoch, base_link: &str) -> geo::AccelWithCovarianceStamped {
    let mut message = geo::AccelWithCovarianceStamped {
        header: epoch.header(ego.stamp, base_link),
        ..geo::AccelWithCovarianceStamped::default()
    };
    message.accel.accel.linear = geo::Vector3 { x: ego.accel_mps2, y: ego.lateral_accel_mps2, z: 0.0 };
    message
}

/// Builds the vehicle's report of this kind; `None` if the kind is not a report.
pub fn report_to_ros(
    kind: Kind,
    state: &VehicleState,
    gear: &SteeringGear,
    epoch: Epoch,
    base_link: &str,
) -> Option<AnyMessage> {
    let VehicleState { wheels, is_engaged, .. } = state;
    let stamp = epoch.stamp(wheels.stamp);
    let header = || epoch.header(wheels.stamp, base_link);
    let [front_left, front_right, rear_left, rear_right] = wheels.wheel_speeds_radps.map(|w| w as f32);
    let mode = if *is_engaged { ControlModeReport::AUTONOMOUS } else { ControlModeReport::MANUAL };
    let twist = geo::Twist {
        linear: geo::Vector3 { x: wheels.speed_mps, y: 0.0, z: 0.0 },
        angular: geo::Vector3 { x: 0.0, y: 0.0, z: wheels.yaw_rate_radps },
    };
    let report = LIGHTS_OFF;
    Some(match kind {
        Kind::VelocityReport => AnyMessage::VelocityReport(velocity_to_ros(wheels, epoch, base_link)),
        Kind::TwistStamped => AnyMessage::TwistStamped(geo::TwistStamped { header: header(), twist }),
        Kind::TwistWithCovarianceStamped => {
            let twist = geo::TwistWithCovariance { twist, ..geo::TwistWithCovariance::default() };
            AnyMessage::TwistWithCovarianceStamped(geo::TwistWithCovarianceStamped {
                header: header(),
                twist,
            })
        }
        Kind::SteeringReport => AnyMessage::SteeringReport(steering_to_ros(wheels, epoch)),
        Kind::ControlModeReport => AnyMessage::ControlModeReport(ControlModeReport { stamp, mode }),
        Kind::GearReport => AnyMessage::GearReport(GearReport { stamp, report: GearReport::DRIVE }),
        Kind::TurnIndicatorsReport => {
            AnyMessage::TurnIndicatorsReport(TurnIndicatorsReport { stamp, report })
        }
        Kind::HazardLightsReport => AnyMessage::HazardLightsReport(HazardLightsReport { stamp, report }),
        Kind::Bool => AnyMessage::Bool(std_msgs::Bool { data: *is_engaged }),
        Kind::DataspeedVehicleVelocity => {
            let speed = wheels.speed_mps as f32;
            AnyMessage::DataspeedVehicleVelocity(ds::VehicleVelocity {
                header: header(),
                vehicle_velocity_brake: speed,
                vehicle_velocity_propulsion: speed,
                dir_src: 1,
            })
        }
        Kind::DataspeedWheelSpeeds => AnyMessage::DataspeedWheelSpeeds(ds::WheelSpeeds {
            header: header(),
            front_left,
            front_right,
            rear_left,
            rear_right,
        }),
        Kind::RaptorWheelSpeedReport => AnyMessage::RaptorWheelSpeedReport(raptor::WheelSpeedReport {
            header: header(),
            front_left,
            front_right,
            rear_left,
            rear_right,
        }),
        other => return by_wire(other, state, gear, epoch),
    })
}

/// Builds reports of steering, pedals and gear of a drive-by-wire vehicle.
fn by_wire(kind: Kind, state: &VehicleState, gear: &SteeringGear, epoch: Epoch) -> Option<AnyMessage> {
    let VehicleState { wheels, pedals, is_engaged } = *state;
    let header = epoch.header(wheels.stamp, "");
    let wheel_deg = gear.wheel_deg(wheels.steering_rad) as f32;
    let [throttle, brake] = [pedals.throttle, pedals.brake].map(|pedal| 100.0 * pedal as f32);
    let (ready, enabled) = (true, is_engaged);
    Some(match kind {
        Kind::DataspeedSteeringReport => AnyMessage::DataspeedSteeringReport(ds::SteeringReport {
            header,
            steering_wheel_angle: wheel_deg,
            steering_column_torque: f32::NAN,
            ready,
            enabled,
            ..ds::SteeringReport::default()
        }),
        Kind::DataspeedBrakeReport => AnyMessage::DataspeedBrakeReport(ds::BrakeReport {
            header,
            percent_output: brake,
            ready,
            enabled,
            ..ds::BrakeReport::default()
        }),
        Kind::DataspeedThrottleReport => AnyMessage::DataspeedThrottleReport(ds::ThrottleReport {
            header,
            percent_output: throttle,
            ready,
            enabled,
            ..ds::ThrottleReport::default()
        }),
        Kind::DataspeedUlcReport => AnyMessage::DataspeedUlcReport(ds::UlcReport {
            header,
            vel_meas: wheels.speed_mps as f32,
            ready,
            enabled,
            ..ds::UlcReport::default()
        }),
        Kind::DataspeedGearReport => AnyMessage::DataspeedGearReport(ds::GearReport {
            header,
            gear: ds::Gear { value: GEAR_DRIVE },
            ready,
            ..ds::GearReport::default()
        }),
        Kind::RaptorSteeringReport => AnyMessage::RaptorSteeringReport(raptor::SteeringReport {
            header,
            steering_wheel_angle: wheel_deg,
            enabled,
            ..raptor::SteeringReport::default()
        }),
        Kind::RaptorBrakeReport => AnyMessage::RaptorBrakeReport(raptor::BrakeReport {
            header,
            pedal_output: brake,
            enabled,
            ..raptor::BrakeReport::default()
        }),
        Kind::RaptorAcceleratorPedalReport => {
            AnyMessage::RaptorAcceleratorPedalReport(raptor::AcceleratorPedalReport {
                header,
                pedal_output: throttle,
                enabled,
                ..raptor::AcceleratorPedalReport::default()
            })
        }
        Kind::RaptorMiscReport => AnyMessage::RaptorMiscReport(raptor::MiscReport {
            header,
            drive_by_wire_enabled: enabled,
            vehicle_speed: 3.6 * wheels.speed_mps as f32,
            by_wire_ready: ready,
            ..raptor::MiscReport::default()
        }),
        Kind::CarlaEgoVehicleStatus => AnyMessage::CarlaEgoVehicleStatus(carla_status(state, gear, epoch)),
        _ => return None,
    })
}

/// Builds the status that CARLA's bridge publishes, without acceleration and orientation.
fn carla_status(
    VehicleState { wheels, pedals, .. }: &VehicleState,
    gear: &SteeringGear,
    epoch: Epoch,
) -> carla_msgs::CarlaEgoVehicleStatus {
    let command = Command { steering_rad: wheels.steering_rad, ..*pedals };
    carla_msgs::CarlaEgoVehicleStatus {
        header: epoch.header(wheels.stamp, ""),
        velocity: wheels.speed_mps.abs() as f32,
        orientation: geo::Quaternion { w: 1.0, ..geo::Quaternion::default() },
        control: carla_control(&command, gear, wheels.stamp, epoch, ""),
        ..carla_msgs::CarlaEgoVehicleStatus::default()
    }
}

/// Returns true if the simulated car accepts a request for this control mode.
pub fn is_mode_taken(mode: u8) -> bool {
    [ControlModeReport::AUTONOMOUS, ControlModeReport::MANUAL].contains(&mode)
}
