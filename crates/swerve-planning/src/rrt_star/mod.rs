//! RRT*: a tree grown at random and kept short.
//!
//! Source: S. Karaman and E. Frazzoli, "Sampling-based algorithms for optimal motion planning", 2011, algorithm 6.

mod bend;
mod boxes;
mod grid;
mod planner;
mod round;
mod solve;
mod space;
mod tree;

pub use planner::{Params, RrtStar};
pub use solve::{ITERATIONS_PER_MS, Solver, solve_posed};
