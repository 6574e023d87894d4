//! Reports of closed roads.

use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_map::router::Stop;

/// Places on the map that are reported to be closed to traffic.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Closures {
    /// Instant of the report.
    pub stamp: Time,
    /// Places that no route may pass.
    pub places: Vec<Stop>,
}
