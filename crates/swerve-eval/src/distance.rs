//! Minimum distances between the ego and each actor.

use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::{Obb, Pose2};
use swerve_msg::truth::{Actor, WorldState};
use swerve_msg::{ActorId, ActorKind};

use crate::ground;

/// The ego's outline around its origin, the centre of the rear axle on the ground.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Outline {
    /// Overall length, metres.
    pub length_m: f64,
    /// Overall width, metres.
    pub width_m: f64,
    /// Distance from the origin forward to the centre of the outline, metres.
    pub center_ahead_m: f64,
}

impl Outline {
    /// Rectangle covered by the ego with its origin at `pose`.
    pub fn footprint(&self, pose: Pose2) -> Obb {
        Obb::new(pose.ahead(self.center_ahead_m), self.length_m, self.width_m)
    }
}

/// Minimum distance between the ego and one actor.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Clearance {
    /// The actor.
    pub actor: ActorId,
    /// Kind of road user or object.
    pub kind: ActorKind,
    /// Smallest distance between the outlines, metres; zero on contact.
    pub distance_m: f64,
    /// The first instant of that distance.
    pub at: Time,
}

/// Smallest distance between the ego's outline and each actor, over the world states added.
///
/// Outlines are exact: a pedestrian is a circle with half its width as radius, everything else an oriented rectangle.
/// An actor with a reported collision has distance zero, whatever the sampled poses.
#[derive(Clone, Debug)]
pub struct Clearances {
    ego: Outline,
    nearest: Vec<Clearance>,
}

impl Clearances {
    /// Creates an accumulator for an ego of the given outline.
    pub fn new(ego: Outline) -> Self {
        Self { ego, nearest: Vec::new() }
    }

    /// Adds the world state after one step.
    pub fn take(&mut self, world: &WorldState) {
        let footprint = self.ego.footprint(world.ego.state.pose);
        for (index, actor) in world.actors.iter().enumerate() {
            let slot = self.slot(index, actor);
            let known_m = self.nearest[slot].distance_m;
            let hit = world.collisions_of_ego().any(|(other, _)| other == actor.id);
            let distance_m = if hit { 0.0 } else { distance(&footprint, actor, known_m) };
            if distance_m < known_m {
                self.nearest[slot].distance_m = distance_m;
                self.nearest[slot].at = world.stamp;
            }
        }
    }

    /// Minimum distance to each actor, in order of actor id.
    pub fn each(&self) -> &[Clearance] {
        &self.nearest
    }

    /// Smallest distance of all; of equal ones the earliest.
    pub fn smallest(&self) -> Option<Clearance> {
        let order =
            |a: &&Clearance, b: &&Clearance| a.distance_m.total_cmp(&b.distance_m).then(a.at.cmp(&b.at));
        self.nearest.iter().min_by(order).copied()
    }

    /// Place of an actor, which is mostly that in the list of all actors.
    fn slot(&mut self, index: usize, actor: &Actor) -> usize {
        if self.nearest.get(index).is_some_and(|known| known.actor == actor.id) {
            return index;
        }
        match self.nearest.binary_search_by_key(&actor.id, |c| c.actor) {
            Ok(slot) => slot,
            Err(slot) => {
                let distance_m = f64::INFINITY;
                let new = Clearance { actor: actor.id, kind: actor.kind, distance_m, at: Time::ZERO };
                self.nearest.insert(slot, new);
                slot
            }
        }
    }
}

/// Distance from the ego's footprint to an actor; returns `known_m` early if it cannot be smaller.
fn distance(ego: &Obb, actor: &Actor, known_m: f64) -> f64 {
    let footprint = actor.footprint();
    if ego.is_beyond(&footprint, known_m) {
        return known_m;
    }
    let circle = actor.kind == ActorKind::Pedestrian;
    let half_m = 0.5 * actor.extent.width_m;
    let reach_m = if circle { half_m } else { footprint.radius() };
    if ego.center.point().distance(actor.pose.point()) - ego.radius() - reach_m >= known_m {
        return known_m;
    }
    let ego = ground::rectangle(ego);
    if circle {
        ego.distance_m(&ground::circle(actor.pose, half_m))
    } else {
        ego.distance_m(&ground::rectangle(&footprint))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::tests::{actor, hit, world};

    const EGO: Outline = Outline { length_m: 4.93, width_m: 1.86, center_ahead_m: 1.425 };

    #[test]
    fn pedestrian_is_a_circle_and_car_a_rectangle() {
        let mut clearances = Clearances::new(EGO);
        // Front left corner of the ego at (3.89, 0.93); both actors 3 m ahead and 4 m left of it.
        let (x, y) = (3.89 + 3.0, 0.93 + 4.0);
        let mut state = world(0, 0.0);
        state.actors = vec![
            actor(1, ActorKind::Pedestrian, Pose2::new(x, y, 0.3), 0.5, 0.5),
            actor(2, ActorKind::Car, Pose2::new(x + 2.0, y + 1.0, 0.0), 4.0, 2.0),
        ];
        clearances.take(&state);
        let [person, car] = clearances.each() else { panic!("two actors") };
        assert!((person.distance_m - 4.75).abs() < 1e-12, "{person:?}");
        assert!((car.distance_m - 5.0).abs() < 1e-12, "{car:?}");
        assert_eq!(clearances.smallest().map(|c| c.actor), Some(ActorId(1)));
    }

    #[test]
    fn smallest_distance_of_a_pass_keeps_its_instant() {
        let mut clearances = Clearances::new(EGO);
        for k in 0..200 {
            let mut state = world(i64::from(k) * 50, f64::from(k) * 0.5);
            state.actors = vec![actor(7, ActorKind::Pedestrian, Pose2::new(50.0, 2.0, 0.0), 0.5, 0.5)];
            clearances.take(&state);
        }
        let nearest = clearances.smallest().unwrap();
        // Alongside once the front end reaches x = 50: 46.11 m, i.e. at the 93rd half metre.
        assert!((nearest.distance_m - (2.0 - 0.93 - 0.25)).abs() < 1e-12);
        assert_eq!(nearest.at, Time::from_ms(93 * 50));
    }

    #[test]
    fn reported_contact_counts_as_touching() {
        let mut clearances = Clearances::new(EGO);
        let mut state = world(5, 10.0);
        state.actors = vec![actor(1, ActorKind::Car, Pose2::new(17.0, 0.0, 0.0), 4.0, 2.0)];
        state.collisions = vec![hit(5, 1)];
        clearances.take(&state);
        assert_eq!(clearances.smallest().map(|c| c.distance_m), Some(0.0));
    }

    #[test]
    fn early_exit_matches_the_full_computation() {
        let mut clearances = Clearances::new(EGO);
        let mut smallest = f64::INFINITY;
        for k in 0..400 {
            let mut state = world(i64::from(k), f64::from(k % 97));
            let at = Pose2::new(f64::from(k * 31 % 89), f64::from(k * 17 % 23) - 11.5, f64::from(k) * 0.1);
            let other = actor(1, ActorKind::Truck, at, 5.2, 2.6);
            let ego = ground::rectangle(&EGO.footprint(state.ego.state.pose));
            smallest = smallest.min(ego.distance_m(&ground::rectangle(&other.extent.footprint(other.pose))));
            state.actors = vec![other];
            clearances.take(&state);
            assert_eq!(clearances.each()[0].distance_m, smallest, "{k}");
        }
    }
}
