//! Triangles in blocks of four under a hierarchy, and the nearest of them along a ray.

use wide::f32x4;

use super::bvh::{Aabb, Builder, Bvh, Ray, Stack};
use crate::vector::{cross, sub};

/// A triangle of a soup.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    /// Corners, counter-clockwise seen from outside.
    pub(super) corners: [[f32; 3]; 3],
    /// What it is of: a number of the caller's.
    pub(super) surface: u32,
}

/// Four triangles side by side; places that are not used are triangles without extent.
#[derive(Clone, Copy, Debug)]
struct Block {
    corner: [f32x4; 3],
    edge_1: [f32x4; 3],
    edge_2: [f32x4; 3],
    /// Outer product of the edges.
    normal: [f32x4; 3],
    surface: [u32; 4],
}

/// What a ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Met {
    /// How far away.
    pub(super) distance: f32,
    /// Where its triangle is: block and lane.
    place: u32,
}

/// Triangles that do not move against each other.
#[derive(Clone, Debug, Default)]
pub(super) struct Soup {
    bvh: Bvh,
    blocks: Vec<Block>,
}

impl Soup {
    /// Builds the hierarchy. `builder` lends its memory.
    pub(super) fn new(triangles: &[Triangle], builder: &mut Builder) -> Self {
        builder.boxes.clear();
        builder.boxes.extend(triangles.iter().map(|triangle| {
            let mut aabb = Aabb::NONE;
            triangle.corners.iter().for_each(|corner| aabb.add(*corner));
            // A little larger: what rounds to a point of the triangle is inside.
            for axis in 0..3 {
                let pad = 4e-7 * aabb.min[axis].abs().max(aabb.max[axis].abs());
                aabb.min[axis] -= pad;
                aabb.max[axis] += pad;
            }
            aabb
        }));
        let mut soup = Self::default();
        builder.build(&mut soup.bvh, 4);
        soup.blocks = builder.leaves().map(|items| Block::of(items, triangles)).collect();
        soup
    }

    /// The nearest triangle nearer than `reach` whose surface is `allowed`.
    #[inline(always)]
    pub(super) fn nearest(
        &self,
        ray: &Ray,
        reach: f32,
        stack: &mut Stack,
        allowed: impl Fn(u32) -> bool,
    ) -> Option<Met> {
        let mut met = None;
        self.bvh.walk(ray, reach, stack, |leaf, mut reach| {
            let block = &self.blocks[leaf as usize];
            let (mut hits, distances) = block.meets(ray, reach);
            if hits != 0 {
                let distances = distances.to_array();
                while hits != 0 {
                    let lane = hits.trailing_zeros() & 3;
                    hits &= hits - 1;
                    let distance = distances[lane as usize];
                    if distance < reach && allowed(block.surface[lane as usize]) {
                        reach = distance;
                        met = Some(Met { distance, place: leaf << 2 | lane });
                    }
                }
            }
            reach
        });
        met
    }

    /// Surface and normal (not of unit length, on the outer side) of what was met.
    pub(super) fn describe(&self, met: Met) -> (u32, [f32; 3]) {
        let block = &self.blocks[(met.place >> 2) as usize];
        let lane = (met.place & 3) as usize;
        (block.surface[lane], block.normal.map(|n| n.to_array()[lane]))
    }
}

impl Block {
    fn of(items: &[u32], triangles: &[Triangle]) -> Self {
        let mut lanes = [[[0.0_f32; 4]; 3]; 4];
        let mut surface = [0; 4];
        for (lane, &item) in items.iter().enumerate() {
            let Triangle { corners: [a, b, c], surface: of } = triangles[item as usize];
            let (edge_1, edge_2) = (sub(b, a), sub(c, a));
            for (vector, part) in [a, edge_1, edge_2, cross(edge_1, edge_2)].into_iter().zip(&mut lanes) {
                for axis in 0..3 {
                    part[axis][lane] = vector[axis];
                }
            }
            surface[lane] = of;
        }
        let [corner, edge_1, edge_2, normal] = lanes.map(|part| part.map(f32x4::new));
        Self { corner, edge_1, edge_2, normal, surface }
    }

    /// Which triangles the ray meets before `reach`, as bits, and how far away.
    ///
    /// Möller and Trumbore, "Fast, Minimum Storage Ray-Triangle Intersection" (1997), with the triple products
    /// turned so that the normal can be kept and the distance is known first.
    #[inline(always)]
    fn meets(&self, ray: &Ray, reach: f32) -> (u32, f32x4) {
        let (d, n) = (&ray.direction, &self.normal);
        let s = [0, 1, 2].map(|axis| ray.origin[axis] - self.corner[axis]);
        let one = f32x4::ONE;
        let zero = f32x4::ZERO;
        let inverse = -one / dot(d, n);
        let distance = dot(&s, n) * inverse;
        let in_reach = distance.simd_gt(zero) & distance.simd_lt(f32x4::splat(reach));
        if !in_reach.any() {
            return (0, distance);
        }
        let r = [s[1] * d[2] - s[2] * d[1], s[2] * d[0] - s[0] * d[2], s[0] * d[1] - s[1] * d[0]];
        let u = dot(&self.edge_2, &r) * inverse;
        let v = -dot(&self.edge_1, &r) * inverse;
        let inside = u.simd_ge(zero) & v.simd_ge(zero) & (u + v).simd_le(one);
        ((in_reach & inside).to_bitmask(), distance)
    }
}

#[inline(always)]
fn dot(a: &[f32x4; 3], b: &[f32x4; 3]) -> f32x4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
