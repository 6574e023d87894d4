//! Motion planning: from predictions and route to a plan.
//!
//! Every planner is a struct with [`Planner::plan`]: state, [`Request`] and a [`Budget`] in, a plan out.
//! Predictions are time-indexed: planners ask where things are at each moment.
//! Absences: no engine, no simulator, no file, no clock.

pub mod hybrid_astar;
mod request;

pub use request::{Budget, Goes, Planner, Request, Unlimited};
