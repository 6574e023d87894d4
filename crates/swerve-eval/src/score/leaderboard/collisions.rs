//! Which contacts count as collisions.
//!
//! Source: `CollisionTest` in `srunner/scenariomanager/scenarioatomics/atomic_criteria.py` of
//! `carla-simulator/scenario_runner`, branches `leaderboard-1.0` and `leaderboard-2.0`.

use swerve_geom::Point2;

use super::{Counts, Version};

/// Time for which the last party is remembered, seconds.
const SAME_PARTY_S: f64 = 5.0;
/// Distance from a collision within which others do not count, metres.
const NEAR_1_M: f64 = 3.0;
/// Same, for 2.x.
const NEAR_2_M: f64 = 5.0;
/// Distance at which 1.0 forgets the place of a collision, metres.
const FAR_1_M: f64 = 5.0;
/// Speed of the ego below which a collision is not its fault (2.x), m/s.
const STANDS_MPS: f64 = 0.1;

/// Kind of the other party of a collision.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Struck {
    /// A pedestrian.
    Pedestrian,
    /// A vehicle, two-wheelers included.
    Vehicle,
    /// A static object.
    Layout,
}

impl Struck {
    /// Adds one collision with this kind to the counts.
    pub fn count(self, counts: &mut Counts) {
        let count = match self {
            Self::Pedestrian => &mut counts.collisions_pedestrian,
            Self::Vehicle => &mut counts.collisions_vehicle,
            Self::Layout => &mut counts.collisions_layout,
        };
        *count += 1;
    }
}

/// A contact of the ego with another party.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Contact {
    /// Instant, seconds.
    pub at_s: f64,
    /// Identity of the other party; `None` for the static world, which CARLA gives the identity 0 and which is not
    /// remembered.
    pub other: Option<u64>,
    /// Position of the ego.
    pub ego: Point2,
    /// Speed of the ego, m/s.
    pub ego_speed_mps: f64,
}

/// Counter of collisions by the rules of one version.
#[derive(Clone, Debug)]
pub struct Collisions {
    version: Version,
    /// Last party, and the instant of its collision.
    last: Option<(u64, f64)>,
    /// Places of collisions that are not forgotten; in 2.x only the last one.
    places: Vec<Point2>,
}

impl Collisions {
    /// Creates a counter without collisions.
    pub fn new(version: Version) -> Self {
        Self { version, last: None, places: Vec::new() }
    }

    /// Forgets parties and places; called at every step of the drive, before its contacts.
    pub fn step(&mut self, at_s: f64, ego: Point2) {
        let far_m = if self.version.is_second() { NEAR_2_M } else { FAR_1_M };
        self.places.retain(|place| place.distance(ego) <= far_m);
        self.last = self.last.filter(|(_, since_s)| at_s - since_s <= SAME_PARTY_S);
    }

    /// Returns true if this contact counts as a collision.
    pub fn counts(&mut self, contact: &Contact) -> bool {
        let near_m = if self.version.is_second() { NEAR_2_M } else { NEAR_1_M };
        let is_same = contact.other.is_some() && self.last.map(|(other, _)| other) == contact.other;
        let is_near = || self.places.iter().any(|place| place.distance(contact.ego) <= near_m);
        let not_at_fault = self.version.is_second() && contact.ego_speed_mps < STANDS_MPS;
        if is_same || is_near() || not_at_fault {
            return false;
        }
        if self.version.is_second() {
            self.places.clear();
        }
        self.places.push(contact.ego);
        self.last = match contact.other {
            Some(other) => Some((other, contact.at_s)),
            // The instant is that of the newest collision, the party that of the newest one with an identity.
            None => self.last.map(|(other, _)| (other, contact.at_s)),
        };
        true
    }
}
