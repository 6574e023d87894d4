//! Spinning lidars, and the trees over the scene that their rays go through.
//!
//! ```text
//! Scene ─> SceneTree::update (once per step) ──┐
//! LidarSpec ─> Sweeper::begin_turn ─> Sweeper::fire (once per step) ─> Cloud (and truth)
//!      or   ─> Sweeper::submit (once per step) ─> Sweeper::collect (a step later) ─> Cloud (and truth)
//! ```
//!
//! A turn is fired in pieces: [`Sweeper::fire`] casts the columns whose instants fall into one step of the world
//! against the scene of that step, each from the sensor's pose at its own instant. The points of a turn are
//! therefore distorted by motion as those of a real sensor are.
//!
//! **Frame.** `Lidar` of `swerve-geom`: x forward, y left, z up, at the point where all beams meet.
//!
//! **Promises.** The points are a function of the specification, the turn's number, the poses and the scene: not
//! of the number of threads, of how a turn is cut into pieces of the same poses, or of the x86-64 machine. Noise
//! is a hash of seed, turn, column and beam. A turn into used memory allocates nothing that grows with it. On a GPU
//! ([`Sweeper::on_gpu`]) the points are the same up to rounding, and the machine has a say in that.

mod bvh;
mod cloud;
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
