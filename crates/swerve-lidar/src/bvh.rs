//! Bounding volume hierarchies with four children per node, and their traversal by rays and packets.
//!
//! Built top-down with the surface area heuristic over sixteen bins (Wald, "On fast Construction of SAH-based Bounding
//! Volume Hierarchies", 2007); a set is halved until a node has its four children, the largest part first. The boxes of
//! the four are stored side by side, so that a ray tests all of them at once. A packet tests the four against the
//! bounds of all of its rays first (interval arithmetic: Boulos, Wald, Shirley, "Geometric and Arithmetic Culling
//! Methods for Entire Ray Packets", 2006), and then its rays against the remaining ones.

mod aabb;
mod build;
mod flat;
mod ray;
mod walk;

pub(crate) use aabb::Aabb;
pub(crate) use build::Builder;
pub(crate) use flat::{NODE_WORDS, link};
pub(crate) use ray::{LANES, Packet, Ray};
pub(crate) use walk::Stack;

use wide::f32x4;

/// Bit of a child index that marks a leaf.
const LEAF: u32 = 1 << 31;

/// Four boxes and their contents.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Node {
    /// Smallest and largest coordinates of the four boxes, by axis.
    bounds: [[f32x4; 2]; 3],
    /// Indices of nodes, or of leaves if [`LEAF`] is set.
    child: [u32; 4],
}

impl Node {
    /// Four boxes that no ray hits.
    fn empty() -> Self {
        let never = [f32x4::splat(1e30), f32x4::splat(-1e30)];
        Self { bounds: [never; 3], child: [LEAF; 4] }
    }

    fn set(&mut self, slot: usize, aabb: &Aabb, child: u32) {
        for axis in 0..3 {
            for (side, value) in [(0, aabb.min[axis]), (1, aabb.max[axis])] {
                let mut lanes = self.bounds[axis][side].to_array();
                lanes[slot] = value;
                self.bounds[axis][side] = f32x4::new(lanes);
            }
        }
        self.child[slot] = child;
    }
}

/// Hierarchy over numbered leaves.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bvh {
    nodes: Vec<Node>,
}
