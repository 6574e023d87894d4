//! Localizers that a configuration can name: built-in ones, and those of other crates.

use swerve_flow::{NamedInputs as _, Operator};

use crate::config::{OperatorConfig, Reads};
use crate::kind::Kind;
use crate::named::Of;
use crate::operators::{Carried, Filter, PoseSensor};

/// Poses of the ego by a lidar, which a localizer reads.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LidarPoses {
    /// Matches of sweeps with a map, by an operator `scan_matcher`.
    Matches,
    /// Lidar odometry without a map, by an operator `lidar_odometry`.
    Odometry,
}

/// A localizer that `localization.localizer` can name: an operator that publishes the ego's pose.
///
/// [`Registry::with_localizer`](crate::Registry::with_localizer) adds one. Its operator `localizer` then replaces `pose`,
/// with run times and keys in `[operator.localizer]`, as that of built-in localizers does.
pub trait NamedLocalizer: 'static {
    /// Name in `localization.localizer`.
    const NAME: &'static str;

    /// Poses by a lidar that it reads.
    const LIDAR: Option<LidarPoses> = None;

    /// True if it starts from `localization.stored_pose`.
    const STARTS_STORED: bool = false;

    /// Operator that publishes the pose.
    type Operator: Kind;
}

/// A localizer's type, erased.
pub(crate) trait AnyLocalizer: Send + Sync {
    fn lidar(&self) -> Option<LidarPoses>;

    fn starts_stored(&self) -> bool;

    /// Operator that publishes the pose.
    fn operator(&self) -> OperatorConfig;
}

impl<L: NamedLocalizer> AnyLocalizer for Of<L> {
    fn lidar(&self) -> Option<LidarPoses> {
        L::LIDAR
    }

    fn starts_stored(&self) -> bool {
        L::STARTS_STORED
    }

    fn operator(&self) -> OperatorConfig {
        let ports = <<L::Operator as Operator>::In>::ports();
        let wheels = ports.iter().any(|port| port.name == WHEELS);
        of_kind(L::Operator::NODE.kind, wheels)
    }
}

impl LidarPoses {
    /// Name of the operator, which is its kind.
    fn name(self) -> &'static str {
        match self {
            Self::Matches => "scan_matcher",
            Self::Odometry => "lidar_odometry",
        }
    }

    /// Operator with its name.
    pub(crate) fn operator(self) -> (String, OperatorConfig) {
        (self.name().to_owned(), of_kind(self.name(), true))
    }
}

/// Port for wheel speeds, which are those of the sensor.
const WHEELS: &str = "wheels";

/// An operator of this kind.
fn of_kind(kind: &str, wheels: bool) -> OperatorConfig {
    let reads = wheels.then(|| (WHEELS.to_owned(), Reads::Stream("odometry".to_owned())));
    OperatorConfig {
        kind: Some(kind.to_owned()),
        reads: reads.into_iter().collect(),
        ..OperatorConfig::default()
    }
}

/// The simulator, or the vehicle's report.
pub(crate) enum Truth {}

impl NamedLocalizer for Truth {
    const NAME: &'static str = "truth";
    type Operator = PoseSensor;
}

/// The filter over inertial unit, satellite fixes and wheels.
pub(crate) enum Eskf {}

impl NamedLocalizer for Eskf {
    const NAME: &'static str = "eskf";
    const STARTS_STORED: bool = true;
    type Operator = Filter;
}

/// Dead reckoning between matches with a map.
pub(crate) enum Ndt {}

impl NamedLocalizer for Ndt {
    const NAME: &'static str = "ndt";
    const LIDAR: Option<LidarPoses> = Some(LidarPoses::Matches);
    type Operator = Carried;
}

/// The filter with matches with a map.
pub(crate) enum EskfNdt {}

impl NamedLocalizer for EskfNdt {
    const NAME: &'static str = "eskf_ndt";
    const LIDAR: Option<LidarPoses> = Some(LidarPoses::Matches);
    const STARTS_STORED: bool = true;
    type Operator = Filter;
}

/// Dead reckoning between poses of lidar odometry.
pub(crate) enum Odometry {}

impl NamedLocalizer for Odometry {
    const NAME: &'static str = "odometry";
    const LIDAR: Option<LidarPoses> = Some(LidarPoses::Odometry);
    type Operator = Carried;
}
