//! Traffic signals.

use serde::{Deserialize, Serialize};
use swerve_geom::Point2;

use crate::LaneId;

/// Identity of a traffic signal in its map.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct SignalId(pub u32);

/// A traffic light. Its phases are not part of the map.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Signal {
    /// Identity in the map.
    pub id: SignalId,
    /// Identity in the file that the map is from; may be empty.
    #[serde(default)]
    pub name: String,
    /// Position in the ground plane.
    pub position: Point2,
    /// Direction in which it shines, radians from x towards y: against the traffic that it is for.
    pub heading_rad: f64,
    /// Height over the ground, metres; `None` if unknown.
    #[serde(default)]
    pub height_m: Option<f64>,
    /// Lanes whose traffic obeys it, ordered by identity.
    #[serde(default)]
    pub lanes: Vec<LaneId>,
    /// Name of the controller that switches it together with others; `None` if unknown.
    #[serde(default)]
    pub controller: Option<String>,
}
