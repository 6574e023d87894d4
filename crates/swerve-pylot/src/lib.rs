//! The baselines of the paper (Gog et al., "Pylot: A Modular Platform for Exploring Latency-Accuracy Tradeoffs in
//! Autonomous Vehicles", ICRA 2021, arXiv 2104.07830): planners, predictor and following with the original's behaviour
//! and limits, and the posed problems that planners of different origin are compared on.
//!
//! The planners here search with the parts of `swerve-planning`, and differ in all around them: FOT builds every
//! candidate, RRT* takes the car for a point, Hybrid A* ends near its goal; none looks at the road, at the car's limits,
//! or at when it will be where more than at a constant speed. [`Preset`] is the word for either side in a configuration.

mod fot;
mod hybrid_astar;
pub mod posed;
mod preset;
mod replanner;
mod rrt_star;

pub use fot::Fot;
pub use hybrid_astar::{HybridAstar, HybridAstarParams};
pub use preset::Preset;
pub use rrt_star::{RrtStar, RrtStarParams};
