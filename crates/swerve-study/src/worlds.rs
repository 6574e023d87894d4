//! The newest states of a drive's world: what a sensor's message was measured in.

use std::collections::VecDeque;

use swerve_core::Time;
use swerve_msg::truth::WorldState;

/// How many are kept: more than an image or a lidar's turn can take to be published.
const KEPT: usize = 400;

/// The newest states, oldest first.
#[derive(Default)]
pub(crate) struct Worlds(VecDeque<WorldState>);

impl Worlds {
    /// Takes in the next one.
    pub(crate) fn take(&mut self, world: &WorldState) {
        self.0.push_back(world.clone());
        if self.0.len() > KEPT {
            self.0.pop_front();
        }
    }

    /// The newest that is no later than `at`.
    pub(crate) fn until(&self, at: Time) -> Option<&WorldState> {
        self.0.get(self.0.partition_point(|world| world.stamp <= at).checked_sub(1)?)
    }

    /// The same, or else the oldest.
    pub(crate) fn near(&self, at: Time) -> Option<&WorldState> {
        self.until(at).or(self.0.front())
    }
}
