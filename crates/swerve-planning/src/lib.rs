//! Motion planning: from predictions and route to a plan.
//!
//! Every planner implements [`Planner::plan`], which takes a [`Request`] and a [`Budget`] and returns a plan.
//! Predictions are time-indexed: planners query the place of each obstacle at each instant. [`path`] holds the arcs,
//! straights and speed profiles that planners share; parts of a planner are public where a baseline is built from them.
//! The crate has no engine, simulator, files or clock.

pub mod aeb;
pub mod brake;
pub mod collision;
pub mod comfort;
mod cut_in;
pub mod deadline;
pub mod fallback;
mod following;
pub mod fot;
pub mod hybrid_astar;
mod lane;
mod lock;
pub mod occlusion;
mod passing;
pub mod path;
mod request;
mod road;
mod room;
pub mod rrt_star;
mod start;
mod steady_stop;
mod stop_wall;
pub mod testing;
mod traffic;
pub mod waypoint;

pub use collision::{CollisionMode, Obstacles, Solid};
pub use request::{Budget, Counted, Planner, Progress, Request, Unlimited};
pub use road::Road;
pub use start::predicted_start;
pub use stop_wall::stop_wall;
pub use traffic::Ahead;
