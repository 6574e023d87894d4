//! Areas.

use serde::{Deserialize, Serialize};
use swerve_geom::Point2;

/// Identity of an area in its map.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct AreaId(pub u32);

/// Intended use of an area.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AreaKind {
    /// Parked vehicles.
    Parking,
    /// Pedestrians.
    Walking,
    /// Vehicles may pass but not stop.
    NoStopping,
    /// Vehicles may not enter, such as traffic islands.
    NoEntry,
    /// Another use.
    Other,
}

impl AreaKind {
    /// Name in output.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Parking => "parking",
            Self::Walking => "walking",
            Self::NoStopping => "no stopping",
            Self::NoEntry => "no entry",
            Self::Other => "other",
        }
    }
}

/// Ground without a direction of travel.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Area {
    /// Identity in the map.
    pub id: AreaId,
    /// Identity in the file that the map is from; may be empty.
    #[serde(default)]
    pub name: String,
    /// Intended use.
    pub kind: AreaKind,
    /// Corners in order, at least 3; the last is joined with the first.
    pub outline: Vec<Point2>,
}
