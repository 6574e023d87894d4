//! The table of all messages, and one type for all of them.

use core::fmt;

use serde::de::DeserializeSeed;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::check::{Check, Invalid, check_numbers};
use crate::msg::*;

/// A message with a ROS type name.
pub trait RosMessage:
    Check + Serialize + for<'de> Deserialize<'de> + Clone + PartialEq + fmt::Debug + Default
{
    /// Kind of the message.
    const KIND: Kind;

    /// Wraps the message.
    fn into_any(self) -> AnyMessage;

    /// Unwraps the message if it is of this type.
    fn from_any(any: AnyMessage) -> Option<Self>;
}

/// Generates `Kind` and `AnyMessage` from a table of messages. A row contains everything about a message except its
/// fields; no part is optional.
macro_rules! messages {
    (@stamp $message:ident header) => { Some($message.header.stamp) };
    (@stamp $message:ident own) => { Some($message.stamp) };
    (@stamp $message:ident none) => {{ let _none = $message; None }};
    (@large small) => { false };
    (@large large) => { true };
    ($($variant:ident = $package:ident :: $name:ident : $stamp:ident, $size:ident;)*) => {
        /// Type of a message: its ROS package and name.
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
        pub enum Kind { $(#[doc = concat!("`", stringify!($package), "/", stringify!($name), "`.")] $variant,)* }

        /// A message of any kind.
        #[derive(Clone, PartialEq, Debug)]
        #[expect(clippy::large_enum_variant, reason = "messages are moved through one queue, not kept in arrays")]
        pub enum AnyMessage { $(#[doc = concat!("`", stringify!($package), "/", stringify!($name), "`.")] $variant($package::$name),)* }

        impl Kind {
            /// All kinds.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// ROS package.
            pub fn package(self) -> &'static str {
                match self { $(Self::$variant => stringify!($package),)* }
            }

            /// Name within the package.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => stringify!($name),)* }
            }

            /// Returns true if its messages need many datagrams.
            pub fn is_large(self) -> bool {
                match self { $(Self::$variant => messages!(@large $size),)* }
            }

            /// An empty message of this kind.
            pub fn empty(self) -> AnyMessage {
                match self { $(Self::$variant => AnyMessage::$variant(Default::default()),)* }
            }
        }

        impl AnyMessage {
            /// Kind of the message.
            pub fn kind(&self) -> Kind {
                match self { $(Self::$variant(_) => Kind::$variant,)* }
            }

            /// Stamp, by its writer's clock; `None` if it has none or several.
            pub fn stamp(&self) -> Option<builtin_interfaces::Time> {
                match self { $(Self::$variant(message) => messages!(@stamp message $stamp),)* }
            }

            /// Validates numbers, sizes and names.
            ///
            /// # Errors
            /// The first invalid field.
            pub fn check(&self) -> Result<(), Invalid> {
                match self { $(Self::$variant(message) => {
                    check_numbers(message, <$package::$name as Check>::MAY_BE_NAN)?;
                    message.check()
                })* }
            }

            /// Makes the fields consistent with each other, in a sample of arbitrary values.
            pub(crate) fn fit(&mut self) {
                match self { $(Self::$variant(message) => message.fit(),)* }
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
    CarlaEgoVehicleControl = carla_msgs::CarlaEgoVehicleControl: header, small;
    CarlaEgoVehicleStatus = carla_msgs::CarlaEgoVehicleStatus: header, small;
    AckermannDriveStamped = ackermann_msgs::AckermannDriveStamped: header, small;
}

impl Kind {
    /// ROS type name, `package/msg/Name`.
    pub fn type_name(self) -> String {
        format!("{}/msg/{}", self.package(), self.name())
    }

    /// DDS type name, `package::msg::dds_::Name_`.
    pub fn dds_type_name(self) -> String {
        format!("{}::msg::dds_::{}_", self.package(), self.name())
    }

    /// Parses `package/msg/Name` or `package/Name`.
    pub fn parse(type_name: &str) -> Option<Self> {
        let (package, name) = type_name.split_once('/')?;
        let name = name.strip_prefix("msg/").unwrap_or(name);
        Self::ALL.iter().copied().find(|kind| kind.package() == package && kind.name() == name)
    }
}

impl Serialize for Kind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.type_name())
    }
}

impl<'de> Deserialize<'de> for Kind {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::parse(&name).ok_or_else(|| serde::de::Error::custom(format!("no message is called {name}")))
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/msg/{}", self.package(), self.name())
    }
}
