//! Options of a run.

use serde::{Deserialize, Serialize};
use swerve_core::Time;

/// Options of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunOptions {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Number of threads of a run, including the engine's thread in virtual time. They execute steps of heavy operators
    /// and work that steps pass on; the result does not depend on them.
    pub threads: usize,
    /// Last instant, included; `None` to run until an operator stops the run or nothing is left to do.
    pub until: Option<Time>,
}

impl Default for RunOptions {
    fn default() -> Self {
        Self { seed: 0, threads: 1, until: None }
    }
}

impl RunOptions {
    /// Options for a run of one thread with seed 0, up to and including `until`.
    pub fn until(until: Time) -> Self {
        Self { until: Some(until), ..Self::default() }
    }

    /// Sets the seed.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Sets the number of threads.
    #[must_use]
    pub fn threads(mut self, threads: usize) -> Self {
        self.threads = threads;
        self
    }
}
