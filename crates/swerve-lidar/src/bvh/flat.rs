//! Hierarchies as words for compute shaders.

use super::{Bvh, LEAF};

/// Children and nodes of flat trees: bits of a link, the rest of which is an index.
pub(crate) mod link {
    /// Nothing is there.
    pub(crate) const NONE: u32 = u32::MAX;
    /// In a tree of instances: a leaf is one of these, not a block of triangles.
    pub(crate) const TOP: u32 = 1 << 30;
    /// Most nodes, leaves or instances of all flat trees together.
    pub(crate) const INDEX_MAX: usize = (1 << 29) - 1;
}

/// Words of a node of a flat tree: six times four bounds (smallest and largest x, y, z), four links.
pub(crate) const NODE_WORDS: usize = 28;
/// Stands for beyond everything in flat trees, so that nothing there overflows.
const BEYOND: f32 = 1e20;

impl Bvh {
    /// Adds the nodes as words for a compute shader and gives the link to the root. Links count nodes from
    /// `first_node`, leaves from `first_leaf`, and have the bits `set`.
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

    /// Nodes on the longest way from the root to a leaf; `memory` is lent.
    pub(crate) fn levels(&self, memory: &mut Vec<u32>) -> u32 {
        memory.clear();
        memory.resize(self.nodes.len(), 1);
        let mut most = 0;
        // Children come after their parents. Slots that are not used are leaves.
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
