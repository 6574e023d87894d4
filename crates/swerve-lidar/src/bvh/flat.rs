//! Serialisation of hierarchies to words for compute shaders.

use super::{Bvh, LEAF};

/// Link bits of children and nodes in flat trees; the other bits are an index.
pub(crate) mod link {
    /// Empty slot.
    pub(crate) const NONE: u32 = u32::MAX;
    /// In a tree of instances: the leaf is an instance, not a block of triangles.
    pub(crate) const TOP: u32 = 1 << 30;
    /// Largest number of nodes, leaves or instances of all flat trees together.
    pub(crate) const INDEX_MAX: usize = (1 << 29) - 1;
}

/// Words of a node of a flat tree: six times four bounds (smallest and largest x, y, z), four links.
pub(crate) const NODE_WORDS: usize = 28;
/// Replacement for infinite bounds in flat trees, which avoids overflow in the shader.
const BEYOND: f32 = 1e20;

impl Bvh {
    /// Appends the nodes as words for a compute shader and returns the link to the root. Node links are relative to
    /// `first_node`, leaf links to `first_leaf`; all have the bits `set`.
    pub(crate) fn flatten(&self, words: &mut Vec<u32>, first_node: u32, first_leaf: u32, set: u32) -> u32 {
        for node in &self.nodes {
            for side in node.bounds.iter().flatten() {
                words.extend(side.to_array().map(|bound| bound.clamp(-BEYOND, BEYOND).to_bits()));
            }
            words.extend(node.child.map(|child| {
                if child & LEAF != 0 {
                    LEAF | set | (first_leaf + (child & !LEAF))
                } else {
                    set | (first_node + child)
                }
            }));
        }
        if self.nodes.is_empty() { link::NONE } else { set | first_node }
    }

    /// Number of nodes on the longest path from the root to a leaf; `memory` is scratch.
    pub(crate) fn levels(&self, memory: &mut Vec<u32>) -> u32 {
        memory.clear();
        memory.resize(self.nodes.len(), 1);
        let mut most = 0;
        // Children follow their parents. Unused slots are leaves.
        for (at, node) in self.nodes.iter().enumerate() {
            let level = memory[at];
            most = most.max(level);
            for child in node.child.into_iter().filter(|child| child & LEAF == 0) {
                memory[child as usize] = level + 1;
            }
        }
        most
    }
}
