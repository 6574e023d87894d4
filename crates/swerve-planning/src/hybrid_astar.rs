//! Hybrid A*: search over poses with drivable motions.
//!
//! Takes start pose, goal pose and obstacles (map frame, metres, radians); returns arcs and straights. The method is
//! that of D. Dolgov, S. Thrun, M. Montemerlo and J. Diebel, "Path planning for autonomous vehicles in unknown
//! semi-structured environments", 2010: a lattice of arcs pruned on a grid of position and heading; a heuristic that is
//! the maximum of the shortest path without obstacles and the distance around them for a point; an attempt to connect
//! each expanded pose to the goal; and shortcuts afterwards.

mod detour;
mod motions;
mod planner;
pub mod search;

pub use motions::fan;
pub use planner::{HybridAstar, Params};
