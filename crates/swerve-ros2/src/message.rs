//! Every message that the bridge knows, behind one type.

use core::fmt;

use serde::de::DeserializeSeed;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::check::{Check, Invalid, check_numbers};
use crate::msg::*;

/// A message with a ROS type name.
pub trait RosMessage:
    Check + Serialize + for<'de> Deserialize<'de> + Clone + PartialEq + fmt::Debug + Default
{
    /// Which it is.
    const KIND: Kind;

    /// The message in the type of all.
    fn into_any(self) -> AnyMessage;

    /// The message, if it is of this type.
    fn from_any(any: AnyMessage) -> Option<Self>;
}

macro_rules! messages {
    (@nan) => { &[] };
    (@nan $nan:expr) => { $nan };
    ($($variant:ident = $package:ident :: $name:ident $(, may_be_nan $nan:expr)?;)*) => {
        /// Which message: its ROS package and name.
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
        pub enum Kind { $(#[doc = concat!("`", stringify!($package), "/", stringify!($name), "`.")] $variant,)* }

        /// A message of any kind.
        #[derive(Clone, PartialEq, Debug)]
        #[expect(clippy::large_enum_variant, reason = "messages are moved through one queue, not kept in arrays")]
        pub enum AnyMessage { $(#[doc = concat!("`", stringify!($package), "/", stringify!($name), "`.")] $variant($package::$name),)* }

        impl Kind {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// The ROS package.
            pub fn package(self) -> &'static str {
                match self { $(Self::$variant => stringify!($package),)* }
            }

            /// The name within the package.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => stringify!($name),)* }
            }

            /// A message of this kind with nothing in it.
            pub fn empty(self) -> AnyMessage {
                match self { $(Self::$variant => AnyMessage::$variant(Default::default()),)* }
            }
        }

        impl AnyMessage {
            /// Which it is.
            pub fn kind(&self) -> Kind {
                match self { $(Self::$variant(_) => Kind::$variant,)* }
            }

            /// Whether a reader may rely on its numbers, sizes and names.
            ///
            /// # Errors
            /// The first field that is not as it has to be.
            pub fn check(&self) -> Result<(), Invalid> {
                match self { $(Self::$variant(message) => {
                    check_numbers(message, messages!(@nan $($nan)?))?;
                    message.check()
                })* }
            }
        }

        impl Serialize for AnyMessage {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                match self { $(Self::$variant(message) => message.serialize(serializer),)* }
            }
        }

        impl<'de> DeserializeSeed<'de> for Kind {
            type Value = AnyMessage;
            fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<AnyMessage, D::Error> {
                match self { $(Self::$variant =>
                    Deserialize::deserialize(deserializer).map(AnyMessage::$variant),)* }
            }
        }

        $(impl RosMessage for $package::$name {
            const KIND: Kind = Kind::$variant;
            fn into_any(self) -> AnyMessage { AnyMessage::$variant(self) }
            fn from_any(any: AnyMessage) -> Option<Self> {
                match any { AnyMessage::$variant(message) => Some(message), _ => None }
            }
        })*
    };
}

/// What Dataspeed's vehicles leave out is not-a-number.
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

messages! {
    Image = sensor_msgs::Image;
    CompressedImage = sensor_msgs::CompressedImage;
    CameraInfo = sensor_msgs::CameraInfo;
    PointCloud2 = sensor_msgs::PointCloud2;
    Imu = sensor_msgs::Imu;
    NavSatFix = sensor_msgs::NavSatFix, may_be_nan &["altitude"];
    Odometry = nav_msgs::Odometry;
    Path = nav_msgs::Path;
    PoseStamped = geometry_msgs::PoseStamped;
    PoseWithCovarianceStamped = geometry_msgs::PoseWithCovarianceStamped;
    TwistStamped = geometry_msgs::TwistStamped;
    TwistWithCovarianceStamped = geometry_msgs::TwistWithCovarianceStamped;
    AccelWithCovarianceStamped = geometry_msgs::AccelWithCovarianceStamped;
    TransformStamped = geometry_msgs::TransformStamped;
    Tf = tf2_msgs::TFMessage;
    Clock = rosgraph_msgs::Clock;
    MarkerArray = visualization_msgs::MarkerArray;
    Bool = std_msgs::Bool;
    Empty = std_msgs::Empty;
    Control = autoware_control_msgs::Control;
    VelocityReport = autoware_vehicle_msgs::VelocityReport;
    SteeringReport = autoware_vehicle_msgs::SteeringReport;
    ControlModeReport = autoware_vehicle_msgs::ControlModeReport;
    GearCommand = autoware_vehicle_msgs::GearCommand;
    GearReport = autoware_vehicle_msgs::GearReport;
    TurnIndicatorsCommand = autoware_vehicle_msgs::TurnIndicatorsCommand;
    TurnIndicatorsReport = autoware_vehicle_msgs::TurnIndicatorsReport;
    HazardLightsCommand = autoware_vehicle_msgs::HazardLightsCommand;
    HazardLightsReport = autoware_vehicle_msgs::HazardLightsReport;
    Engage = autoware_vehicle_msgs::Engage;
    Trajectory = autoware_planning_msgs::Trajectory;
    PredictedObjects = autoware_perception_msgs::PredictedObjects;
    DataspeedSteeringCmd = ds_dbw_msgs::SteeringCmd;
    DataspeedBrakeCmd = ds_dbw_msgs::BrakeCmd;
    DataspeedThrottleCmd = ds_dbw_msgs::ThrottleCmd;
    DataspeedUlcCmd = ds_dbw_msgs::UlcCmd;
    DataspeedGearCmd = ds_dbw_msgs::GearCmd;
    DataspeedSteeringReport = ds_dbw_msgs::SteeringReport, may_be_nan NOT_MEASURED;
    DataspeedBrakeReport = ds_dbw_msgs::BrakeReport, may_be_nan NOT_MEASURED;
    DataspeedThrottleReport = ds_dbw_msgs::ThrottleReport, may_be_nan NOT_MEASURED;
    DataspeedUlcReport = ds_dbw_msgs::UlcReport, may_be_nan NOT_MEASURED;
    DataspeedGearReport = ds_dbw_msgs::GearReport;
    DataspeedVehicleVelocity = ds_dbw_msgs::VehicleVelocity, may_be_nan NOT_MEASURED;
    DataspeedWheelSpeeds = ds_dbw_msgs::WheelSpeeds, may_be_nan NOT_MEASURED;
    RaptorAcceleratorPedalCmd = raptor_dbw_msgs::AcceleratorPedalCmd;
    RaptorBrakeCmd = raptor_dbw_msgs::BrakeCmd;
    RaptorSteeringCmd = raptor_dbw_msgs::SteeringCmd;
    RaptorGearCmd = raptor_dbw_msgs::GearCmd;
    RaptorGlobalEnableCmd = raptor_dbw_msgs::GlobalEnableCmd;
    RaptorSteeringReport = raptor_dbw_msgs::SteeringReport;
    RaptorAcceleratorPedalReport = raptor_dbw_msgs::AcceleratorPedalReport;
    RaptorBrakeReport = raptor_dbw_msgs::BrakeReport;
    RaptorMiscReport = raptor_dbw_msgs::MiscReport;
    RaptorWheelSpeedReport = raptor_dbw_msgs::WheelSpeedReport;
}

impl Kind {
    /// `package/msg/Name`, as ROS tools write it.
    pub fn type_name(self) -> String {
        format!("{}/msg/{}", self.package(), self.name())
    }

    /// `package::msg::dds_::Name_`, as it is on the wire.
    pub fn dds_type_name(self) -> String {
        format!("{}::msg::dds_::{}_", self.package(), self.name())
    }

    /// The kind of `package/msg/Name` or `package/Name`.
    pub fn parse(type_name: &str) -> Option<Self> {
        let (package, name) = type_name.split_once('/')?;
        let name = name.strip_prefix("msg/").unwrap_or(name);
        Self::ALL.iter().copied().find(|kind| kind.package() == package && kind.name() == name)
    }
}

impl AnyMessage {
    /// The instant that it describes, by its writer's clock; `None` where it says none or several.
    pub fn stamp(&self) -> Option<builtin_interfaces::Time> {
        Some(match self {
            Self::Image(m) => m.header.stamp,
            Self::CompressedImage(m) => m.header.stamp,
            Self::CameraInfo(m) => m.header.stamp,
            Self::PointCloud2(m) => m.header.stamp,
            Self::Imu(m) => m.header.stamp,
            Self::NavSatFix(m) => m.header.stamp,
            Self::Odometry(m) => m.header.stamp,
            Self::Path(m) => m.header.stamp,
            Self::PoseStamped(m) => m.header.stamp,
            Self::PoseWithCovarianceStamped(m) => m.header.stamp,
            Self::TwistStamped(m) => m.header.stamp,
            Self::TwistWithCovarianceStamped(m) => m.header.stamp,
            Self::AccelWithCovarianceStamped(m) => m.header.stamp,
            Self::Control(m) => m.stamp,
            Self::VelocityReport(m) => m.header.stamp,
            Self::SteeringReport(m) => m.stamp,
            Self::ControlModeReport(m) => m.stamp,
            Self::GearReport(m) => m.stamp,
            Self::Trajectory(m) => m.header.stamp,
            Self::PredictedObjects(m) => m.header.stamp,
            Self::DataspeedSteeringReport(m) => m.header.stamp,
            Self::DataspeedBrakeReport(m) => m.header.stamp,
            Self::DataspeedThrottleReport(m) => m.header.stamp,
            Self::DataspeedUlcReport(m) => m.header.stamp,
            Self::DataspeedGearReport(m) => m.header.stamp,
            Self::DataspeedVehicleVelocity(m) => m.header.stamp,
            Self::DataspeedWheelSpeeds(m) => m.header.stamp,
            Self::RaptorSteeringReport(m) => m.header.stamp,
            Self::RaptorAcceleratorPedalReport(m) => m.header.stamp,
            Self::RaptorBrakeReport(m) => m.header.stamp,
            Self::RaptorMiscReport(m) => m.header.stamp,
            Self::RaptorWheelSpeedReport(m) => m.header.stamp,
            _ => return None,
        })
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/msg/{}", self.package(), self.name())
    }
}
