//! Rays and packets of rays, and their intersection with the boxes of a node.

use wide::{f32x4, f32x8};

use super::Node;

/// Relative enlargement of the far distance of a box against rounding, so that no ray passes between two boxes.
const SLACK: f32 = 1.0 + 4e-7;

/// Ray for a traversal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    /// Origin, the same in all lanes.
    pub(crate) origin: [f32x4; 3],
    /// Unit direction, the same in all lanes.
    pub(crate) direction: [f32x4; 3],
    inverse: [f32x4; 3],
    /// Index of the nearer side of a box, by axis.
    near: [usize; 3],
}

impl Ray {
    /// Ray from an origin along a unit direction.
    #[inline(always)]
    pub(crate) fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
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

    /// Origin and direction.
    #[inline(always)]
    pub(crate) fn parts(&self) -> ([f32; 3], [f32; 3]) {
        let first = |v: f32x4| v.to_array()[0];
        let ([ox, oy, oz], [dx, dy, dz]) = (self.origin, self.direction);
        ([first(ox), first(oy), first(oz)], [first(dx), first(dy), first(dz)])
    }

    /// Distances at which the ray enters and leaves the four boxes along one axis.
    #[inline(always)]
    fn slab(&self, node: &Node, axis: usize) -> (f32x4, f32x4) {
        let near = self.near[axis] & 1;
        let (o, i) = (self.origin[axis], self.inverse[axis]);
        ((node.bounds[axis][near] - o) * i, (node.bounds[axis][near ^ 1] - o) * i)
    }

    /// Bit mask of the boxes hit before `reach`, and their entry distances.
    #[inline(always)]
    pub(crate) fn meets(&self, node: &Node, reach: f32) -> (u32, f32x4) {
        let x = self.slab(node, 0);
        let y = self.slab(node, 1);
        let z = self.slab(node, 2);
        let near = x.0.fast_max(y.0).fast_max(z.0.fast_max(f32x4::ZERO));
        let far = x.1.fast_min(y.1).fast_min(z.1) * f32x4::splat(SLACK);
        (near.simd_le(far.fast_min(f32x4::splat(reach))).to_bitmask(), near)
    }
}

/// Number of rays in a packet.
pub(crate) const LANES: usize = 8;

/// Rays with similar directions, traversed together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Packet {
    /// Origins, by axis.
    pub(crate) origin: [f32x8; 3],
    /// Unit directions, by axis.
    pub(crate) direction: [f32x8; 3],
    inverse: [f32x8; 3],
    /// Bounds of all rays, by axis.
    span: [Span; 3],
}

/// Bounds of the rays of a packet along one axis, the same in all lanes.
#[derive(Clone, Copy, Debug)]
struct Span {
    /// Index of the nearer side of a box.
    near: usize,
    /// Origins that give the smallest distance to the near side and the largest to the far side.
    origin: [f32x4; 2],
    /// Smallest and largest inverse of the directions.
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
            // Rays with both directions along the axis have no bound.
            (0, [f32::INFINITY, f32::NEG_INFINITY], [1.0, 1.0])
        };
        let [o0, o1] = origin;
        let [i0, i1] = inverse;
        let (origin, inverse) = ([f32x4::splat(o0), f32x4::splat(o1)], [f32x4::splat(i0), f32x4::splat(i1)]);
        Self { near, origin, inverse }
    }

    /// Lower bound of the entry and upper bound of the exit of the four boxes along this axis, over all rays.
    #[inline(always)]
    fn slab(&self, bounds: &[f32x4; 2]) -> (f32x4, f32x4) {
        let near = self.near & 1;
        let (a, b) = (bounds[near] - self.origin[0], bounds[near ^ 1] - self.origin[1]);
        let [slow, fast] = self.inverse;
        ((a * slow).fast_min(a * fast), (b * slow).fast_max(b * fast))
    }
}

impl Packet {
    /// Packet from origins along unit directions.
    #[inline(always)]
    pub(crate) fn new(origin: [f32x8; 3], direction: [f32x8; 3]) -> Self {
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

    /// Bit mask of the boxes that any ray may hit before `reach`; conservative.
    #[inline(always)]
    pub(crate) fn may_meet(&self, node: &Node, reach: f32) -> u32 {
        let x = self.span[0].slab(&node.bounds[0]);
        let y = self.span[1].slab(&node.bounds[1]);
        let z = self.span[2].slab(&node.bounds[2]);
        let near = x.0.fast_max(y.0).fast_max(z.0.fast_max(f32x4::ZERO));
        let far = x.1.fast_min(y.1).fast_min(z.1) * f32x4::splat(SLACK);
        near.simd_le(far.fast_min(f32x4::splat(reach))).to_bitmask()
    }

    /// Distances at which the rays enter and leave a box along one axis.
    #[inline(always)]
    fn slab(&self, bounds: [f32; 2], axis: usize) -> (f32x8, f32x8) {
        let (o, i) = (self.origin[axis], self.inverse[axis]);
        let a = (f32x8::splat(bounds[0]) - o) * i;
        let b = (f32x8::splat(bounds[1]) - o) * i;
        (a.fast_min(b), a.fast_max(b))
    }

    /// Bit mask of the rays that hit a box before their `reach`, and the entry distances.
    #[inline(always)]
    pub(crate) fn meets(&self, node: &Node, slot: usize, reach: f32x8) -> (u32, f32x8) {
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

/// Smallest of eight values.
#[inline(always)]
pub(crate) fn least(v: f32x8) -> f32 {
    let [a, b, c, d, e, f, g, h] = v.to_array();
    let min = |a: f32, b: f32| if a < b { a } else { b };
    min(min(min(a, b), min(c, d)), min(min(e, f), min(g, h)))
}

/// Inverse of a direction component, limited so that its product with 0 is not NaN.
#[inline(always)]
fn inverse(d: f32) -> f32 {
    1.0 / if d.abs() < 1e-18 { 1e-18_f32.copysign(d) } else { d }
}
