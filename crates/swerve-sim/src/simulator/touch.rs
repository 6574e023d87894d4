//! Contacts in a step.

use swerve_geom::Obb;
use swerve_msg::truth::{Actor, Collision};
use swerve_msg::{ActorId, ActorKind};

use super::{Before, Simulator};
use crate::bodies::{self, Mode};
use crate::contact;
use crate::contacts::{PARTED_M, PATIENCE, Touch};

impl Simulator {
    pub(super) fn touches_loose(&self, i: usize) -> bool {
        let (_, own) = self.body(i);
        (0..self.state.actors.len()).filter(|&j| j != i).any(|j| {
            let (mode, other) = self.body(j);
            mode == Mode::Hit && bodies::impulse_n_s(&self.world, own, other) > 0.0
        })
    }

    /// Updates the contact between the first ego and actor or ego `i`; returns true if they touch in this step.
    pub(super) fn contact(&mut self, i: usize, before: &Before, outline: &Obb) -> bool {
        let actor = &self.state.actors[i];
        let parties = [ActorId::EGO, actor.id];
        if !near(outline, actor, 2.0 * PARTED_M) && !self.contacts.contains(parties) {
            return false;
        }
        let (_, collider) = self.body(i);
        let impulse_n_s = bodies::impulse_n_s(&self.world, self.egos[0].car.collider(), collider);
        let touch = Touch { gap_m: actor.gap_m(outline), impulse_n_s };
        let (earlier, horizon_s) = (&before.actors[i], self.horizon_s());
        let stamp = self.state.stamp;
        let collision = self.contacts.update((parties, stamp), touch, PATIENCE, || Collision {
            stamp,
            parties,
            impulse_n_s: 0.0,
            closing_speed_mps: contact::closing_speed(&before.outline, &before.motion, earlier, horizon_s),
            speeds_mps: [before.speed_mps, earlier.velocity_mps.norm()],
        });
        self.state.collisions.extend(collision);
        touch.is_contact()
    }

    /// Updates the contacts between actors, once all of them have moved. Two that both rest cannot begin to touch.
    pub(super) fn contacts_of_others(&mut self, before: &Before) {
        let actors = &self.state.actors;
        let has_moved = |i: usize| actors[i].pose != before.actors[i].pose;
        let mut pairs = Vec::new();
        if (0..actors.len()).any(has_moved) {
            pairs = self.neighbours.near_pairs(actors, PARTED_M);
            pairs.retain(|pair| pair.iter().any(|&i| has_moved(i)));
        }
        let index = |id: ActorId| actors.binary_search_by_key(&id, |actor| actor.id).ok();
        pairs.extend(self.contacts.parties().filter_map(|[a, b]| Some([index(a)?, index(b)?])));
        // People who touch each other do not collide.
        let is_vehicle = |i: usize| actors[i].kind != ActorKind::Pedestrian;
        pairs.retain(|pair| pair.iter().any(|&i| is_vehicle(i)));
        pairs.sort_unstable();
        pairs.dedup();
        for pair in pairs {
            self.contact_of_others(pair, before);
        }
    }

    /// Updates the contact between two actors, given by their indices.
    fn contact_of_others(&mut self, pair: [usize; 2], before: &Before) {
        let (stamp, horizon_s) = (self.state.stamp, self.horizon_s());
        let [(mode_a, a), (mode_b, b)] = pair.map(|i| self.body(i));
        // Drivers do not feel impulses: only bodies that physics moves exert them.
        let are_driven = mode_a != Mode::Hit && mode_b != Mode::Hit;
        let impulse_n_s = if are_driven { 0.0 } else { bodies::impulse_n_s(&self.world, a, b) };
        let patience = if are_driven { 0 } else { PATIENCE };
        let [a, b] = pair.map(|i| &self.state.actors[i]);
        let parties = [a.id, b.id];
        let touch = Touch { gap_m: contact::gap_of_actors_m(a, b), impulse_n_s };
        let collision = self.contacts.update((parties, stamp), touch, patience, || {
            let [a, b] = pair.map(|i| &before.actors[i]);
            Collision {
                stamp,
                parties,
                impulse_n_s: 0.0,
                closing_speed_mps: contact::closing_speed_of_actors(a, b, horizon_s),
                speeds_mps: [a, b].map(|actor| actor.velocity_mps.norm()),
            }
        });
        self.state.collisions.extend(collision);
    }

    /// Time ahead of a step within which a contact in it begins, seconds.
    fn horizon_s(&self) -> f64 {
        2.0 * self.params.dt.as_secs()
    }
}

/// True if the bounding circles of the two come within `reach_m` of each other.
pub(super) fn near(outline: &Obb, actor: &Actor, reach_m: f64) -> bool {
    let footprint = actor.footprint();
    if outline.is_beyond(&footprint, reach_m) {
        return false;
    }
    let squared_m2 = (outline.center.point() - actor.pose.point()).norm_squared();
    let radius = outline.radius() + footprint.radius() + reach_m;
    squared_m2 <= radius * radius
}
