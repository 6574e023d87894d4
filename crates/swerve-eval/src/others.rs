//! Collisions between two others, which never count as the ego's.

use serde::{Deserialize, Serialize};
use swerve_msg::ActorId;
use swerve_msg::truth::{Collision, WorldState};

use crate::seconds;

/// A collision between two others.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct OthersImpact {
    /// Names of the two in the scenario.
    pub names: [String; 2],
    /// Instant of the first contact, seconds since the run started.
    pub at_s: f64,
    /// Closing speed along the contact normal just before, m/s.
    pub closing_speed_mps: f64,
}

impl OthersImpact {
    /// Sentence without a full stop: `a and b collided at 3.20 s`.
    pub fn words(&self) -> String {
        let [a, b] = &self.names;
        format!("{a} and {b} collided at {:.2} s", self.at_s)
    }
}

/// Accumulates the collisions between others.
#[derive(Clone, Default, Debug)]
pub(crate) struct Others {
    count: usize,
    first: Option<Collision>,
}

impl Others {
    /// Adds the world state after one step.
    pub(crate) fn take(&mut self, world: &WorldState) {
        for collision in world.collisions_of_others() {
            self.count += 1;
            if self.first.as_ref().is_none_or(|first| collision.stamp < first.stamp) {
                self.first = Some(collision.clone());
            }
        }
    }

    /// Number of collisions.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// First collision, with the names of its parties.
    pub(crate) fn first(&self, name: impl Fn(ActorId) -> String) -> Option<OthersImpact> {
        self.first.as_ref().map(|first| OthersImpact {
            names: first.parties.map(name),
            at_s: seconds(first.stamp),
            closing_speed_mps: first.closing_speed_mps,
        })
    }
}
