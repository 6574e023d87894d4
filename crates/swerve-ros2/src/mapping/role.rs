//! The table of all roles of topics.

use super::qos::Qos;
use crate::message::Kind;

/// Publishing side of a topic.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Side {
    /// The vehicle, or its simulator: measurements and reports.
    Vehicle,
    /// The stack: commands and visualisation.
    Stack,
}

/// Purpose of a topic.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Purpose {
    /// A measurement of a sensor.
    Sensor,
    /// Pose and motion of the ego from localization.
    Localization,
    /// A report of the vehicle.
    Report,
    /// A switch by which a person enables or stops the stack.
    Switch,
    /// Time and frames.
    Frames,
    /// Other road users from external perception.
    Perception,
    /// A command that moves the vehicle.
    Motion,
    /// A command that goes with motion: gear and lights.
    Auxiliary,
    /// Visualisation of the stack.
    Display,
}

/// Properties of a role.
struct Description {
    pub(crate) name: &'static str,
    pub(crate) side: Side,
    pub(crate) purpose: Purpose,
    /// Possible types; the first is the default.
    pub(crate) kinds: &'static [Kind],
    pub(crate) qos: Qos,
    /// Rate limit: five times the usual rate.
    pub(crate) rate_max_hz: f64,
}

/// Generates `Role` from a table of roles.
macro_rules! roles {
    ($($role:ident = $name:literal: $side:ident, $purpose:ident, [$($kind:ident),+], $qos:expr, $rate:literal;)*) => {
        /// Role of a topic.
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
        pub enum Role { $(#[doc = concat!("`", $name, "`.")] $role,)* }

        impl Role {
            /// All roles, in table order.
            pub const ALL: &[Self] = &[$(Self::$role,)*];

            fn description(self) -> &'static Description {
                match self { $(Self::$role => const { &Description {
                    name: $name,
                    side: Side::$side,
                    purpose: Purpose::$purpose,
                    kinds: &[$(Kind::$kind),+],
                    qos: $qos,
                    rate_max_hz: $rate,
                } },)* }
            }
        }
    };
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
    Velocity = "velocity": Vehicle, Report, [VelocityReport, TwistStamped, TwistWithCovarianceStamped, DataspeedVehicleVelocity, DataspeedUlcReport, CarlaEgoVehicleStatus], Qos::VEHICLE, 500.0;
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
    Command = "command": Stack, Motion, [Control, CarlaEgoVehicleControl, AckermannDriveStamped], Qos::VEHICLE, 500.0;
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
    Lanes = "lanes": Stack, Display, [MarkerArray], Qos::LATCHED, 100.0;
}

impl Role {
    /// Name in configurations.
    pub fn name(self) -> &'static str {
        self.description().name
    }

    /// Publishing side.
    pub fn side(self) -> Side {
        self.description().side
    }

    /// Purpose.
    pub fn purpose(self) -> Purpose {
        self.description().purpose
    }

    /// Possible types.
    pub fn kinds(self) -> &'static [Kind] {
        self.description().kinds
    }

    pub(super) fn qos(self) -> Qos {
        self.description().qos
    }

    pub(super) fn rate_max_hz(self) -> Option<f64> {
        Some(self.description().rate_max_hz)
    }
}

pub(super) fn names() -> Vec<(&'static str, Role)> {
    Role::ALL.iter().map(|role| (role.name(), *role)).collect()
}
