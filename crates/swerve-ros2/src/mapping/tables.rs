//! Topic names of known vehicles.

use super::{Qos, Role, TopicMap};
use crate::message::Kind;

/// A vehicle whose topics are known.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Vehicle {
    /// Autoware's vehicle interface.
    #[default]
    Autoware,
    /// Drive-by-wire of Dataspeed.
    Dataspeed,
    /// Raptor of New Eagle.
    Raptor,
    /// No drive-by-wire: sensors and localization as most ROS robots have them.
    Plain,
}

impl Vehicle {
    pub(super) const NAMES: [(&str, Self); 4] = [
        ("autoware", Self::Autoware),
        ("dataspeed", Self::Dataspeed),
        ("raptor", Self::Raptor),
        ("plain", Self::Plain),
    ];

    /// As it is written in a table.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize].0
    }
}

type Row = (Role, &'static str, &'static str);

/// What all have: role, topic, frame.
const COMMON: [Row; 6] = [
    (Role::Clock, "/clock", ""),
    (Role::Tf, "/tf", ""),
    (Role::TfStatic, "/tf_static", ""),
    (Role::Trajectory, "/planning/trajectory", "map"),
    (Role::Path, "/swerve/path", "map"),
    (Role::Markers, "/swerve/markers", "map"),
];

/// Sensors and localization as Autoware names them.
const AUTOWARE: [Row; 21] = [
    (Role::Camera, "/sensing/camera/camera0/image_raw", "camera0/camera_optical_link"),
    (Role::CameraCompressed, "/sensing/camera/camera0/image_raw/compressed", "camera0/camera_optical_link"),
    (Role::CameraInfo, "/sensing/camera/camera0/camera_info", "camera0/camera_optical_link"),
    (Role::Lidar, "/sensing/lidar/top/pointcloud_raw", "lidar_top"),
    (Role::Imu, "/sensing/imu/imu_raw", "imu_link"),
    (Role::Gnss, "/sensing/gnss/nav_sat_fix", "gnss_link"),
    (Role::Odometry, "/localization/kinematic_state", "map"),
    (Role::Acceleration, "/localization/acceleration", "base_link"),
    (Role::Objects, "/perception/object_recognition/objects", "map"),
    (Role::Velocity, "/vehicle/status/velocity_status", "base_link"),
    (Role::Steering, "/vehicle/status/steering_status", ""),
    (Role::ControlMode, "/vehicle/status/control_mode", ""),
    (Role::Gear, "/vehicle/status/gear_status", ""),
    (Role::TurnIndicators, "/vehicle/status/turn_indicators_status", ""),
    (Role::HazardLights, "/vehicle/status/hazard_lights_status", ""),
    (Role::Command, "/control/command/control_cmd", ""),
    (Role::GearCommand, "/control/command/gear_cmd", ""),
    (Role::TurnIndicatorsCommand, "/control/command/turn_indicators_cmd", ""),
    (Role::HazardLightsCommand, "/control/command/hazard_lights_cmd", ""),
    (Role::Enable, "/autoware/engage", ""),
    (Role::Disable, "/swerve/disable", ""),
];

/// Sensors and localization as most ROS robots name them.
const PLAIN: [Row; 8] = [
    (Role::Camera, "/camera/image_raw", "camera_optical_frame"),
    (Role::CameraCompressed, "/camera/image_raw/compressed", "camera_optical_frame"),
    (Role::CameraInfo, "/camera/camera_info", "camera_optical_frame"),
    (Role::Lidar, "/points", "lidar"),
    (Role::Imu, "/imu/data", "imu_link"),
    (Role::Gnss, "/fix", "gps"),
    (Role::Odometry, "/odometry", "map"),
    (Role::Objects, "/objects", "map"),
];

/// Drive-by-wire of Dataspeed: role, topic, type.
const DATASPEED: [(Role, &str, Kind); 14] = [
    (Role::Velocity, "/vehicle/vehicle_velocity", Kind::DataspeedVehicleVelocity),
    (Role::WheelSpeeds, "/vehicle/wheel_speeds", Kind::DataspeedWheelSpeeds),
    (Role::Steering, "/vehicle/steering/report", Kind::DataspeedSteeringReport),
    (Role::Brake, "/vehicle/brake/report", Kind::DataspeedBrakeReport),
    (Role::Throttle, "/vehicle/throttle/report", Kind::DataspeedThrottleReport),
    (Role::Gear, "/vehicle/gear/report", Kind::DataspeedGearReport),
    (Role::Enabled, "/vehicle/dbw_enabled", Kind::Bool),
    (Role::SteeringCommand, "/vehicle/steering/cmd", Kind::DataspeedSteeringCmd),
    (Role::BrakeCommand, "/vehicle/brake/cmd", Kind::DataspeedBrakeCmd),
    (Role::ThrottleCommand, "/vehicle/throttle/cmd", Kind::DataspeedThrottleCmd),
    (Role::SpeedCommand, "/vehicle/ulc/cmd", Kind::DataspeedUlcCmd),
    (Role::GearCommand, "/vehicle/gear/cmd", Kind::DataspeedGearCmd),
    (Role::Enable, "/vehicle/enable", Kind::Empty),
    (Role::Disable, "/vehicle/disable", Kind::Empty),
];

/// Raptor of New Eagle: role, topic, type.
const RAPTOR: [(Role, &str, Kind); 12] = [
    (Role::WheelSpeeds, "/raptor_dbw_interface/wheel_speed_report", Kind::RaptorWheelSpeedReport),
    (Role::Steering, "/raptor_dbw_interface/steering_report", Kind::RaptorSteeringReport),
    (Role::Brake, "/raptor_dbw_interface/brake_report", Kind::RaptorBrakeReport),
    (Role::Throttle, "/raptor_dbw_interface/accelerator_pedal_report", Kind::RaptorAcceleratorPedalReport),
    (Role::Miscellaneous, "/raptor_dbw_interface/misc_report", Kind::RaptorMiscReport),
    (Role::Enabled, "/raptor_dbw_interface/dbw_enabled", Kind::Bool),
    (Role::SteeringCommand, "/raptor_dbw_interface/steering_cmd", Kind::RaptorSteeringCmd),
    (Role::BrakeCommand, "/raptor_dbw_interface/brake_cmd", Kind::RaptorBrakeCmd),
    (Role::ThrottleCommand, "/raptor_dbw_interface/accelerator_pedal_cmd", Kind::RaptorAcceleratorPedalCmd),
    (Role::GearCommand, "/raptor_dbw_interface/gear_cmd", Kind::RaptorGearCmd),
    (Role::Enable, "/raptor_dbw_interface/global_enable_cmd", Kind::RaptorGlobalEnableCmd),
    (Role::Disable, "/raptor_dbw_interface/disable", Kind::Empty),
];

fn row((role, topic, frame): Row) -> TopicMap {
    TopicMap {
        name: role.name().to_owned(),
        role,
        topic: topic.to_owned(),
        kind: role.kinds()[0],
        qos: role.qos(),
        frame: frame.to_owned(),
        rate_max_hz: role.rate_max_hz(),
    }
}

/// The topics of a vehicle, by name.
pub(super) fn topics(vehicle: Vehicle) -> Vec<TopicMap> {
    let by_wire = |(role, topic, kind): (Role, &'static str, Kind)| {
        // The interfaces of both makers publish and subscribe with a queue of two or more, volatile.
        let qos = if role == Role::Enabled { Qos::LATCHED } else { Qos { depth: 2, ..Qos::DEFAULT } };
        TopicMap { kind, qos, ..row((role, topic, "")) }
    };
    let mut topics: Vec<TopicMap> = COMMON.into_iter().map(row).collect();
    match vehicle {
        Vehicle::Autoware => topics.extend(AUTOWARE.into_iter().map(row)),
        Vehicle::Plain => topics.extend(PLAIN.into_iter().map(row)),
        Vehicle::Dataspeed => {
            topics.extend(PLAIN.into_iter().map(row));
            topics.extend(DATASPEED.into_iter().map(by_wire));
        }
        Vehicle::Raptor => {
            topics.extend(PLAIN.into_iter().map(row));
            topics.extend(RAPTOR.into_iter().map(by_wire));
        }
    }
    topics.sort_by(|a, b| a.name.cmp(&b.name));
    topics
}
