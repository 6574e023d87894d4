//! Ground truth of the simulator.

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
    /// All other actors, ordered by identity; in a world with several egos, the other egos too.
    pub actors: Vec<Actor>,
    /// Contacts that began since the previous step, of the ego and between others. Contacts that exist at the start of
    /// a run are none.
    pub collisions: Vec<Collision>,
    /// Rules broken since the previous step.
    pub infractions: Vec<Infraction>,
    /// Reason why the scenario is over, from the step on at which it is.
    pub ended: Option<EndReason>,
}

impl WorldState {
    /// The actor with this identity.
    pub fn actor(&self, id: ActorId) -> Option<&Actor> {
        self.actors.binary_search_by_key(&id, |actor| actor.id).ok().map(|index| &self.actors[index])
    }

    /// Collisions of the ego, with the other party. The ego's speed is the first of the two.
    pub fn collisions_of_ego(&self) -> impl Iterator<Item = (ActorId, &Collision)> {
        let own = self.ego.id;
        self.collisions.iter().filter_map(move |collision| Some((collision.other_than(own)?, collision)))
    }

    /// Collisions between two others.
    pub fn collisions_of_others(&self) -> impl Iterator<Item = &Collision> {
        self.collisions.iter().filter(|collision| !collision.involves(self.ego.id))
    }
}

/// Full state of the ego vehicle.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct EgoTruth {
    /// Identity in the run: [`ActorId::EGO`] in a world with one ego.
    pub id: ActorId,
    /// Pose of the ego frame in the map, three-dimensional.
    pub map_from_ego: Transform<Map, Ego>,
    /// The same state as a perfect localization would report it.
    pub state: EgoState,
    /// Velocity of the centre of gravity in the map, m/s.
    pub velocity_mps: Vector<Map>,
    /// Specific force at the centre of gravity in the ego frame, m/s².
    pub specific_force_mps2: Vector<Ego>,
    /// Angular velocity in the ego frame, rad/s.
    pub angular_velocity_radps: Vector<Ego>,
}

/// Another road user or an object.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Actor {
    /// Identity in the run.
    pub id: ActorId,
    /// Kind of the actor.
    pub kind: ActorKind,
    /// Pose of the footprint's centre in the map.
    pub pose: Pose2,
    /// Height of the bottom of its box above the map plane, metres.
    pub z_m: f64,
    /// Size.
    pub extent: Extent,
    /// Velocity over ground, m/s.
    pub velocity_mps: Vector2,
}

impl Actor {
    /// Returns true if the body is an upright cylinder of diameter `extent.width_m` instead of a box: pedestrians.
    pub fn is_round(&self) -> bool {
        self.kind == ActorKind::Pedestrian
    }

    /// Ground rectangle of the box.
    pub fn footprint(&self) -> Obb {
        self.extent.footprint(self.pose)
    }

    /// Horizontal distance between the body and a rectangle, metres; zero when they touch.
    pub fn gap_m(&self, rectangle: &Obb) -> f64 {
        if self.is_round() {
            (rectangle.distance_to_point(self.pose.point()) - 0.5 * self.extent.width_m).max(0.0)
        } else {
            rectangle.distance(&self.footprint())
        }
    }

    /// Time until the body touches a rectangle moving at `velocity_mps`, seconds, if both keep velocity and
    /// heading; zero if they touch already, `None` if they never do.
    pub fn time_to_contact_s(&self, rectangle: &Obb, velocity_mps: Vector2) -> Option<f64> {
        let relative_mps = self.velocity_mps - velocity_mps;
        if self.is_round() {
            rectangle.time_to_circle_s(self.pose.point(), 0.5 * self.extent.width_m, relative_mps)
        } else {
            rectangle.time_to_contact_s(&self.footprint(), relative_mps)
        }
    }
}

/// A collision of two bodies.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Collision {
    /// Instant of first contact.
    pub stamp: Time,
    /// The two parties: the ego first if it is one of them, else in order of identity.
    pub parties: [ActorId; 2],
    /// Impulse of the first contact step, N s; zero if physics moves neither of the two.
    pub impulse_n_s: f64,
    /// Closing speed along the contact normal just before, m/s.
    pub closing_speed_mps: f64,
    /// Speeds of the two parties over ground just before, m/s.
    pub speeds_mps: [f64; 2],
}

impl Collision {
    /// The other party of a collision of this actor or ego; `None` if it is a collision of others.
    pub fn other_than(&self, id: ActorId) -> Option<ActorId> {
        let [first, second] = self.parties;
        if first == id { Some(second) } else { (second == id).then_some(first) }
    }

    /// The same collision, with this ego first if it is one of the parties.
    #[must_use]
    pub fn seen_by(&self, ego: ActorId) -> Self {
        let mut seen = self.clone();
        if seen.parties[1] == ego {
            seen.parties.reverse();
            seen.speeds_mps.reverse();
        }
        seen
    }

    /// Returns true if it is a collision of this actor or ego.
    pub fn involves(&self, id: ActorId) -> bool {
        self.parties.contains(&id)
    }
}

/// A traffic rule broken by the ego.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Infraction {
    /// Instant at which the infraction began.
    pub stamp: Time,
    /// Rule that was broken.
    pub kind: InfractionKind,
}

/// Traffic rules that the ego can break.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InfractionKind {
    /// Part of the footprint left the drivable ground.
    LeftRoad,
}

/// Reason for the end of a scenario.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EndReason {
    /// The ego reached the end of the scenario.
    Goal,
    /// The ego stands still where the scenario requires it.
    Stopped,
    /// A collision, some time after it happened.
    Collision,
    /// The scenario's time is over.
    Timeout,
}

/// Outcome of a run: the first that applies in the order of `docs/conventions.md`.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The ego reached the end or the required stop, without a collision and without leaving the road.
    Avoided,
    /// The same, in a scenario without other actors.
    Completed,
    /// The ego hit something, regardless of anything else.
    Collision,
    /// Part of the ego left the drivable ground, without a collision.
    LeftRoad,
    /// The scenario timed out with the ego safely at rest, for one of the reasons in `docs/conventions.md`.
    Stopped,
    /// The scenario timed out before the ego reached its end.
    Timeout,
    /// The run ended before the scenario did.
    Unfinished,
}

impl Verdict {
    /// All verdicts.
    pub const ALL: [Self; 7] = [
        Self::Avoided,
        Self::Completed,
        Self::Collision,
        Self::LeftRoad,
        Self::Stopped,
        Self::Timeout,
        Self::Unfinished,
    ];
    /// All verdicts of a scenario that ran to its end.
    pub const OF_SCENARIOS: [Self; 6] =
        [Self::Avoided, Self::Completed, Self::Collision, Self::LeftRoad, Self::Stopped, Self::Timeout];

    /// Name in files and tables.
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

    /// Returns true if the ego reached its end or the required stop unharmed.
    pub fn is_success(self) -> bool {
        matches!(self, Self::Avoided | Self::Completed)
    }

    /// The verdict that older versions used for this outcome.
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

/// Actor hit by each point of the [`PointCloud`](crate::PointCloud) of the same stamp.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PointInstances {
    /// Stamp of the cloud.
    pub stamp: Time,
    /// Identity of the actor for each point, 0 for anything else.
    pub instance: Packed<u32>,
}

/// Sources of the detections of the [`RadarScan`](crate::RadarScan) of the same stamp.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct RadarSources {
    /// Stamp of the scan.
    pub stamp: Time,
    /// For each detection the actor with the largest share of the return; `None` for clutter.
    pub sources: Vec<Option<ActorId>>,
}

/// Everything visible to a sensor at one instant, and its pose: the whole input of an emulated detector.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Surroundings {
    /// Instant of the measurement.
    pub stamp: Time,
    /// True pose of the ego origin in the map.
    pub ego: Pose2,
    /// Visible actors, ordered by identity, in the map.
    pub obstacles: Vec<Obstacle>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn collisions_of_the_ego_and_of_others_are_told_apart() {
        let of = |parties: [u32; 2]| Collision {
            stamp: Time::ZERO,
            parties: parties.map(ActorId),
            impulse_n_s: 0.0,
            closing_speed_mps: 1.0,
            speeds_mps: [1.0, 0.0],
        };
        let zero = Vector::new(0.0, 0.0, 0.0);
        let world = WorldState {
            stamp: Time::ZERO,
            ego: EgoTruth {
                id: ActorId::EGO,
                map_from_ego: Transform::from_roll_pitch_yaw(
                    swerve_geom::Point::new(0.0, 0.0, 0.0),
                    0.0,
                    0.0,
                    0.0,
                ),
                state: EgoState::default(),
                velocity_mps: zero,
                specific_force_mps2: Vector::new(0.0, 0.0, 0.0),
                angular_velocity_radps: Vector::new(0.0, 0.0, 0.0),
            },
            actors: Vec::new(),
            collisions: vec![of([3, 4]), of([0, 3]), of([1, 3])],
            infractions: Vec::new(),
            ended: None,
        };
        let of_ego: Vec<_> =
            world.collisions_of_ego().map(|(other, hit)| (other.0, hit.parties[1].0)).collect();
        let of_others: Vec<_> = world.collisions_of_others().map(|hit| hit.parties.map(|id| id.0)).collect();
        assert_eq!((of_ego, of_others), (vec![(3, 3)], vec![[3, 4], [1, 3]]));
        let involving = |id| world.collisions.iter().filter(|hit| hit.involves(id)).count();
        assert_eq!([ActorId::EGO, ActorId(3), ActorId(4), ActorId(9)].map(involving), [1, 3, 1, 0]);
    }
}
