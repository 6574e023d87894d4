//! Hybrid A*: search over poses with motions that a car can drive.
//!
//! Start pose, goal pose, obstacles (map frame, metres, radians) in; arcs and straights out. The method is that
//! of D. Dolgov, S. Thrun, M. Montemerlo and J. Diebel, "Path planning for autonomous vehicles in unknown
//! semi-structured environments", 2010: a lattice of arcs pruned on a grid of position and heading, an estimate
//! that is the greater of the shortest path without obstacles and the way around them for a point, a try at the
//! goal from every pose that is looked at, shortcuts afterwards.

mod detour;
mod motions;
mod planner;
pub mod search;

pub use motions::fan;
pub use planner::{HybridAstar, Params};
