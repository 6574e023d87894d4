//! Settings of a world in which SUMO moves the other road users.

use std::path::PathBuf;

/// A simulation of SUMO around the ego.
#[derive(Clone, PartialEq, Debug)]
pub struct SumoWorld {
    /// Its configuration (`.sumocfg`). It is not opened here.
    pub config: PathBuf,
    /// Simulated time of SUMO at its begin, seconds.
    pub begin_s: f64,
    /// Time that SUMO runs before the start of the run, seconds; at least a step.
    pub warmup_s: f64,
    /// Step of SUMO, seconds.
    pub step_s: f64,
    /// Distance from the ego up to which vehicles are in the world, metres.
    pub range_m: f64,
    /// Longest time of an answer, seconds.
    pub timeout_s: f64,
    /// Place of SUMO's net at the map's origin, metres.
    pub offset_m: [f64; 2],
}

impl SumoWorld {
    /// Default of [`warmup_s`](Self::warmup_s).
    pub const WARMUP_S: f64 = 60.0;
    /// Default of [`step_s`](Self::step_s).
    pub const STEP_S: f64 = 0.1;
    /// Default of [`range_m`](Self::range_m).
    pub const RANGE_M: f64 = 150.0;
    /// Default of [`timeout_s`](Self::timeout_s).
    pub const TIMEOUT_S: f64 = 60.0;
}
