//! The table of all known vehicles, and their topics.

use super::qos::Qos;
use super::role::Role;
use crate::message::Kind;

/// A topic of a vehicle.
#[derive(Clone, Copy)]
struct Row {
    role: Role,
    topic: &'static str,
    frame: &'static str,
    /// Type for drive-by-wire topics; otherwise the default type of the role.
    by_wire: Option<Kind>,
}

/// A topic with the default type of its role; `frame` is empty if its messages have none.
const fn row(role: Role, topic: &'static str, frame: &'static str) -> Row {
    Row { role, topic, frame, by_wire: None }
}

/// A topic of a drive-by-wire interface with a vendor-specific type.
const fn by_wire(role: Role, topic: &'static str, kind: Kind) -> Row {
    Row { role, topic, frame: "", by_wire: Some(kind) }
}

/// Generates `Vehicle` from a table of vehicles and the tables of their topics.
macro_rules! vehicles {
    (@one $vehicle:ident) => { () };
    ($($(#[$attribute:meta])* $vehicle:ident = $name:literal: [$($table:ident),+];)*) => {
        /// A vehicle with known topics.
        #[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
        pub enum Vehicle { $($(#[$attribute])* $vehicle,)* }

        impl Vehicle {
            pub(crate) const NAMES: [(&str, Self); [$(vehicles!(@one $vehicle)),*].len()] =
                [$(($name, Self::$vehicle),)*];

            /// Name in configurations.
            pub fn name(self) -> &'static str {
                match self { $(Self::$vehicle => $name,)* }
            }

            fn tables(self) -> &'static [&'static [Row]] {
                match self { $(Self::$vehicle => &[$(&$table),+],)* }
            }
        }
    };
}

/// Topics of all vehicles.
const COMMON: [Row; 7] = [
    row(Role::Clock, "/clock", ""),
    row(Role::Tf, "/tf", ""),
    row(Role::TfStatic, "/tf_static", ""),
    row(Role::Trajectory, "/planning/trajectory", "map"),
    row(Role::Path, "/swerve/path", "map"),
    row(Role::Markers, "/swerve/markers", "map"),
    row(Role::Lanes, "/swerve/lanes", "map"),
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

/// Topics of `carla_ros_bridge` for the vehicle with the role name `hero`, and a switch, which CARLA does not have.
const CARLA: [Row; 11] = [
    row(Role::Camera, "/carla/hero/rgb_front/image", "hero/rgb_front"),
    row(Role::CameraInfo, "/carla/hero/rgb_front/camera_info", "hero/rgb_front"),
    row(Role::Lidar, "/carla/hero/lidar", "hero/lidar"),
    row(Role::Imu, "/carla/hero/imu", "hero/imu"),
    row(Role::Gnss, "/carla/hero/gnss", "hero/gnss"),
    row(Role::Odometry, "/carla/hero/odometry", "map"),
    row(Role::Objects, "/carla/hero/predicted_objects", "map"),
    by_wire(Role::Velocity, "/carla/hero/vehicle_status", Kind::CarlaEgoVehicleStatus),
    by_wire(Role::Command, "/carla/hero/vehicle_control_cmd", Kind::CarlaEgoVehicleControl),
    by_wire(Role::Enable, "/swerve/enable", Kind::Empty),
    by_wire(Role::Disable, "/swerve/disable", Kind::Empty),
];

vehicles! {
    /// Autoware's vehicle interface.
    #[default]
    Autoware = "autoware": [COMMON, AUTOWARE];
    /// Dataspeed's drive-by-wire.
    Dataspeed = "dataspeed": [COMMON, PLAIN, DATASPEED];
    /// New Eagle's Raptor.
    Raptor = "raptor": [COMMON, PLAIN, RAPTOR];
    /// A vehicle in the simulator CARLA, over `carla_ros_bridge`.
    Carla = "carla": [COMMON, CARLA];
    /// No drive-by-wire: sensors and localization under the usual ROS names.
    Plain = "plain": [COMMON, PLAIN];
}

impl Row {
    fn topic(self) -> TopicMap {
        let Self { role, topic, frame, by_wire } = self;
        let qos = match by_wire {
            None => role.qos(),
            Some(_) if role == Role::Enabled => Qos::LATCHED,
            // Both vendors' interfaces publish and subscribe with a queue of two or more, volatile.
            Some(_) => Qos { depth: 2, ..Qos::DEFAULT },
        };
        TopicMap {
            name: role.name().to_owned(),
            role,
            topic: topic.to_owned(),
            kind: by_wire.unwrap_or(role.kinds()[0]),
            qos,
            frame: frame.to_owned(),
            rate_max_hz: role.rate_max_hz(),
        }
    }
}

/// Topics of a vehicle, ordered by name.
pub(super) fn topics(vehicle: Vehicle) -> Vec<TopicMap> {
    let rows = vehicle.tables().iter().flat_map(|table| table.iter());
    let mut topics: Vec<TopicMap> = rows.map(|row| row.topic()).collect();
    topics.sort_by(|a, b| a.name.cmp(&b.name));
    topics
}

/// Mapping of one topic.
#[derive(Clone, PartialEq, Debug)]
pub struct TopicMap {
    /// Name in the mapping.
    pub name: String,
    /// Role of the topic.
    pub role: Role,
    /// ROS name.
    pub topic: String,
    /// The type of its messages.
    pub kind: Kind,
    /// Quality of service.
    pub qos: Qos,
    /// Frame of the messages; empty if they have none or any is accepted.
    pub frame: String,
    /// Rate limit, Hz; `None` for no limit.
    pub rate_max_hz: Option<f64>,
}
