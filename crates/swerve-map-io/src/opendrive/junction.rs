//! Junctions and controllers (ASAM OpenDRIVE 1.8, chapters 12 and 14).

use super::Contact;

/// Kind of a junction.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum JunctionKind {
    /// Incoming roads continue on connecting roads.
    Default,
    /// Roads continue on each other directly, as at exits.
    Direct,
    /// Connecting roads begin and end within a main road that is not interrupted.
    Virtual,
    /// Roads cross without connections.
    Crossing,
}

impl JunctionKind {
    /// Names in a file.
    pub const NAMES: [&'static str; 4] = ["default", "direct", "virtual", "crossing"];

    /// Name in a file.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    pub(crate) fn of(name: &str) -> Self {
        match name {
            "direct" => Self::Direct,
            "virtual" => Self::Virtual,
            "crossing" => Self::Crossing,
            _ => Self::Default,
        }
    }
}

/// A junction.
#[derive(Clone, PartialEq, Debug)]
pub struct Junction {
    /// Identity in the network.
    pub id: String,
    /// Name; may be empty.
    pub name: String,
    /// Kind.
    pub kind: JunctionKind,
    /// Connections of incoming roads.
    pub connections: Vec<Connection>,
    /// Rights of way between roads.
    pub priorities: Vec<Priority>,
    /// Controllers of the junction's signals.
    pub controllers: Vec<String>,
}

/// Right of way of a road over another (`<priority>`): incoming roads, or connecting roads in old files.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Priority {
    /// Road with priority.
    pub high: String,
    /// Road whose traffic gives way.
    pub low: String,
}

/// A way through a junction.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Connection {
    /// Identity in the junction.
    pub id: String,
    /// Road that leads into the junction; empty if not given.
    pub incoming: String,
    /// Road that continues it: the connecting road, or the linked road of a direct junction; empty if not given.
    pub continuing: String,
    /// End of the continuing road.
    pub contact: Contact,
    /// Lanes of the two roads that continue each other.
    pub lane_links: Vec<LaneLink>,
}

/// A lane of an incoming road, and the lane that continues it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LaneLink {
    /// Lane of the incoming road.
    pub from: i32,
    /// Lane of the continuing road.
    pub to: i32,
}

/// Signals that are switched together.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Controller {
    /// Identity in the network.
    pub id: String,
    /// Name; may be empty.
    pub name: String,
    /// Identities of the signals.
    pub signals: Vec<String>,
}
