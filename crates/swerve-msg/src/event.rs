//! Events of the simulated world: collisions, lane invasions, red lights, injected faults.

use serde::{Deserialize, Serialize};
use swerve_core::Time;

use crate::{ActorId, ActorKind};

/// Contacts of the ego that began in one world step; usually empty.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct CollisionEvents {
    /// The step.
    pub stamp: Time,
    /// Ordered by identity.
    pub events: Vec<CollisionEvent>,
}

/// Start of a contact of the ego with an actor.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct CollisionEvent {
    /// Actor touched.
    pub actor: ActorId,
    /// Kind of the actor.
    pub kind: ActorKind,
    /// Impulse of the first step of the contact, N s.
    pub impulse_n_s: f64,
    /// Closing speed along the contact normal just before, m/s.
    pub closing_speed_mps: f64,
}

/// Lane lines that the ego began to cross in one world step; usually empty.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct LaneInvasions {
    /// The step.
    pub stamp: Time,
    /// From the rightmost line to the leftmost.
    pub events: Vec<LaneInvasion>,
}

/// Start of a crossing: the ego's outline touched a line or jumped over it.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct LaneInvasion {
    /// Line that was crossed.
    pub line: RoadLine,
    /// Lateral offset of the line from the centre of the ego's lane, metres; positive to the left.
    pub line_d_m: f64,
    /// Side of the ego that crossed: left if the ego was to the right of the line.
    pub side: Side,
    /// Position of the outline's centre along the road at that instant, metres.
    pub s_m: f64,
}

/// A line from the road description.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RoadLine {
    /// Right edge of the drivable ground.
    RightEdge,
    /// Right border of the ego's lane, with drivable ground beyond.
    LaneRight,
    /// Left border of the ego's lane, with drivable ground beyond.
    LaneLeft,
    /// Left edge of the drivable ground.
    LeftEdge,
}

/// Side of the ego or of a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Towards +d.
    Left,
    /// Towards -d.
    Right,
}

/// Red lights that the ego passed in one world step; usually empty.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct RedLightEvents {
    /// The step.
    pub stamp: Time,
    /// In the order of the road's lights.
    pub events: Vec<RedLightEvent>,
}

/// The ego's front crossed a stop line while its light was red.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct RedLightEvent {
    /// Index of the light in the road description, from 0.
    pub light: u32,
    /// Position of the stop line along the road, metres.
    pub stop_s_m: f64,
    /// Instant of the crossing, interpolated between two world steps.
    pub passed: Time,
    /// Time since the light turned red, seconds.
    pub red_for_s: f64,
    /// Speed of the front along the road, m/s.
    pub speed_mps: f64,
}

/// Signal of a traffic light.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Signal {
    /// Go.
    Green,
    /// Stop if possible.
    Yellow,
    /// Stop.
    Red,
    /// Dark or flashing: the light does not apply.
    Off,
}

impl Signal {
    /// Name: `green`, `yellow`, `red` or `off`.
    pub fn name(self) -> &'static str {
        ["green", "yellow", "red", "off"][self as usize]
    }

    /// Returns true if traffic waits at it.
    pub fn holds(self) -> bool {
        matches!(self, Self::Yellow | Self::Red)
    }

    /// Colour in pictures, sRGB.
    pub fn rgb(self) -> [u8; 3] {
        [[40, 230, 90], [255, 200, 40], [255, 60, 50], [150; 3]][self as usize]
    }
}

/// A fault that was injected into a message.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct FaultInjection {
    /// Stamp of the message.
    pub stamp: Time,
    /// Name of the stream.
    pub stream: String,
    /// Kind of fault: `drop`, `delay`, `jitter`, `freeze`, `noise`, `nan`, `flip_bits`.
    pub harm: String,
    /// Added delay, seconds; 0 if not delayed.
    pub later_s: f64,
}
