use super::Qos;
use crate::message::Kind;

/// Who publishes a topic.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Side {
    /// The vehicle, or the simulator in its place: what is measured and reported.
    Vehicle,
    /// The stack: what is commanded and shown.
    Stack,
}

/// What a topic is for.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
#[expect(missing_docs, reason = "each is described in the table below, beside its types and its side")]
pub enum Role {
    Camera,
    CameraCompressed,
    CameraInfo,
    Lidar,
    Imu,
    Gnss,
    Odometry,
    Acceleration,
    Velocity,
    WheelSpeeds,
    Steering,
    Brake,
    Throttle,
    ControlMode,
    Gear,
    TurnIndicators,
    HazardLights,
    Enabled,
    Emergency,
    Miscellaneous,
    Clock,
    Tf,
    TfStatic,
    Objects,
    Command,
    SteeringCommand,
    BrakeCommand,
    ThrottleCommand,
    SpeedCommand,
    GearCommand,
    TurnIndicatorsCommand,
    HazardLightsCommand,
    Enable,
    Disable,
    Trajectory,
    Path,
    Markers,
}

struct Description {
    role: Role,
    name: &'static str,
    side: Side,
    /// Types that it can have; the first where none is given.
    kinds: &'static [Kind],
    qos: Qos,
    /// Five times what is usual.
    rate_max_hz: Option<f64>,
}

const fn is(
    role: Role,
    name: &'static str,
    side: Side,
    kinds: &'static [Kind],
    qos: Qos,
    rate_max_hz: f64,
) -> Description {
    Description { role, name, side, kinds, qos, rate_max_hz: Some(rate_max_hz) }
}

use Side::{Stack, Vehicle};

const ROLES: [Description; 37] = [
    // Pictures, raw and as files, and how the camera sees.
    is(Role::Camera, "camera", Vehicle, &[Kind::Image], Qos::SENSOR, 200.0),
    is(Role::CameraCompressed, "camera_compressed", Vehicle, &[Kind::CompressedImage], Qos::SENSOR, 200.0),
    is(Role::CameraInfo, "camera_info", Vehicle, &[Kind::CameraInfo], Qos::SENSOR, 200.0),
    is(Role::Lidar, "lidar", Vehicle, &[Kind::PointCloud2], Qos::SENSOR, 100.0),
    is(Role::Imu, "imu", Vehicle, &[Kind::Imu], Qos::SENSOR, 2000.0),
    is(Role::Gnss, "gnss", Vehicle, &[Kind::NavSatFix], Qos::SENSOR, 100.0),
    // Where the ego is, by localization.
    is(
        Role::Odometry,
        "odometry",
        Vehicle,
        &[Kind::Odometry, Kind::PoseStamped, Kind::PoseWithCovarianceStamped],
        Qos::DEFAULT,
        500.0,
    ),
    is(Role::Acceleration, "acceleration", Vehicle, &[Kind::AccelWithCovarianceStamped], Qos::DEFAULT, 500.0),
    // What the vehicle reports of itself.
    is(
        Role::Velocity,
        "velocity",
        Vehicle,
        &[
            Kind::VelocityReport,
            Kind::TwistStamped,
            Kind::TwistWithCovarianceStamped,
            Kind::DataspeedVehicleVelocity,
            Kind::DataspeedUlcReport,
        ],
        Qos::VEHICLE,
        500.0,
    ),
    is(
        Role::WheelSpeeds,
        "wheel_speeds",
        Vehicle,
        &[Kind::DataspeedWheelSpeeds, Kind::RaptorWheelSpeedReport],
        Qos::DEFAULT,
        500.0,
    ),
    is(
        Role::Steering,
        "steering",
        Vehicle,
        &[Kind::SteeringReport, Kind::DataspeedSteeringReport, Kind::RaptorSteeringReport],
        Qos::VEHICLE,
        500.0,
    ),
    is(
        Role::Brake,
        "brake",
        Vehicle,
        &[Kind::DataspeedBrakeReport, Kind::RaptorBrakeReport],
        Qos::DEFAULT,
        500.0,
    ),
    is(
        Role::Throttle,
        "throttle",
        Vehicle,
        &[Kind::DataspeedThrottleReport, Kind::RaptorAcceleratorPedalReport],
        Qos::DEFAULT,
        500.0,
    ),
    is(Role::ControlMode, "control_mode", Vehicle, &[Kind::ControlModeReport], Qos::VEHICLE, 500.0),
    is(Role::Gear, "gear", Vehicle, &[Kind::GearReport, Kind::DataspeedGearReport], Qos::VEHICLE, 500.0),
    is(Role::TurnIndicators, "turn_indicators", Vehicle, &[Kind::TurnIndicatorsReport], Qos::VEHICLE, 500.0),
    is(Role::HazardLights, "hazard_lights", Vehicle, &[Kind::HazardLightsReport], Qos::VEHICLE, 500.0),
    is(Role::Enabled, "enabled", Vehicle, &[Kind::Bool], Qos::LATCHED, 100.0),
    is(Role::Emergency, "emergency", Vehicle, &[Kind::Bool], Qos::DEFAULT, 500.0),
    is(Role::Miscellaneous, "miscellaneous", Vehicle, &[Kind::RaptorMiscReport], Qos::DEFAULT, 500.0),
    // Simulated time and frames.
    is(Role::Clock, "clock", Vehicle, &[Kind::Clock], Qos::SENSOR, 5000.0),
    is(Role::Tf, "tf", Vehicle, &[Kind::Tf], Qos { depth: 100, ..Qos::DEFAULT }, 5000.0),
    is(Role::TfStatic, "tf_static", Vehicle, &[Kind::Tf], Qos::LATCHED, 100.0),
    // Others, where somebody else sees them.
    is(Role::Objects, "objects", Vehicle, &[Kind::PredictedObjects], Qos::DEFAULT, 100.0),
    // What the stack asks for.
    is(Role::Command, "command", Stack, &[Kind::Control], Qos::VEHICLE, 500.0),
    is(
        Role::SteeringCommand,
        "steering_command",
        Stack,
        &[Kind::DataspeedSteeringCmd, Kind::RaptorSteeringCmd],
        Qos::VEHICLE,
        500.0,
    ),
    is(
        Role::BrakeCommand,
        "brake_command",
        Stack,
        &[Kind::DataspeedBrakeCmd, Kind::RaptorBrakeCmd],
        Qos::VEHICLE,
        500.0,
    ),
    is(
        Role::ThrottleCommand,
        "throttle_command",
        Stack,
        &[Kind::DataspeedThrottleCmd, Kind::RaptorAcceleratorPedalCmd],
        Qos::VEHICLE,
        500.0,
    ),
    is(Role::SpeedCommand, "speed_command", Stack, &[Kind::DataspeedUlcCmd], Qos::VEHICLE, 500.0),
    is(
        Role::GearCommand,
        "gear_command",
        Stack,
        &[Kind::GearCommand, Kind::DataspeedGearCmd, Kind::RaptorGearCmd],
        Qos::VEHICLE,
        500.0,
    ),
    is(
        Role::TurnIndicatorsCommand,
        "turn_indicators_command",
        Stack,
        &[Kind::TurnIndicatorsCommand],
        Qos::VEHICLE,
        500.0,
    ),
    is(
        Role::HazardLightsCommand,
        "hazard_lights_command",
        Stack,
        &[Kind::HazardLightsCommand],
        Qos::VEHICLE,
        500.0,
    ),
    is(
        Role::Enable,
        "enable",
        Stack,
        &[Kind::Engage, Kind::Empty, Kind::RaptorGlobalEnableCmd],
        Qos::DEFAULT,
        500.0,
    ),
    is(Role::Disable, "disable", Stack, &[Kind::Empty], Qos::DEFAULT, 500.0),
    // What the stack shows.
    is(Role::Trajectory, "trajectory", Stack, &[Kind::Trajectory], Qos::DEFAULT, 500.0),
    is(Role::Path, "path", Stack, &[Kind::Path], Qos::DEFAULT, 500.0),
    is(Role::Markers, "markers", Stack, &[Kind::MarkerArray], Qos::DEFAULT, 500.0),
];

impl Role {
    /// All of them, in the order of the table.
    pub const ALL: [Self; 37] = {
        let mut all = [Self::Camera; 37];
        let mut i = 0;
        while i < all.len() {
            all[i] = ROLES[i].role;
            i += 1;
        }
        all
    };

    fn description(self) -> &'static Description {
        &ROLES[self as usize]
    }

    /// As it is written in a table.
    pub fn name(self) -> &'static str {
        self.description().name
    }

    /// Who publishes it.
    pub fn side(self) -> Side {
        self.description().side
    }

    /// Types that it can have.
    pub fn kinds(self) -> &'static [Kind] {
        self.description().kinds
    }

    pub(super) fn qos(self) -> Qos {
        self.description().qos
    }

    pub(super) fn rate_max_hz(self) -> Option<f64> {
        self.description().rate_max_hz
    }
}

pub(super) fn names() -> Vec<(&'static str, Role)> {
    ROLES.iter().map(|description| (description.name, description.role)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_the_order_of_the_roles() {
        for (i, role) in Role::ALL.iter().enumerate() {
            assert_eq!(*role as usize, i, "{}", role.name());
            assert!(!role.kinds().is_empty());
        }
    }
}
