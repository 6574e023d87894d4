//! Crossings.

use serde::{Deserialize, Serialize};
use swerve_geom::Point2;

use crate::LaneId;

/// Identity of a crossing in its map.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct CrossingId(pub u32);

/// Ground on which pedestrians or cyclists cross lanes.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Crossing {
    /// Identity in the map.
    pub id: CrossingId,
    /// Identity in the file that the map is from; may be empty.
    #[serde(default)]
    pub name: String,
    /// Corners in order, at least 3; the last is joined with the first.
    pub outline: Vec<Point2>,
    /// Lanes that it crosses, ordered by identity; empty if unknown.
    #[serde(default)]
    pub lanes: Vec<LaneId>,
}
