//! Road users of another simulator: they come, are moved by it, and go.

use swerve_core::Time;
use swerve_msg::ActorId;
use swerve_msg::truth::Actor;
use swerve_world::{Driver, Movement, Other, Others, OthersError, View};

use super::{Player, Simulator};
use crate::bodies::{Body, Mode};
use crate::neighbours::Neighbours;

/// The other simulator, and its error if it has failed.
pub(super) struct Outside {
    others: Box<dyn Others>,
    pub(super) failure: Option<OthersError>,
    /// Smallest identity of its road users.
    first: ActorId,
}

/// Driver of a road user of the other simulator for one step.
struct Led {
    from: (Time, Movement),
    to: Movement,
}

impl Driver for Led {
    fn observe(&mut self, _: &View<'_>) {}

    fn movement(&self, _: Time, to: Time) -> Option<Movement> {
        Some(if to == self.from.0 { self.from.1 } else { self.to })
    }
}

impl Simulator {
    /// Adds another simulator, which moves road users with identities from `first` on. It is asked for the first time in
    /// [`World::start`](swerve_world::World::start).
    ///
    /// `first` is greater than the identities of the scenario, and the scenario has one ego.
    pub fn set_others(&mut self, others: Box<dyn Others>, first: ActorId) {
        self.outside = Some(Outside { others, failure: None, first });
    }

    /// Moves, adds and removes the road users of the other simulator for the step that ends at `until`; false if it has
    /// failed.
    pub(super) fn lead(&mut self, until: Time) -> bool {
        let outline = self.outline();
        let Some(outside) = &mut self.outside else { return true };
        if outside.failure.is_some() {
            return false;
        }
        let first = outside.first;
        let others = match outside.others.at(until, &self.state.ego, &outline) {
            Ok(others) => others.to_vec(),
            Err(error) => {
                outside.failure = Some(error);
                return false;
            }
        };
        self.remove_absent(&others, first);
        for other in others {
            self.lead_one(&other, until);
        }
        true
    }

    /// Removes those that have gone. Those that were hit stay: physics moves them.
    fn remove_absent(&mut self, others: &[Other], first: ActorId) {
        for i in (0..self.actors.len()).rev() {
            let id = self.state.actors[i].id;
            let is_there = || others.binary_search_by_key(&id, |other| other.id).is_ok();
            if id < first || self.actors[i].body.mode == Mode::Hit || is_there() {
                continue;
            }
            let player = self.actors.remove(i);
            self.state.actors.remove(i);
            self.world.remove_body(player.body.handle);
            self.neighbours = Neighbours::default();
        }
    }

    /// Leads a road user to its place at `until`; adds it if it is new.
    fn lead_one(&mut self, other: &Other, until: Time) {
        let stamp = self.state.stamp;
        let found = self.state.actors.binary_search_by_key(&other.id, |actor| actor.id);
        let i = found.unwrap_or_else(|i| {
            self.insert(i, other);
            i
        });
        let actor = &self.state.actors[i];
        let now = Movement { pose: actor.pose, velocity_mps: actor.velocity_mps };
        let from = if stamp == until { other.movement } else { now };
        self.actors[i].driver = Box::new(Led { from: (stamp, from), to: other.movement });
    }

    fn insert(&mut self, i: usize, other: &Other) {
        let Other { id, kind, extent, movement } = other.clone();
        let point = movement.pose.point();
        let z_m = self.scenario.road.ground_m(point, 0.0);
        let (pose, velocity_mps) = (movement.pose, movement.velocity_mps);
        let actor = Actor { id, kind, pose, z_m, extent, velocity_mps };
        let mass_kg = swerve_scenario::Actor::at_rest(id, String::new(), kind, extent, pose).mass_kg;
        let body = Body::insert(&mut self.world, &actor, mass_kg);
        let driver = Box::new(Led { from: (self.state.stamp, movement), to: movement });
        self.actors.insert(i, Player { body, driver, s_m: 0.0, ground: Some((point, z_m)), is_away: false });
        self.state.actors.insert(i, actor);
        self.neighbours = Neighbours::default();
    }
}
