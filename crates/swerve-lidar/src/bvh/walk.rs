//! Traversal of a hierarchy by rays and packets.

use wide::f32x8;

use super::ray::{Packet, Ray, least};
use super::{Bvh, LEAF, build};

/// Largest number of stack entries: three siblings per level.
const STACK: usize = 3 * build::DEPTH_MAX + 4;

/// Reusable stack of a traversal.
pub(crate) struct Stack([(f32, u32, u32); STACK]);

impl Default for Stack {
    fn default() -> Self {
        Self([(0.0, 0, 0); STACK])
    }
}

impl Bvh {
    /// Calls `visit` with the leaves that a ray hits, near ones first, until none is left within reach.
    ///
    /// `visit` receives the leaf number and the current reach, and returns the new reach.
    #[inline(always)]
    pub(crate) fn walk(
        &self,
        ray: &Ray,
        mut reach: f32,
        stack: &mut Stack,
        mut visit: impl FnMut(u32, f32) -> f32,
    ) {
        let entries = &mut stack.0;
        let mut height = 0;
        let mut at = 0_u32;
        if self.nodes.is_empty() {
            return;
        }
        loop {
            if at & LEAF != 0 {
                reach = visit(at & !LEAF, reach);
            } else {
                let node = &self.nodes[at as usize];
                let (mut hits, near) = ray.meets(node, reach);
                if hits != 0 {
                    let near = near.to_array();
                    let first = (hits.trailing_zeros() & 3) as usize;
                    hits &= hits - 1;
                    let mut nearest = (near[first], node.child[first], 0);
                    let base = height;
                    while hits != 0 {
                        let next = (hits.trailing_zeros() & 3) as usize;
                        hits &= hits - 1;
                        let mut far = (near[next], node.child[next], 0);
                        if far.0 < nearest.0 {
                            core::mem::swap(&mut far, &mut nearest);
                        }
                        // Insertion sort, farthest at the bottom.
                        let mut place = height;
                        while place > base && entries[place - 1].0 < far.0 {
                            entries[place] = entries[place - 1];
                            place -= 1;
                        }
                        entries[place] = far;
                        height += 1;
                    }
                    at = nearest.1;
                    continue;
                }
            }
            loop {
                if height == 0 {
                    return;
                }
                height -= 1;
                let (near, next, _) = entries[height];
                if near <= reach {
                    at = next;
                    break;
                }
            }
        }
    }

    /// Traverses with a packet of rays, each with a separate reach; otherwise like [`Self::walk`].
    ///
    /// `visit` receives the leaf number, the bit mask of the rays that may hit something in it, and their reach.
    #[inline(always)]
    pub(crate) fn walk_packet(
        &self,
        packet: &Packet,
        reach: &mut f32x8,
        stack: &mut Stack,
        mut visit: impl FnMut(u32, u32, &mut f32x8),
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let entries = &mut stack.0;
        let mut farthest = -least(-*reach);
        let (mut height, mut at, mut rays) = (0, 0_u32, 0xff_u32);
        loop {
            if at & LEAF != 0 {
                visit(at & !LEAF, rays, reach);
                farthest = -least(-*reach);
            } else {
                let node = &self.nodes[at as usize];
                let base = height;
                let mut slots = packet.may_meet(node, farthest);
                while slots != 0 {
                    let slot = (slots.trailing_zeros() & 3) as usize;
                    slots &= slots - 1;
                    let (hits, near) = packet.meets(node, slot, *reach);
                    if hits == 0 {
                        continue;
                    }
                    let entry = (least(near), node.child[slot], hits);
                    let mut place = height;
                    while place > base && entries[place - 1].0 < entry.0 {
                        entries[place] = entries[place - 1];
                        place -= 1;
                    }
                    entries[place] = entry;
                    height += 1;
                }
            }
            loop {
                if height == 0 {
                    return;
                }
                height -= 1;
                let (near, next, hits) = entries[height];
                if near <= farthest {
                    (at, rays) = (next, hits);
                    break;
                }
            }
        }
    }
}
