use serde::{Deserialize, Serialize};
use swerve_core::Time;

use crate::{ActorId, ActorKind};

/// What the ego began to touch at one step of the world; mostly nothing.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct CollisionEvents {
    /// The step.
    pub stamp: Time,
    /// Ordered by identity.
    pub events: Vec<CollisionEvent>,
}

/// The ego began to touch something.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct CollisionEvent {
    /// What it touched.
    pub actor: ActorId,
    /// What that is.
    pub kind: ActorKind,
    /// Impulse of the first step of the contact, N s.
    pub impulse_n_s: f64,
    /// Speed at which the two closed along the contact normal just before, m/s.
    pub closing_speed_mps: f64,
}

/// Which lines the ego began to cross at one step of the world; mostly none.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct LaneInvasions {
    /// The step.
    pub stamp: Time,
    /// From the rightmost line to the leftmost.
    pub events: Vec<LaneInvasion>,
}

/// The ego's outline came onto a line, or leapt over it.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct LaneInvasion {
    /// Which line of the road.
    pub line: RoadLine,
    /// Where that is: to the left of the centre of the ego's lane, metres.
    pub line_d_m: f64,
    /// With which side of the ego: to the left when it was to the right of the line.
    pub side: Side,
    /// Where the middle of the outline was then, along the road, metres.
    pub s_m: f64,
}

/// A line that the road's description gives.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RoadLine {
    /// Right edge of the drivable ground.
    RightEdge,
    /// Right border of the ego's lane, where the ground goes on.
    LaneRight,
    /// Left border of the ego's lane, where the ground goes on.
    LaneLeft,
    /// Left edge of the drivable ground.
    LeftEdge,
}

/// One of two sides.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Towards +d.
    Left,
    /// Towards -d.
    Right,
}

/// Which red lights the ego passed at one step of the world; mostly none.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct RedLightEvents {
    /// The step.
    pub stamp: Time,
    /// In the order of the road's lights.
    pub events: Vec<RedLightEvent>,
}

/// The ego's front went over a stop line while its light was red.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct RedLightEvent {
    /// Which light: its place in the road's description, from 0.
    pub light: u32,
    /// Where its stop line is along the road, metres.
    pub stop_s_m: f64,
    /// When the front went over it: between two steps of the world.
    pub passed: Time,
    /// How long the light had been red then, seconds.
    pub red_for_s: f64,
    /// How fast the front went, m/s along the road.
    pub speed_mps: f64,
}

/// What a traffic light shows.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Signal {
    /// Go.
    Green,
    /// Stop where that can be done.
    Yellow,
    /// Stop.
    Red,
}

impl Signal {
    /// Its name.
    pub fn name(self) -> &'static str {
        ["green", "yellow", "red"][self as usize]
    }

    /// The colour in which pictures have it.
    pub fn rgb(self) -> [u8; 3] {
        [[40, 230, 90], [255, 200, 40], [255, 60, 50]][self as usize]
    }
}

/// A fault was put on a message.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct FaultInjection {
    /// Stamp of the message.
    pub stamp: Time,
    /// The stream.
    pub stream: String,
    /// What was done: `drop`, `delay`, `jitter`, `freeze`, `noise`, `nan`, `flip_bits`.
    pub harm: String,
    /// How much later the message came, seconds; 0 for what is not late.
    pub later_s: f64,
}
