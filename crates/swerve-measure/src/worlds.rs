//! Recent world states of a drive, in which sensor messages were measured.

use std::collections::VecDeque;

use swerve_core::Time;
use swerve_msg::truth::WorldState;

/// Number of states kept: longer than an image or a lidar turn can take to be published.
const KEPT: usize = 400;

/// Recent states, oldest first.
#[derive(Default)]
pub struct Worlds(VecDeque<WorldState>);

impl Worlds {
    /// Adds the next state.
    pub fn take(&mut self, world: &WorldState) {
        self.0.push_back(world.clone());
        if self.0.len() > KEPT {
            self.0.pop_front();
        }
    }

    /// Newest state not later than `at`.
    pub fn until(&self, at: Time) -> Option<&WorldState> {
        self.0.get(self.0.partition_point(|world| world.stamp <= at).checked_sub(1)?)
    }

    /// Newest state not later than `at`, or else the oldest.
    pub fn near(&self, at: Time) -> Option<&WorldState> {
        self.until(at).or(self.0.front())
    }
}
