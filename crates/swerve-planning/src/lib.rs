//! Motion planning: from predictions and route to a plan.
//!
//! Every planner is a struct with [`Planner::plan`]: state, [`Request`] and a [`Budget`] in, a plan out.
//! Predictions are time-indexed: planners ask where things are at each moment.
//! Absences: no engine, no simulator, no file, no clock.

pub mod aeb;
pub mod collision;
pub mod deadline;
pub mod fot;
pub mod hybrid_astar;
pub mod posed;
mod request;
mod road;
pub mod rrt_star;
#[cfg(test)]
mod testing;
pub mod waypoint;
pub mod world;

pub use collision::{CollisionMode, Obstacles, Solid};
pub use posed::{Preset, Solution};
pub use request::{Budget, Goes, Planner, Request, Unlimited};
pub use road::Road;
