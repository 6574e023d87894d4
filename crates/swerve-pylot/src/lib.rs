//! Baselines of the paper (Gog et al., "Pylot: A Modular Platform for Exploring Latency-Accuracy Tradeoffs in
//! Autonomous Vehicles", ICRA 2021, arXiv 2104.07830): planners, predictor and follower with the original's behaviour
//! and limits, and the posed problems on which planners of different origin are compared.
//!
//! The behaviour of the originals is described by [`Rules`]: each is a key with its source, and each can be switched
//! off. An [`Era`] names the rules of one moment. FOT searches with the parts of `swerve-planning`; RRT* treats the car
//! as a point, Hybrid A* ends near its goal. All drive at a constant or sampled speed, and none checks the road or the
//! car's limits. [`Preset`] selects the original's or our side in a configuration.

mod boxes;
mod closed_loop;
mod follower;
mod fot;
mod hybrid_astar;
mod lattice;
pub mod posed;
mod preset;
mod rrt_star;
mod rules;
mod tree;

pub use follower::Follower;
pub use fot::Fot;
pub use hybrid_astar::{HybridAstar, HybridAstarParams};
pub use preset::Preset;
pub use rrt_star::{RrtStar, RrtStarParams};
pub use rules::{Era, Fallback, Original, Rules, SpeedLaw, Waypoint};
