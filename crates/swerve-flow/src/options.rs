//! How to run a graph.

use serde::{Deserialize, Serialize};
use swerve_core::Time;

/// How to run a graph.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunOptions {
    /// Decides everything random.
    pub seed: u64,
    /// How many threads do the work of the run, the engine's own among them in virtual time: steps of heavy operators,
    /// and what steps leave to others; shows in no result.
    pub threads: usize,
    /// The last instant, itself included; none: until an operator stops the run or nothing is left to do.
    pub until: Option<Time>,
}

impl Default for RunOptions {
    fn default() -> Self {
        Self { seed: 0, threads: 1, until: None }
    }
}

impl RunOptions {
    /// A run of one thread with seed 0 up to and including `until`.
    pub fn until(until: Time) -> Self {
        Self { until: Some(until), ..Self::default() }
    }

    /// The same under another seed.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// The same on this many threads.
    #[must_use]
    pub fn threads(mut self, threads: usize) -> Self {
        self.threads = threads;
        self
    }
}
