//! Localizers that a configuration can name: built-in ones, and those of other crates.

use std::sync::Arc;

use swerve_flow::{NamedInputs as _, Operator};

use crate::config::localization::{LidarPoses, LocalizerOperators, TRUTH, WHEELS};
use crate::kind::Kind;
use crate::operators::{Carried, Filter, PoseSensor};
use crate::registry::Registry;

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

impl Registry {
    /// Adds a localizer with its operator, or replaces the one of the same name.
    #[must_use]
    pub fn with_localizer<L: NamedLocalizer>(mut self) -> Self {
        let ports = <<L::Operator as Operator>::In>::ports();
        let wheels = ports.iter().any(|port| port.name == WHEELS);
        let info = LocalizerOperators::new(L::Operator::NODE.kind, wheels, L::LIDAR, L::STARTS_STORED);
        self.localizers.insert(L::NAME, Arc::new(info));
        self.with::<L::Operator>()
    }
}

/// The simulator, or the vehicle's report.
pub(crate) enum Truth {}

impl NamedLocalizer for Truth {
    const NAME: &'static str = TRUTH;
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
