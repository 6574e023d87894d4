//! Junctions.

use serde::{Deserialize, Serialize};

use crate::LaneId;

/// Identity of a junction in its map.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct JunctionId(pub u32);

/// Ground on which the lanes of several roads meet or cross.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Junction {
    /// Identity in the map.
    pub id: JunctionId,
    /// Identity in the file that the map is from; may be empty.
    #[serde(default)]
    pub name: String,
    /// Lanes inside, ordered by identity.
    #[serde(default)]
    pub lanes: Vec<LaneId>,
    /// Lanes that lead into it, ordered by identity.
    #[serde(default)]
    pub incoming: Vec<LaneId>,
    /// Rights of way between lanes inside or incoming, ordered by lane; empty if unknown.
    #[serde(default)]
    pub rights_of_way: Vec<RightOfWay>,
}

/// Traffic on one lane gives way to traffic on another.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub struct RightOfWay {
    /// Lane whose traffic gives way.
    pub lane: LaneId,
    /// Lane with priority.
    pub to: LaneId,
}
