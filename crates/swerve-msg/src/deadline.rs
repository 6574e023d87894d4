use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};

use crate::ActorId;

/// How long the answer to a sensor frame may take, and how that is divided.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ResponseBudget {
    /// Stamp of the predictions that it was made from.
    pub stamp: Time,
    /// Time in which the ego, as it goes now, has to begin to brake or to swerve, seconds; negative when that is
    /// over, none where nothing is ahead.
    pub left_s: Option<f64>,
    /// What leaves so little time; none where nothing does.
    pub hazard: Option<ActorId>,
    /// Whether it is what may be hidden behind the hazard, not the hazard itself.
    pub hidden: bool,
    /// Things near by.
    pub obstacles: u32,
    /// From the sensor frame to its plan.
    pub response: Span,
    /// Of that, the detector's part for frames to come.
    pub detector: Span,
    /// What is left to the planner for this one.
    pub planner: Span,
}

/// Which rung of its ladder an operator took for a frame.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct RungTaken {
    /// Stamp of the frame.
    pub stamp: Time,
    /// The rung's name.
    pub rung: String,
    /// What it takes.
    pub run_time: Span,
    /// What was left until the deadline when the step started; none without deadline.
    pub left: Option<Span>,
}
