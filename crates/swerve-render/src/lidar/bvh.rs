//! Bounding volume hierarchies with four children per node, and the walks of rays and packets through them.
//!
//! Built from the top by the surface area heuristic over sixteen bins (Wald, "On fast Construction of SAH-based
//! Bounding Volume Hierarchies", 2007); a set is halved until a node has its four children, the largest part
//! first. The boxes of the four lie side by side, so that one ray meets all of them in one test. A packet tests the
//! four against what bounds all of its rays first (interval arithmetic: Boulos, Wald, Shirley, "Geometric and
//! Arithmetic Culling Methods for Entire Ray Packets", 2006), and then its rays against those that are left.

use core::cmp::Ordering;

use wide::{f32x4, f32x8};

/// Bins per axis.
const BINS: usize = 16;
/// From this depth on sets are halved by count: bounds the depth of any input, see [`STACK`].
const DEPTH_SAH: u32 = 14;
/// Largest depth: [`DEPTH_SAH`], and from there two halvings per level of at most 2^32 items.
const DEPTH_MAX: usize = DEPTH_SAH as usize + 17;
/// Entries that a walk keeps at most: three siblings per level.
const STACK: usize = 3 * DEPTH_MAX + 4;
/// Set in the number of a child that is a leaf.
const LEAF: u32 = 1 << 31;
/// The far side of a box is this much farther than it rounds to: no ray slips between two boxes.
const SLACK: f32 = 1.0 + 4e-7;

/// A box with faces along the axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Aabb {
    /// Smallest coordinates.
    pub(super) min: [f32; 3],
    /// Largest coordinates.
    pub(super) max: [f32; 3],
}

impl Aabb {
    /// Holds nothing.
    pub(super) const NONE: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    /// With a point.
    pub(super) fn add(&mut self, point: [f32; 3]) {
        self.join(&Self { min: point, max: point });
    }

    fn join(&mut self, other: &Self) {
        for axis in 0..3 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
        }
    }

    fn sides(&self) -> [f32; 3] {
        let ([x0, y0, z0], [x1, y1, z1]) = (self.min, self.max);
        [(x1 - x0).max(0.0), (y1 - y0).max(0.0), (z1 - z0).max(0.0)]
    }

    /// Half of the surface.
    fn area(&self) -> f32 {
        let [x, y, z] = self.sides();
        x * y + y * z + z * x
    }

    fn centre(&self, axis: usize) -> f32 {
        0.5 * (self.min[axis] + self.max[axis])
    }
}

/// Four boxes and what is in them.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Node {
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

/// A ray of a walk.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    /// Start, the same in all lanes.
    pub(super) origin: [f32x4; 3],
    /// Direction of unit length, the same in all lanes.
    pub(super) direction: [f32x4; 3],
    inverse: [f32x4; 3],
    /// Of each axis: which side of a box comes first.
    near: [usize; 3],
}

impl Ray {
    /// From a start along a direction of unit length.
    #[inline(always)]
    pub(super) fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        let [ox, oy, oz] = origin;
        let [dx, dy, dz] = direction;
        let [ix, iy, iz] = [inverse(dx), inverse(dy), inverse(dz)];
        Self {
            origin: [f32x4::splat(ox), f32x4::splat(oy), f32x4::splat(oz)],
            direction: [f32x4::splat(dx), f32x4::splat(dy), f32x4::splat(dz)],
            inverse: [f32x4::splat(ix), f32x4::splat(iy), f32x4::splat(iz)],
            near: [usize::from(ix < 0.0), usize::from(iy < 0.0), usize::from(iz < 0.0)],
        }
    }

    /// Start and direction.
    #[inline(always)]
    pub(super) fn parts(&self) -> ([f32; 3], [f32; 3]) {
        let first = |v: f32x4| v.to_array()[0];
        let ([ox, oy, oz], [dx, dy, dz]) = (self.origin, self.direction);
        ([first(ox), first(oy), first(oz)], [first(dx), first(dy), first(dz)])
    }

    /// Where the ray enters and leaves the four boxes along one axis.
    #[inline(always)]
    fn slab(&self, node: &Node, axis: usize) -> (f32x4, f32x4) {
        let near = self.near[axis] & 1;
        let (o, i) = (self.origin[axis], self.inverse[axis]);
        ((node.bounds[axis][near] - o) * i, (node.bounds[axis][near ^ 1] - o) * i)
    }

    /// Which of the four boxes the ray meets before `reach`, as bits, and how far away.
    #[inline(always)]
    fn meets(&self, node: &Node, reach: f32) -> (u32, f32x4) {
        let x = self.slab(node, 0);
        let y = self.slab(node, 1);
        let z = self.slab(node, 2);
        let near = x.0.fast_max(y.0).fast_max(z.0.fast_max(f32x4::ZERO));
        let far = x.1.fast_min(y.1).fast_min(z.1) * f32x4::splat(SLACK);
        (near.simd_le(far.fast_min(f32x4::splat(reach))).to_bitmask(), near)
    }
}

/// Rays of a packet.
pub(super) const LANES: usize = 8;

/// Rays that go much the same way, walked together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Packet {
    /// Starts, by axis.
    pub(super) origin: [f32x8; 3],
    /// Directions of unit length, by axis.
    pub(super) direction: [f32x8; 3],
    inverse: [f32x8; 3],
    /// What bounds all rays, by axis.
    span: [Span; 3],
}

/// What bounds the rays of a packet along one axis, the same in all lanes.
#[derive(Clone, Copy, Debug)]
struct Span {
    /// Which side of a box comes first.
    near: usize,
    /// The start from which the near side is nearest, and that from which the far side is farthest.
    origin: [f32x4; 2],
    /// Least and largest inverse of the directions.
    inverse: [f32x4; 2],
}

impl Span {
    #[inline(always)]
    fn new(origin: f32x8, inverse: f32x8) -> Self {
        let (low, high) = (least(origin), -least(-origin));
        let (slow, fast) = (least(inverse), -least(-inverse));
        let (near, origin, inverse) = if slow > 0.0 {
            (0, [high, low], [slow, fast])
        } else if fast < 0.0 {
            (1, [low, high], [slow, fast])
        } else {
            // Some rays go up the axis and some down: it bounds nothing.
            (0, [f32::INFINITY, f32::NEG_INFINITY], [1.0, 1.0])
        };
        let [o0, o1] = origin;
        let [i0, i1] = inverse;
        let (origin, inverse) = ([f32x4::splat(o0), f32x4::splat(o1)], [f32x4::splat(i0), f32x4::splat(i1)]);
        Self { near, origin, inverse }
    }

    /// No ray enters the four boxes along this axis before the first, none leaves them after the second.
    #[inline(always)]
    fn slab(&self, bounds: &[f32x4; 2]) -> (f32x4, f32x4) {
        let near = self.near & 1;
        let (a, b) = (bounds[near] - self.origin[0], bounds[near ^ 1] - self.origin[1]);
        let [slow, fast] = self.inverse;
        ((a * slow).fast_min(a * fast), (b * slow).fast_max(b * fast))
    }
}

impl Packet {
    /// From starts along directions of unit length.
    #[inline(always)]
    pub(super) fn new(origin: [f32x8; 3], direction: [f32x8; 3]) -> Self {
        let [x, y, z] = direction;
        let inverse = |d: f32x8| {
            let tiny = f32x8::splat(1e-18);
            f32x8::ONE / d.abs().simd_lt(tiny).select(tiny, d)
        };
        let inverse = [inverse(x), inverse(y), inverse(z)];
        let span = [
            Span::new(origin[0], inverse[0]),
            Span::new(origin[1], inverse[1]),
            Span::new(origin[2], inverse[2]),
        ];
        Self { origin, direction, inverse, span }
    }

    /// Which of the four boxes any ray may meet before `reach`, as bits: all that one does meet, and others.
    #[inline(always)]
    fn may_meet(&self, node: &Node, reach: f32) -> u32 {
        let x = self.span[0].slab(&node.bounds[0]);
        let y = self.span[1].slab(&node.bounds[1]);
        let z = self.span[2].slab(&node.bounds[2]);
        let near = x.0.fast_max(y.0).fast_max(z.0.fast_max(f32x4::ZERO));
        let far = x.1.fast_min(y.1).fast_min(z.1) * f32x4::splat(SLACK);
        near.simd_le(far.fast_min(f32x4::splat(reach))).to_bitmask()
    }

    /// Where the rays enter and leave a box along one axis.
    #[inline(always)]
    fn slab(&self, bounds: [f32; 2], axis: usize) -> (f32x8, f32x8) {
        let (o, i) = (self.origin[axis], self.inverse[axis]);
        let a = (f32x8::splat(bounds[0]) - o) * i;
        let b = (f32x8::splat(bounds[1]) - o) * i;
        (a.fast_min(b), a.fast_max(b))
    }

    /// Which rays meet a box before their `reach`, as bits, and how far away.
    #[inline(always)]
    fn meets(&self, node: &Node, slot: usize, reach: f32x8) -> (u32, f32x8) {
        let bounds = |axis: usize| {
            [node.bounds[axis][0].as_array()[slot & 3], node.bounds[axis][1].as_array()[slot & 3]]
        };
        let x = self.slab(bounds(0), 0);
        let y = self.slab(bounds(1), 1);
        let z = self.slab(bounds(2), 2);
        let near = x.0.fast_max(y.0).fast_max(z.0.fast_max(f32x8::ZERO));
        let far = x.1.fast_min(y.1).fast_min(z.1) * f32x8::splat(SLACK);
        (near.simd_le(far.fast_min(reach)).to_bitmask(), near)
    }
}

/// The least of eight.
#[inline(always)]
fn least(v: f32x8) -> f32 {
    let [a, b, c, d, e, f, g, h] = v.to_array();
    let min = |a: f32, b: f32| if a < b { a } else { b };
    min(min(min(a, b), min(c, d)), min(min(e, f), min(g, h)))
}

/// 1 over a part of a direction, never so large that 0 times it is not a number.
#[inline(always)]
fn inverse(d: f32) -> f32 {
    1.0 / if d.abs() < 1e-18 { 1e-18_f32.copysign(d) } else { d }
}

/// What a walk remembers; made once and used for many.
pub(super) struct Stack([(f32, u32, u32); STACK]);

impl Default for Stack {
    fn default() -> Self {
        Self([(0.0, 0, 0); STACK])
    }
}

/// A hierarchy over numbered leaves.
#[derive(Clone, Debug, Default)]
pub(super) struct Bvh {
    nodes: Vec<Node>,
}

impl Bvh {
    /// Calls `visit` with leaves that a ray meets, near ones first, until none is left within reach.
    ///
    /// `visit` is given the number of the leaf and the reach so far, and gives the reach from then on.
    #[inline(always)]
    pub(super) fn walk(
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
                        // Sorted, the farthest lowest.
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
}

impl Bvh {
    /// As [`Self::walk`] for a packet of rays, each with its own reach.
    ///
    /// `visit` is given the number of the leaf, the rays that may meet something in it, as bits, and their reach.
    #[inline(always)]
    pub(super) fn walk_packet(
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

/// Children and nodes of flat trees: bits of a link, the rest of which is an index.
pub(super) mod link {
    /// Nothing is there.
    pub(in crate::lidar) const NONE: u32 = u32::MAX;
    /// In a tree of instances: a leaf is one of these, not a block of triangles.
    pub(in crate::lidar) const TOP: u32 = 1 << 30;
    /// Most nodes, leaves or instances of all flat trees together.
    pub(in crate::lidar) const INDEX_MAX: usize = (1 << 29) - 1;
}

/// Words of a node of a flat tree: six times four bounds (smallest and largest x, y, z), four links.
pub(super) const NODE_WORDS: usize = 28;
/// Stands for beyond everything in flat trees, so that nothing there overflows.
const BEYOND: f32 = 1e20;

impl Bvh {
    /// Adds the nodes as words for a compute shader and gives the link to the root. Links count nodes from
    /// `first_node`, leaves from `first_leaf`, and have the bits `set`.
    pub(super) fn flatten(&self, words: &mut Vec<u32>, first_node: u32, first_leaf: u32, set: u32) -> u32 {
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
    pub(super) fn levels(&self, memory: &mut Vec<u32>) -> u32 {
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

/// A set of items that becomes a node or a leaf.
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

/// Builds hierarchies; keeps its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Builder {
    /// What the hierarchy is over: filled in by the caller.
    pub(super) boxes: Vec<Aabb>,
    order: Vec<u32>,
    leaves: Vec<(u32, u32)>,
    work: Vec<(u32, u32, u32, u32)>,
}

impl Builder {
    /// The items of each leaf, by its number.
    pub(super) fn leaves(&self) -> impl Iterator<Item = &[u32]> {
        self.leaves.iter().map(|&(from, to)| &self.order[from as usize..to as usize])
    }

    /// Builds the hierarchy over [`Self::boxes`] with at most `most` items in a leaf.
    pub(super) fn build(&mut self, bvh: &mut Bvh, most: usize) {
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
        self.work.push((0, 0, count, 0));
        while let Some((node, from, to, depth)) = self.work.pop() {
            let mut parts = [self.part(from, to); 4];
            let used = self.split_in_four(&mut parts, most, depth);
            for (slot, part) in parts[..used].iter().enumerate().rev() {
                let child = if part.len() <= most {
                    self.leaves.push((part.from, part.to));
                    LEAF | (self.leaves.len() as u32 - 1)
                } else {
                    bvh.nodes.push(Node::empty());
                    let child = bvh.nodes.len() as u32 - 1;
                    self.work.push((child, part.from, part.to, depth + 1));
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

    /// Halves the first part until there are four, or no more can be halved; gives their number.
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

    /// Orders the items of a part so that its two halves follow each other; gives where the second begins.
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

    /// The axis and the first bin of the second half that make the cheapest two halves.
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
