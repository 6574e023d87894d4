//! What only the simulator knows.

use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::{Ego, Map, Obb, Pose2, Transform, Vector, Vector2};

use crate::{ActorId, ActorKind, EgoState, Extent, Obstacle, Packed};

/// The state of the simulated world after one step.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct WorldState {
    /// Instant of the state.
    pub stamp: Time,
    /// The ego vehicle.
    pub ego: EgoTruth,
    /// All other actors, ordered by identity.
    pub actors: Vec<Actor>,
    /// Contacts of the ego that began since the previous step.
    pub collisions: Vec<Collision>,
    /// Rules broken since the previous step.
    pub infractions: Vec<Infraction>,
    /// Set from the step on at which the scenario is over.
    pub ended: Option<EndReason>,
}

/// The ego vehicle in full.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct EgoTruth {
    /// Pose of the ego frame in the map, in three dimensions.
    pub map_from_ego: Transform<Map, Ego>,
    /// The same, as a perfect localization would report it.
    pub state: EgoState,
    /// Velocity of the centre of gravity in the map, m/s.
    pub velocity_mps: Vector<Map>,
    /// Specific force at the centre of gravity in the ego frame, m/s².
    pub specific_force_mps2: Vector<Ego>,
    /// Angular velocity in the ego frame, rad/s.
    pub angular_velocity_radps: Vector<Ego>,
}

/// Another road user or thing.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Actor {
    /// Identity: its place in the scenario file, from 1.
    pub id: ActorId,
    /// What it is.
    pub kind: ActorKind,
    /// Pose of the centre of its footprint in the map.
    pub pose: Pose2,
    /// Height of the bottom of its box above the map plane, metres.
    pub z_m: f64,
    /// Size.
    pub extent: Extent,
    /// Velocity over ground, m/s.
    pub velocity_mps: Vector2,
}

impl Actor {
    /// Whether its body is an upright cylinder of diameter `extent.width_m`, not a box: people on foot are.
    pub fn is_round(&self) -> bool {
        self.kind == ActorKind::Pedestrian
    }

    /// The ground rectangle of its box.
    pub fn footprint(&self) -> Obb {
        self.extent.footprint(self.pose)
    }

    /// Distance on the ground between its body and a rectangle, metres; zero when they touch.
    pub fn gap_m(&self, rectangle: &Obb) -> f64 {
        if self.is_round() {
            (rectangle.distance_to_point(self.pose.point()) - 0.5 * self.extent.width_m).max(0.0)
        } else {
            rectangle.distance(&self.footprint())
        }
    }

    /// Time until its body touches a rectangle that moves at `velocity_mps`, seconds, if both keep their velocities and
    /// headings; zero where they touch, `None` where they never will.
    pub fn time_to_contact_s(&self, rectangle: &Obb, velocity_mps: Vector2) -> Option<f64> {
        let relative_mps = self.velocity_mps - velocity_mps;
        if self.is_round() {
            rectangle.time_to_circle_s(self.pose.point(), 0.5 * self.extent.width_m, relative_mps)
        } else {
            rectangle.time_to_contact_s(&self.footprint(), relative_mps)
        }
    }
}

/// The ego touched something.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Collision {
    /// Instant of first contact.
    pub stamp: Time,
    /// What was hit.
    pub actor: ActorId,
    /// Impulse of the first contact step, N s.
    pub impulse_n_s: f64,
    /// Speed at which the two closed along the contact normal just before, m/s.
    pub closing_speed_mps: f64,
    /// Speed of the ego just before, m/s.
    pub ego_speed_mps: f64,
}

/// A rule broken by the ego.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Infraction {
    /// Instant at which it began.
    pub stamp: Time,
    /// Which rule.
    pub kind: InfractionKind,
}

/// Rules that the ego can break.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InfractionKind {
    /// Part of the footprint left the drivable ground.
    LeftRoad,
}

/// Why a scenario is over.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EndReason {
    /// The ego reached the end of the scenario.
    Goal,
    /// The ego stands still where the scenario asks for that.
    Stopped,
    /// A collision, some time after it happened.
    Collision,
    /// The scenario's time is over.
    Timeout,
}

/// The outcome of a run in one word; the first that holds, in the order in which `docs/conventions.md` has them.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The ego came to the end, or to the stop asked for, touching nothing and staying on the road.
    Avoided,
    /// The same, in a scenario without anybody else: there was nothing to avoid.
    Completed,
    /// The ego hit something, whatever else happened.
    Collision,
    /// Part of the ego left the drivable ground, and it hit nothing.
    LeftRoad,
    /// The scenario's time was over, and the ego stood safely before what was in its way.
    Stopped,
    /// The scenario's time was over before the ego reached its end.
    Timeout,
    /// The run was ended before the scenario was.
    Unfinished,
}

impl Verdict {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Avoided,
        Self::Completed,
        Self::Collision,
        Self::LeftRoad,
        Self::Stopped,
        Self::Timeout,
        Self::Unfinished,
    ];
    /// Those that a scenario can come to by itself.
    pub const OF_SCENARIOS: [Self; 6] =
        [Self::Avoided, Self::Completed, Self::Collision, Self::LeftRoad, Self::Stopped, Self::Timeout];

    /// The name used in files and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Avoided => "avoided",
            Self::Completed => "completed",
            Self::Collision => "collision",
            Self::LeftRoad => "left_road",
            Self::Stopped => "stopped",
            Self::Timeout => "timeout",
            Self::Unfinished => "unfinished",
        }
    }

    /// Whether the ego came to its end, or to the stop asked for, unharmed.
    pub fn is_success(self) -> bool {
        matches!(self, Self::Avoided | Self::Completed)
    }

    /// What a verdict was called before there was a name of its own for it.
    pub fn old_name(self) -> Self {
        match self {
            Self::Completed => Self::Avoided,
            Self::Stopped => Self::Timeout,
            other => other,
        }
    }
}

impl core::fmt::Display for Verdict {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.name())
    }
}

/// What the points of the [`PointCloud`](crate::PointCloud) of the same stamp lie on.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PointInstances {
    /// Stamp of the cloud.
    pub stamp: Time,
    /// For each point the identity of the actor, 0 for what is none.
    pub instance: Packed<u32>,
}

/// Where the echoes of the [`RadarScan`](crate::RadarScan) of the same stamp come from.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct RadarSources {
    /// Stamp of the scan.
    pub stamp: Time,
    /// For each detection the actor that gave most of the echo; `None` for clutter.
    pub sources: Vec<Option<ActorId>>,
}

/// What a sensor could see at one instant, and from where: all that an emulated detector is given.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Surroundings {
    /// Instant of the measurement.
    pub stamp: Time,
    /// True pose of the ego origin in the map.
    pub ego: Pose2,
    /// The actors of which something is in sight, ordered by identity, in the map.
    pub obstacles: Vec<Obstacle>,
}
