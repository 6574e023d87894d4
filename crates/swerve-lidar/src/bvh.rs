//! Bounding volume hierarchies with four children per node, and the walks of rays and packets through them.
//!
//! Built from the top by the surface area heuristic over sixteen bins (Wald, "On fast Construction of SAH-based
//! Bounding Volume Hierarchies", 2007); a set is halved until a node has its four children, the largest part
//! first. The boxes of the four lie side by side, so that one ray meets all of them in one test. A packet tests the
//! four against what bounds all of its rays first (interval arithmetic: Boulos, Wald, Shirley, "Geometric and
//! Arithmetic Culling Methods for Entire Ray Packets", 2006), and then its rays against those that are left.

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

/// Set in the number of a child that is a leaf.
const LEAF: u32 = 1 << 31;

/// Four boxes and what is in them.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Node {
    /// Of each axis: smallest and largest coordinates of the four.
    bounds: [[f32x4; 2]; 3],
    /// Nodes, or leaves if [`LEAF`] is set.
    child: [u32; 4],
}

impl Node {
    /// Four boxes that no ray meets.
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

/// A hierarchy over numbered leaves.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bvh {
    nodes: Vec<Node>,
}
