//! Catalogue of all messages, roles and vehicles.
//!
//! Adding a topic takes three places: the fields and checks of its message in [`crate::msg`], its rows here, and
//! its use (the vehicle's interface, the intake or the simulated car). A message is a row of the first table, its
//! role a row of the second, and its ROS name a row of the vehicle's table.

use serde::de::DeserializeSeed;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::check::{Check, Invalid, check_numbers};
use crate::mapping::Qos;
use crate::mapping::role::{Description, Purpose, Side, roles};
use crate::mapping::tables::{Row, by_wire, row, vehicles};
use crate::message::{RosMessage, messages};
use crate::msg::*;

// Here = in ROS: where its stamp is (in a header, in a field of its own, or nowhere), and how large it is.
messages! {
    Image = sensor_msgs::Image: header, large;
    CompressedImage = sensor_msgs::CompressedImage: header, large;
    CameraInfo = sensor_msgs::CameraInfo: header, small;
    PointCloud2 = sensor_msgs::PointCloud2: header, large;
    Imu = sensor_msgs::Imu: header, small;
    NavSatFix = sensor_msgs::NavSatFix: header, small;
    Odometry = nav_msgs::Odometry: header, small;
    Path = nav_msgs::Path: header, small;
    PoseStamped = geometry_msgs::PoseStamped: header, small;
    PoseWithCovarianceStamped = geometry_msgs::PoseWithCovarianceStamped: header, small;
    TwistStamped = geometry_msgs::TwistStamped: header, small;
    TwistWithCovarianceStamped = geometry_msgs::TwistWithCovarianceStamped: header, small;
    AccelWithCovarianceStamped = geometry_msgs::AccelWithCovarianceStamped: header, small;
    TransformStamped = geometry_msgs::TransformStamped: header, small;
    Tf = tf2_msgs::TFMessage: none, small;
    Clock = rosgraph_msgs::Clock: none, small;
    MarkerArray = visualization_msgs::MarkerArray: none, small;
    Bool = std_msgs::Bool: none, small;
    Empty = std_msgs::Empty: none, small;
    Control = autoware_control_msgs::Control: own, small;
    VelocityReport = autoware_vehicle_msgs::VelocityReport: header, small;
    SteeringReport = autoware_vehicle_msgs::SteeringReport: own, small;
    ControlModeReport = autoware_vehicle_msgs::ControlModeReport: own, small;
    GearCommand = autoware_vehicle_msgs::GearCommand: own, small;
    GearReport = autoware_vehicle_msgs::GearReport: own, small;
    TurnIndicatorsCommand = autoware_vehicle_msgs::TurnIndicatorsCommand: own, small;
    TurnIndicatorsReport = autoware_vehicle_msgs::TurnIndicatorsReport: own, small;
    HazardLightsCommand = autoware_vehicle_msgs::HazardLightsCommand: own, small;
    HazardLightsReport = autoware_vehicle_msgs::HazardLightsReport: own, small;
    // Publishers at a terminal leave the stamp at zero.
    Engage = autoware_vehicle_msgs::Engage: none, small;
    Trajectory = autoware_planning_msgs::Trajectory: header, small;
    PredictedObjects = autoware_perception_msgs::PredictedObjects: header, small;
    DataspeedSteeringCmd = ds_dbw_msgs::SteeringCmd: header, small;
    DataspeedBrakeCmd = ds_dbw_msgs::BrakeCmd: header, small;
    DataspeedThrottleCmd = ds_dbw_msgs::ThrottleCmd: header, small;
    DataspeedUlcCmd = ds_dbw_msgs::UlcCmd: header, small;
    DataspeedGearCmd = ds_dbw_msgs::GearCmd: header, small;
    DataspeedSteeringReport = ds_dbw_msgs::SteeringReport: header, small;
    DataspeedBrakeReport = ds_dbw_msgs::BrakeReport: header, small;
    DataspeedThrottleReport = ds_dbw_msgs::ThrottleReport: header, small;
    DataspeedUlcReport = ds_dbw_msgs::UlcReport: header, small;
    DataspeedGearReport = ds_dbw_msgs::GearReport: header, small;
    DataspeedVehicleVelocity = ds_dbw_msgs::VehicleVelocity: header, small;
    DataspeedWheelSpeeds = ds_dbw_msgs::WheelSpeeds: header, small;
    RaptorAcceleratorPedalCmd = raptor_dbw_msgs::AcceleratorPedalCmd: none, small;
    RaptorBrakeCmd = raptor_dbw_msgs::BrakeCmd: none, small;
    RaptorSteeringCmd = raptor_dbw_msgs::SteeringCmd: none, small;
    RaptorGearCmd = raptor_dbw_msgs::GearCmd: none, small;
    RaptorGlobalEnableCmd = raptor_dbw_msgs::GlobalEnableCmd: none, small;
    RaptorSteeringReport = raptor_dbw_msgs::SteeringReport: header, small;
    RaptorAcceleratorPedalReport = raptor_dbw_msgs::AcceleratorPedalReport: header, small;
    RaptorBrakeReport = raptor_dbw_msgs::BrakeReport: header, small;
    RaptorMiscReport = raptor_dbw_msgs::MiscReport: header, small;
    RaptorWheelSpeedReport = raptor_dbw_msgs::WheelSpeedReport: header, small;
}

// Role = name in a table: publishing side, purpose, possible types (the first is the default), quality of service,
// and a rate limit of five times the usual rate, Hz.
roles! {
    // Images, raw and compressed, and camera calibration.
    Camera = "camera": Vehicle, Sensor, [Image], Qos::SENSOR, 200.0;
    CameraCompressed = "camera_compressed": Vehicle, Sensor, [CompressedImage], Qos::SENSOR, 200.0;
    CameraInfo = "camera_info": Vehicle, Sensor, [CameraInfo], Qos::SENSOR, 200.0;
    Lidar = "lidar": Vehicle, Sensor, [PointCloud2], Qos::SENSOR, 100.0;
    Imu = "imu": Vehicle, Sensor, [Imu], Qos::SENSOR, 2000.0;
    Gnss = "gnss": Vehicle, Sensor, [NavSatFix], Qos::SENSOR, 100.0;
    // State of the ego from localization.
    Odometry = "odometry": Vehicle, Localization, [Odometry, PoseStamped, PoseWithCovarianceStamped], Qos::DEFAULT, 500.0;
    Acceleration = "acceleration": Vehicle, Localization, [AccelWithCovarianceStamped], Qos::DEFAULT, 500.0;
    // Reports of the vehicle.
    Velocity = "velocity": Vehicle, Report, [VelocityReport, TwistStamped, TwistWithCovarianceStamped, DataspeedVehicleVelocity, DataspeedUlcReport], Qos::VEHICLE, 500.0;
    WheelSpeeds = "wheel_speeds": Vehicle, Report, [DataspeedWheelSpeeds, RaptorWheelSpeedReport], Qos::DEFAULT, 500.0;
    Steering = "steering": Vehicle, Report, [SteeringReport, DataspeedSteeringReport, RaptorSteeringReport], Qos::VEHICLE, 500.0;
    Brake = "brake": Vehicle, Report, [DataspeedBrakeReport, RaptorBrakeReport], Qos::DEFAULT, 500.0;
    Throttle = "throttle": Vehicle, Report, [DataspeedThrottleReport, RaptorAcceleratorPedalReport], Qos::DEFAULT, 500.0;
    ControlMode = "control_mode": Vehicle, Report, [ControlModeReport], Qos::VEHICLE, 500.0;
    Gear = "gear": Vehicle, Report, [GearReport, DataspeedGearReport], Qos::VEHICLE, 500.0;
    TurnIndicators = "turn_indicators": Vehicle, Report, [TurnIndicatorsReport], Qos::VEHICLE, 500.0;
    HazardLights = "hazard_lights": Vehicle, Report, [HazardLightsReport], Qos::VEHICLE, 500.0;
    Enabled = "enabled": Vehicle, Report, [Bool], Qos::LATCHED, 100.0;
    Emergency = "emergency": Vehicle, Switch, [Bool], Qos::DEFAULT, 500.0;
    Miscellaneous = "miscellaneous": Vehicle, Report, [RaptorMiscReport], Qos::DEFAULT, 500.0;
    // Simulated time and frames.
    Clock = "clock": Vehicle, Frames, [Clock], Qos::SENSOR, 5000.0;
    Tf = "tf": Vehicle, Frames, [Tf], Qos { depth: 100, ..Qos::DEFAULT }, 5000.0;
    TfStatic = "tf_static": Vehicle, Frames, [Tf], Qos::LATCHED, 100.0;
    // Other road users from external perception.
    Objects = "objects": Vehicle, Perception, [PredictedObjects], Qos::DEFAULT, 100.0;
    // Commands of the stack.
    Command = "command": Stack, Motion, [Control], Qos::VEHICLE, 500.0;
    SteeringCommand = "steering_command": Stack, Motion, [DataspeedSteeringCmd, RaptorSteeringCmd], Qos::VEHICLE, 500.0;
    BrakeCommand = "brake_command": Stack, Motion, [DataspeedBrakeCmd, RaptorBrakeCmd], Qos::VEHICLE, 500.0;
    ThrottleCommand = "throttle_command": Stack, Motion, [DataspeedThrottleCmd, RaptorAcceleratorPedalCmd], Qos::VEHICLE, 500.0;
    SpeedCommand = "speed_command": Stack, Motion, [DataspeedUlcCmd], Qos::VEHICLE, 500.0;
    GearCommand = "gear_command": Stack, Auxiliary, [GearCommand, DataspeedGearCmd, RaptorGearCmd], Qos::VEHICLE, 500.0;
    TurnIndicatorsCommand = "turn_indicators_command": Stack, Auxiliary, [TurnIndicatorsCommand], Qos::VEHICLE, 500.0;
    HazardLightsCommand = "hazard_lights_command": Stack, Auxiliary, [HazardLightsCommand], Qos::VEHICLE, 500.0;
    Enable = "enable": Stack, Switch, [Engage, Empty, RaptorGlobalEnableCmd], Qos::DEFAULT, 500.0;
    Disable = "disable": Stack, Switch, [Empty], Qos::DEFAULT, 500.0;
    // Visualisation of the stack.
    Trajectory = "trajectory": Stack, Display, [Trajectory], Qos::DEFAULT, 500.0;
    Path = "path": Stack, Display, [Path], Qos::DEFAULT, 500.0;
    Markers = "markers": Stack, Display, [MarkerArray], Qos::DEFAULT, 500.0;
}

/// Topics of all vehicles.
const COMMON: [Row; 6] = [
    row(Role::Clock, "/clock", ""),
    row(Role::Tf, "/tf", ""),
    row(Role::TfStatic, "/tf_static", ""),
    row(Role::Trajectory, "/planning/trajectory", "map"),
    row(Role::Path, "/swerve/path", "map"),
    row(Role::Markers, "/swerve/markers", "map"),
];

/// Autoware's names of sensors, localization and vehicle interface.
const AUTOWARE: [Row; 21] = [
    row(Role::Camera, "/sensing/camera/camera0/image_raw", "camera0/camera_optical_link"),
    row(
        Role::CameraCompressed,
        "/sensing/camera/camera0/image_raw/compressed",
        "camera0/camera_optical_link",
    ),
    row(Role::CameraInfo, "/sensing/camera/camera0/camera_info", "camera0/camera_optical_link"),
    row(Role::Lidar, "/sensing/lidar/top/pointcloud_raw", "lidar_top"),
    row(Role::Imu, "/sensing/imu/imu_raw", "imu_link"),
    row(Role::Gnss, "/sensing/gnss/nav_sat_fix", "gnss_link"),
    row(Role::Odometry, "/localization/kinematic_state", "map"),
    row(Role::Acceleration, "/localization/acceleration", "base_link"),
    row(Role::Objects, "/perception/object_recognition/objects", "map"),
    row(Role::Velocity, "/vehicle/status/velocity_status", "base_link"),
    row(Role::Steering, "/vehicle/status/steering_status", ""),
    row(Role::ControlMode, "/vehicle/status/control_mode", ""),
    row(Role::Gear, "/vehicle/status/gear_status", ""),
    row(Role::TurnIndicators, "/vehicle/status/turn_indicators_status", ""),
    row(Role::HazardLights, "/vehicle/status/hazard_lights_status", ""),
    row(Role::Command, "/control/command/control_cmd", ""),
    row(Role::GearCommand, "/control/command/gear_cmd", ""),
    row(Role::TurnIndicatorsCommand, "/control/command/turn_indicators_cmd", ""),
    row(Role::HazardLightsCommand, "/control/command/hazard_lights_cmd", ""),
    row(Role::Enable, "/autoware/engage", ""),
    row(Role::Disable, "/swerve/disable", ""),
];

/// Usual ROS names of sensors and localization.
const PLAIN: [Row; 8] = [
    row(Role::Camera, "/camera/image_raw", "camera_optical_frame"),
    row(Role::CameraCompressed, "/camera/image_raw/compressed", "camera_optical_frame"),
    row(Role::CameraInfo, "/camera/camera_info", "camera_optical_frame"),
    row(Role::Lidar, "/points", "lidar"),
    row(Role::Imu, "/imu/data", "imu_link"),
    row(Role::Gnss, "/fix", "gps"),
    row(Role::Odometry, "/odometry", "map"),
    row(Role::Objects, "/objects", "map"),
];

/// Dataspeed's drive-by-wire.
const DATASPEED: [Row; 14] = [
    by_wire(Role::Velocity, "/vehicle/vehicle_velocity", Kind::DataspeedVehicleVelocity),
    by_wire(Role::WheelSpeeds, "/vehicle/wheel_speeds", Kind::DataspeedWheelSpeeds),
    by_wire(Role::Steering, "/vehicle/steering/report", Kind::DataspeedSteeringReport),
    by_wire(Role::Brake, "/vehicle/brake/report", Kind::DataspeedBrakeReport),
    by_wire(Role::Throttle, "/vehicle/throttle/report", Kind::DataspeedThrottleReport),
    by_wire(Role::Gear, "/vehicle/gear/report", Kind::DataspeedGearReport),
    by_wire(Role::Enabled, "/vehicle/dbw_enabled", Kind::Bool),
    by_wire(Role::SteeringCommand, "/vehicle/steering/cmd", Kind::DataspeedSteeringCmd),
    by_wire(Role::BrakeCommand, "/vehicle/brake/cmd", Kind::DataspeedBrakeCmd),
    by_wire(Role::ThrottleCommand, "/vehicle/throttle/cmd", Kind::DataspeedThrottleCmd),
    by_wire(Role::SpeedCommand, "/vehicle/ulc/cmd", Kind::DataspeedUlcCmd),
    by_wire(Role::GearCommand, "/vehicle/gear/cmd", Kind::DataspeedGearCmd),
    by_wire(Role::Enable, "/vehicle/enable", Kind::Empty),
    by_wire(Role::Disable, "/vehicle/disable", Kind::Empty),
];

/// New Eagle's Raptor.
const RAPTOR: [Row; 12] = [
    by_wire(Role::WheelSpeeds, "/raptor_dbw_interface/wheel_speed_report", Kind::RaptorWheelSpeedReport),
    by_wire(Role::Steering, "/raptor_dbw_interface/steering_report", Kind::RaptorSteeringReport),
    by_wire(Role::Brake, "/raptor_dbw_interface/brake_report", Kind::RaptorBrakeReport),
    by_wire(
        Role::Throttle,
        "/raptor_dbw_interface/accelerator_pedal_report",
        Kind::RaptorAcceleratorPedalReport,
    ),
    by_wire(Role::Miscellaneous, "/raptor_dbw_interface/misc_report", Kind::RaptorMiscReport),
    by_wire(Role::Enabled, "/raptor_dbw_interface/dbw_enabled", Kind::Bool),
    by_wire(Role::SteeringCommand, "/raptor_dbw_interface/steering_cmd", Kind::RaptorSteeringCmd),
    by_wire(Role::BrakeCommand, "/raptor_dbw_interface/brake_cmd", Kind::RaptorBrakeCmd),
    by_wire(
        Role::ThrottleCommand,
        "/raptor_dbw_interface/accelerator_pedal_cmd",
        Kind::RaptorAcceleratorPedalCmd,
    ),
    by_wire(Role::GearCommand, "/raptor_dbw_interface/gear_cmd", Kind::RaptorGearCmd),
    by_wire(Role::Enable, "/raptor_dbw_interface/global_enable_cmd", Kind::RaptorGlobalEnableCmd),
    by_wire(Role::Disable, "/raptor_dbw_interface/disable", Kind::Empty),
];

vehicles! {
    /// Autoware's vehicle interface.
    #[default]
    Autoware = "autoware": [COMMON, AUTOWARE];
    /// Dataspeed's drive-by-wire.
    Dataspeed = "dataspeed": [COMMON, PLAIN, DATASPEED];
    /// New Eagle's Raptor.
    Raptor = "raptor": [COMMON, PLAIN, RAPTOR];
    /// No drive-by-wire: sensors and localization under the usual ROS names.
    Plain = "plain": [COMMON, PLAIN];
}

#[cfg(test)]
mod tests;
