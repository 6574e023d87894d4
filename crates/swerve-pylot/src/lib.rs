//! The baselines of the paper (Gog et al., "Pylot: A Modular Platform for Exploring Latency-Accuracy Tradeoffs in
//! Autonomous Vehicles", ICRA 2021, arXiv 2104.07830): planners, predictor and following with the original's behaviour
//! and limits, and the posed problems that planners of different origin are compared on.
//!
//! The planners here search with the parts of `swerve-planning`, and differ in all around them: FOT builds every
//! candidate, RRT* takes the car for a point, Hybrid A* ends near its goal. All drive at a constant speed or a sampled
//! one, and none looks at the road or at the car's limits. [`Preset`] is the word for either side in a configuration.

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
