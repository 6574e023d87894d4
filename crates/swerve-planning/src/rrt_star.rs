//! RRT*: a rapidly exploring random tree that is rewired to short paths.
//!
//! Source: S. Karaman and E. Frazzoli, "Sampling-based algorithms for optimal motion planning", 2011, algorithm 6.

pub mod grid;
mod planner;
mod space;
pub mod tree;

pub use planner::{Params, RrtStar};
