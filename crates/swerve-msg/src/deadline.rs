//! Deadlines of frames and the implementations selected to meet them.

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};

use crate::ActorId;

/// Time budget for the response to a sensor frame, and its division.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ResponseBudget {
    /// Stamp of the predictions from which it was computed.
    pub stamp: Time,
    /// Time until the ego, at its present motion, must begin to brake or swerve, seconds; negative once that is
    /// over, `None` if nothing is ahead.
    pub left_s: Option<f64>,
    /// Actor that determines this time; `None` without one.
    pub hazard: Option<ActorId>,
    /// True if the hazard is a possible actor hidden behind it rather than the hazard itself.
    pub hidden: bool,
    /// Number of nearby obstacles.
    pub obstacles: u32,
    /// Time from the sensor frame to its plan.
    pub response: Span,
    /// The detector's share of it, for frames to come.
    pub detector: Span,
    /// Time left for the planner, for this frame.
    pub planner: Span,
}

/// Rung of its ladder that an operator selected for a frame.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct RungTaken {
    /// Stamp of the frame.
    pub stamp: Time,
    /// Name of the rung.
    pub rung: String,
    /// Run time of the rung.
    pub run_time: Span,
    /// Time left until the deadline at the start of the step; `None` without a deadline.
    pub left: Option<Span>,
}
