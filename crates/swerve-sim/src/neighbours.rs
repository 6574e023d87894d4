//! Pairs of actors that are near each other, step by step.

use swerve_geom::Point2;
use swerve_msg::truth::Actor;

use crate::contact::{are_near, near_pairs};

/// Distance between bounding circles up to which pairs are remembered, metres.
const REMEMBERED_M: f64 = 6.0;

/// Pairs that may come near each other before an actor has moved by half of the distance up to which they are remembered
/// (a list of neighbours, Verlet 1967): all pairs are looked at only then.
#[derive(Clone, Debug, Default)]
pub(crate) struct Neighbours {
    /// Pairs, as ordered indices, in order.
    pairs: Vec<[usize; 2]>,
    /// Places of all actors when the pairs were found.
    places: Vec<Point2>,
}

impl Neighbours {
    /// As [`near_pairs`], for actors whose sizes are those of the last call.
    pub(crate) fn near_pairs(&mut self, actors: &[Actor], within_m: f64) -> Vec<[usize; 2]> {
        // A reserve covers rounding errors.
        let least_m = 0.5 * (REMEMBERED_M - within_m) - 0.01;
        let stays = |(actor, place): (&Actor, &Point2)| {
            (actor.pose.point() - *place).norm_squared() < least_m * least_m
        };
        if self.places.len() != actors.len() || !actors.iter().zip(&self.places).all(stays) {
            self.pairs = near_pairs(actors, REMEMBERED_M);
            self.places = actors.iter().map(|actor| actor.pose.point()).collect();
        }
        let is_near = |[i, j]: &[usize; 2]| are_near(&actors[*i], &actors[*j], within_m);
        self.pairs.iter().copied().filter(is_near).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_core::Rng;
    use swerve_geom::{Pose2, Vector2};
    use swerve_msg::{ActorId, ActorKind, Extent};

    #[test]
    fn pairs_are_those_found_anew() {
        let mut rng = Rng::keyed(1, "neighbours", &[]);
        let mut actors: Vec<Actor> = (0..60)
            .map(|k| Actor {
                id: ActorId(k),
                kind: ActorKind::Car,
                pose: Pose2::new(rng.uniform(0.0, 90.0), rng.uniform(0.0, 90.0), rng.uniform(-3.0, 3.0)),
                z_m: 0.0,
                extent: Extent {
                    length_m: rng.uniform(0.5, 12.0),
                    width_m: rng.uniform(0.5, 2.5),
                    height_m: 1.5,
                },
                velocity_mps: Vector2::new(rng.uniform(-20.0, 20.0), rng.uniform(-20.0, 20.0)),
            })
            .collect();
        let (mut neighbours, mut found) = (Neighbours::default(), 0);
        for step in 0..600 {
            let pairs = neighbours.near_pairs(&actors, 0.1);
            assert_eq!(pairs, near_pairs(&actors, 0.1), "{step}");
            found += pairs.len();
            for actor in &mut actors {
                (actor.pose.x_m, actor.pose.y_m) = (
                    actor.pose.x_m + 0.01 * actor.velocity_mps.x,
                    actor.pose.y_m + 0.01 * actor.velocity_mps.y,
                );
                if !(0.0..90.0).contains(&actor.pose.x_m) {
                    actor.velocity_mps.x = -actor.velocity_mps.x;
                }
                if !(0.0..90.0).contains(&actor.pose.y_m) {
                    actor.velocity_mps.y = -actor.velocity_mps.y;
                }
            }
        }
        assert!(found > 1000, "{found}");
        // An actor that jumps, and one less.
        actors[7].pose = actors[9].pose;
        assert_eq!(neighbours.near_pairs(&actors, 0.1), near_pairs(&actors, 0.1));
        actors.pop();
        assert_eq!(neighbours.near_pairs(&actors, 0.1), near_pairs(&actors, 0.1));
    }
}
