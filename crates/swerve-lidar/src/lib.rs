//! Spinning lidars, and the acceleration trees over the scene for their rays.
//!
//! ```text
//! Scene ─> SceneTree::update (once per step) ──┐
//! LidarSpec ─> Sweeper::begin_turn ─> Sweeper::fire (once per step) ─> Cloud (and truth)
//!      or   ─> Sweeper::submit (once per step) ─> Sweeper::collect (a step later) ─> Cloud (and truth)
//! ```
//!
//! A turn is fired in pieces: [`Sweeper::fire`] casts the columns whose instants are within one step of the world
//! against the scene of that step, each from the sensor's pose at the instant of the column. The points of a turn are
//! therefore distorted by motion like those of a real sensor.
//!
//! **Frame.** `Lidar` of `swerve-geom`: x forward, y left, z up, with the origin at the common point of all beams.
//!
//! **Guarantees.** The points are a function of the specification, the turn number, the poses and the scene:
//! independent of the number of threads, of the division of a turn into pieces of the same poses, and of the x86-64
//! machine. Noise is a hash of seed, turn, column and beam. A turn into used memory allocates nothing that grows with
//! it. On a GPU ([`Sweeper::on_gpu`]) the points are the same up to rounding, which depends on the machine.

#![cfg_attr(not(feature = "gpu"), allow(dead_code, reason = "without the feature, its helpers are unused"))]

mod bvh;
mod cloud;
#[cfg(feature = "gpu")]
mod gpu;
#[cfg(not(feature = "gpu"))]
#[path = "no_gpu.rs"]
mod gpu;
mod presets;
mod returns;
mod scene_tree;
mod soup;
mod spec;
mod sweeper;

pub use cloud::{Cloud, CloudMut, CloudSizeError, TruthMut};
pub use presets::{LidarPreset, UnknownLidar};
pub use scene_tree::{Hit, RayMemory, SceneTree, TreeError};
pub use spec::{Beam, LidarSpec};
pub use sweeper::{FireError, Fired, Firing, LidarEngine, Sweeper};

#[cfg(test)]
mod tests;
