//! Construction of hierarchies from boxes.

use core::cmp::Ordering;

use super::aabb::Aabb;
use super::{Bvh, LEAF, Node};

/// Bins per axis.
const BINS: usize = 16;
/// Depth from which sets are halved by count, which bounds the depth for any input, see [`DEPTH_MAX`].
const DEPTH_SAH: u32 = 14;
/// Largest depth: [`DEPTH_SAH`], plus two halvings per level of at most 2^32 items.
pub(crate) const DEPTH_MAX: usize = DEPTH_SAH as usize + 17;

/// Set of items that becomes a node or a leaf.
#[derive(Clone, Copy)]
struct Part {
    from: u32,
    to: u32,
    bounds: Aabb,
}

impl Part {
    fn len(&self) -> usize {
        (self.to - self.from) as usize
    }
}

/// Node whose children are not yet created, and its items.
#[derive(Clone, Copy, Debug)]
struct Task {
    node: u32,
    from: u32,
    to: u32,
    depth: u32,
}

/// Builds hierarchies; reuses its buffers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Builder {
    /// Boxes of the items, filled in by the caller.
    pub(crate) boxes: Vec<Aabb>,
    order: Vec<u32>,
    leaves: Vec<(u32, u32)>,
    work: Vec<Task>,
}

impl Builder {
    /// Items of each leaf, by leaf number.
    pub(crate) fn leaves(&self) -> impl Iterator<Item = &[u32]> {
        self.leaves.iter().map(|&(from, to)| &self.order[from as usize..to as usize])
    }

    /// Builds the hierarchy over [`Self::boxes`] with at most `most` items in a leaf.
    pub(crate) fn build(&mut self, bvh: &mut Bvh, most: usize) {
        let count = self.boxes.len() as u32;
        self.order.clear();
        self.order.extend(0..count);
        self.leaves.clear();
        self.work.clear();
        bvh.nodes.clear();
        if count == 0 {
            return;
        }
        bvh.nodes.push(Node::empty());
        self.work.push(Task { node: 0, from: 0, to: count, depth: 0 });
        while let Some(Task { node, from, to, depth }) = self.work.pop() {
            let mut parts = [self.part(from, to); 4];
            let used = self.split_in_four(&mut parts, most, depth);
            for (slot, part) in parts[..used].iter().enumerate().rev() {
                let child = if part.len() <= most {
                    self.leaves.push((part.from, part.to));
                    LEAF | (self.leaves.len() as u32 - 1)
                } else {
                    bvh.nodes.push(Node::empty());
                    let child = bvh.nodes.len() as u32 - 1;
                    self.work.push(Task { node: child, from: part.from, to: part.to, depth: depth + 1 });
                    child
                };
                bvh.nodes[node as usize].set(slot, &part.bounds, child);
            }
        }
    }

    fn part(&self, from: u32, to: u32) -> Part {
        let mut bounds = Aabb::NONE;
        for &item in &self.order[from as usize..to as usize] {
            bounds.join(&self.boxes[item as usize]);
        }
        Part { from, to, bounds }
    }

    /// Halves the largest part until there are four, or no part can be halved; returns their number.
    fn split_in_four(&mut self, parts: &mut [Part; 4], most: usize, depth: u32) -> usize {
        let mut used = 1;
        while used < 4 {
            let splits = |part: &Part| part.len() > most;
            let largest = (0..used).filter(|&k| splits(&parts[k])).max_by(|&a, &b| {
                let key = |k: usize| {
                    if depth < DEPTH_SAH { parts[k].bounds.area() } else { parts[k].len() as f32 }
                };
                key(a).total_cmp(&key(b)).then(b.cmp(&a))
            });
            let Some(k) = largest else { break };
            let middle = self.split(&parts[k], depth);
            let (from, to) = (parts[k].from, parts[k].to);
            parts[k] = self.part(from, middle);
            parts[used] = self.part(middle, to);
            used += 1;
        }
        used
    }

    /// Partitions the items of a part into two halves; returns the start of the second.
    fn split(&mut self, part: &Part, depth: u32) -> u32 {
        let mut centres = Aabb::NONE;
        for &item in &self.order[part.from as usize..part.to as usize] {
            let aabb = &self.boxes[item as usize];
            centres.add([aabb.centre(0), aabb.centre(1), aabb.centre(2)]);
        }
        let plane = if depth < DEPTH_SAH { self.cheapest(part, &centres) } else { None };
        let boxes = &self.boxes;
        let items = &mut self.order[part.from as usize..part.to as usize];
        let Some((axis, bin)) = plane else {
            let sides = centres.sides();
            let axis = (0..3).max_by(|&a, &b| sides[a].total_cmp(&sides[b])).unwrap_or(0);
            items.sort_unstable_by(|&a, &b| {
                let (at_a, at_b) = (boxes[a as usize].centre(axis), boxes[b as usize].centre(axis));
                at_a.total_cmp(&at_b).then(a.cmp(&b))
            });
            return part.from + items.len() as u32 / 2;
        };
        let scale = bin_scale(&centres, axis);
        let mut left = 0;
        for k in 0..items.len() {
            if bin_of(boxes[items[k] as usize].centre(axis), centres.min[axis], scale) < bin {
                items.swap(left, k);
                left += 1;
            }
        }
        part.from + left as u32
    }

    /// Axis and first bin of the second half for the cheapest split.
    fn cheapest(&self, part: &Part, centres: &Aabb) -> Option<(usize, usize)> {
        let mut best: Option<(f32, usize, usize)> = None;
        for axis in 0..3 {
            if centres.max[axis] <= centres.min[axis] {
                continue;
            }
            let scale = bin_scale(centres, axis);
            let mut bins = [(0_u32, Aabb::NONE); BINS];
            for &item in &self.order[part.from as usize..part.to as usize] {
                let aabb = &self.boxes[item as usize];
                let bin = &mut bins[bin_of(aabb.centre(axis), centres.min[axis], scale)];
                bin.0 += 1;
                bin.1.join(aabb);
            }
            let mut right = [(0_u32, 0.0_f32); BINS];
            let mut sum = (0, Aabb::NONE);
            for k in (1..BINS).rev() {
                sum.0 += bins[k].0;
                sum.1.join(&bins[k].1);
                right[k] = (sum.0, sum.1.area());
            }
            let mut sum = (0, Aabb::NONE);
            for k in 1..BINS {
                sum.0 += bins[k - 1].0;
                sum.1.join(&bins[k - 1].1);
                if sum.0 == 0 || right[k].0 == 0 {
                    continue;
                }
                let cost = sum.1.area() * sum.0 as f32 + right[k].1 * right[k].0 as f32;
                let cheaper = best.is_none_or(|(least, ..)| cost.partial_cmp(&least) == Some(Ordering::Less));
                if cheaper {
                    best = Some((cost, axis, k));
                }
            }
        }
        best.map(|(_, axis, bin)| (axis, bin))
    }
}

fn bin_scale(centres: &Aabb, axis: usize) -> f32 {
    BINS as f32 * 0.9999 / (centres.max[axis] - centres.min[axis])
}

fn bin_of(centre: f32, min: f32, scale: f32) -> usize {
    (((centre - min) * scale) as usize).min(BINS - 1)
}
