//! Stop lines.

use serde::{Deserialize, Serialize};

use crate::{LaneId, SignalId};

/// A line at which traffic of a lane stops if a signal or sign demands it.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct StopLine {
    /// The lane that it crosses.
    pub lane: LaneId,
    /// Arc length along the lane, metres.
    pub s_m: f64,
    /// Signals that apply to it, ordered by identity.
    #[serde(default)]
    pub signals: Vec<SignalId>,
    /// Sign or rule that applies without signals, or while they are off.
    #[serde(default)]
    pub sign: Option<StopSign>,
}

/// Sign or rule of a stop line.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopSign {
    /// Stop, then give way.
    Stop,
    /// Give way.
    Yield,
}

impl StopLine {
    /// Creates a stop line without signals and sign.
    pub const fn new(lane: LaneId, s_m: f64) -> Self {
        Self { lane, s_m, signals: Vec::new(), sign: None }
    }
}
