//! Lidar.

mod bvh;
mod scene_tree;
mod soup;

pub use scene_tree::{Hit, RayMemory, SceneTree, TreeError};
