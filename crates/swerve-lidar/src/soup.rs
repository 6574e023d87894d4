//! Triangles in blocks of four under a hierarchy, and their intersection with rays.

use swerve_scene::vector::{cross, normalized, sub};
use wide::{f32x4, f32x8};

use crate::bvh::{Aabb, Builder, Bvh, LANES, Packet, Ray, Stack};

/// Triangle of a soup.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    /// Corners, counter-clockwise seen from outside.
    pub(crate) corners: [[f32; 3]; 3],
    /// Surface number, assigned by the caller.
    pub(crate) surface: u32,
}

/// Four triangles side by side; unused lanes are degenerate triangles.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Block {
    corner: [f32x4; 3],
    edge_1: [f32x4; 3],
    edge_2: [f32x4; 3],
    /// Cross product of the edges.
    normal: [f32x4; 3],
}

/// Attributes of a triangle other than its geometry.
#[derive(Clone, Copy, Debug, Default)]
struct Facet {
    /// Unit normal, on the outer side.
    normal: [f32; 3],
    surface: u32,
}

/// Triangle hit by a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TriangleHit {
    /// Distance along the ray.
    pub(crate) distance: f32,
    /// Location of the triangle: four times the block, plus the lane.
    place: u32,
}

impl TriangleHit {
    /// Returns true if this hit precedes another: nearer, or equally near and earlier in the order of triangles, so
    /// that the result is independent of the traversal order.
    #[inline(always)]
    fn comes_before(&self, other: Option<Self>, reach: f32) -> bool {
        self.distance < reach || other.is_none_or(|other| self.distance == reach && self.place < other.place)
    }
}

/// Triangles at fixed positions relative to each other.
#[derive(Clone, Debug, Default)]
pub(crate) struct Soup {
    bvh: Bvh,
    blocks: Vec<Block>,
    /// Attributes, by location.
    facets: Vec<Facet>,
}

impl Soup {
    /// Builds the hierarchy; `builder` provides reusable buffers.
    pub(crate) fn new(triangles: &[Triangle], builder: &mut Builder) -> Self {
        builder.boxes.clear();
        builder.boxes.extend(triangles.iter().map(|triangle| {
            let mut aabb = Aabb::NONE;
            triangle.corners.iter().for_each(|corner| aabb.add(*corner));
            // Slightly enlarged, so that rounded points of the triangle are inside.
            for axis in 0..3 {
                let pad = 4e-7 * aabb.min[axis].abs().max(aabb.max[axis].abs());
                aabb.min[axis] -= pad;
                aabb.max[axis] += pad;
            }
            aabb
        }));
        let mut soup = Self::default();
        builder.build(&mut soup.bvh, 4);
        for items in builder.leaves() {
            soup.blocks.push(Block::new(items, triangles));
            soup.facets.extend((0..4).map(|lane| {
                items.get(lane).map_or(Facet::default(), |&item| Facet::new(&triangles[item as usize]))
            }));
        }
        soup
    }

    /// Nearest triangle within `reach` whose surface is `allowed`.
    #[inline(always)]
    pub(crate) fn nearest(
        &self,
        ray: &Ray,
        reach: f32,
        stack: &mut Stack,
        allowed: impl Fn(u32) -> bool,
    ) -> Option<TriangleHit> {
        let mut met = None;
        self.bvh.walk(ray, reach, stack, |leaf, mut reach| {
            let block = &self.blocks[leaf as usize];
            let (mut hits, distances) = block.meets(&ray.origin, &ray.direction, reach);
            if hits != 0 {
                let distances = distances.to_array();
                while hits != 0 {
                    let lane = hits.trailing_zeros() & 3;
                    hits &= hits - 1;
                    let new = TriangleHit { distance: distances[lane as usize], place: leaf << 2 | lane };
                    if new.comes_before(met, reach) && allowed(self.surface(new)) {
                        reach = new.distance;
                        met = Some(new);
                    }
                }
            }
            reach
        });
        met
    }

    /// As [`Self::nearest`] for the rays of a packet; shortens their reach and returns the hit of each.
    #[inline(always)]
    pub(crate) fn nearest_packet(
        &self,
        packet: &Packet,
        reach: &mut f32x8,
        stack: &mut Stack,
        allowed: impl Fn(u32) -> bool,
    ) -> [Option<TriangleHit>; LANES] {
        let mut met = [None; LANES];
        let ([ox, oy, oz], [dx, dy, dz]) = (&packet.origin, &packet.direction);
        let origins = [ox.as_array(), oy.as_array(), oz.as_array()];
        let directions = [dx.as_array(), dy.as_array(), dz.as_array()];
        self.bvh.walk_packet(packet, reach, stack, |leaf, mut rays, reach| {
            let block = &self.blocks[leaf as usize];
            let reaches = reach.as_mut_array();
            while rays != 0 {
                let ray = (rays.trailing_zeros() & 7) as usize;
                rays &= rays - 1;
                let origin = [
                    f32x4::splat(origins[0][ray]),
                    f32x4::splat(origins[1][ray]),
                    f32x4::splat(origins[2][ray]),
                ];
                let direction = [
                    f32x4::splat(directions[0][ray]),
                    f32x4::splat(directions[1][ray]),
                    f32x4::splat(directions[2][ray]),
                ];
                let (mut hits, distances) = block.meets(&origin, &direction, reaches[ray]);
                if hits == 0 {
                    continue;
                }
                let distances = distances.to_array();
                while hits != 0 {
                    let lane = hits.trailing_zeros() & 3;
                    hits &= hits - 1;
                    let new = TriangleHit { distance: distances[lane as usize], place: leaf << 2 | lane };
                    if new.comes_before(met[ray], reaches[ray]) && allowed(self.surface(new)) {
                        reaches[ray] = new.distance;
                        met[ray] = Some(new);
                    }
                }
            }
        });
        met
    }

    /// Surface and unit normal (on the outer side) of a hit.
    #[inline(always)]
    pub(crate) fn describe(&self, met: TriangleHit) -> (u32, [f32; 3]) {
        let facet = &self.facets[met.place as usize];
        (facet.surface, facet.normal)
    }

    #[inline(always)]
    fn surface(&self, met: TriangleHit) -> u32 {
        self.facets[met.place as usize].surface
    }
}

/// Words of a block of a flat soup: corner, two edges and their cross product, each by axis for the four triangles;
/// four surfaces.
pub(crate) const BLOCK_WORDS: usize = 52;

impl Soup {
    /// Hierarchy of the soup.
    pub(crate) fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// Appends the blocks as words for a compute shader; surface indices are relative to `first_surface`.
    pub(crate) fn flatten(&self, words: &mut Vec<u32>, first_surface: u32) {
        for (block, facets) in self.blocks.iter().zip(self.facets.chunks_exact(4)) {
            for lanes in [block.corner, block.edge_1, block.edge_2, block.normal].iter().flatten() {
                words.extend(lanes.to_array().map(f32::to_bits));
            }
            words.extend(facets.iter().map(|facet| first_surface + facet.surface));
        }
    }
}

impl Facet {
    fn new(triangle: &Triangle) -> Self {
        let [a, b, c] = triangle.corners;
        Self { normal: normalized(cross(sub(b, a), sub(c, a))), surface: triangle.surface }
    }
}

impl Block {
    fn new(items: &[u32], triangles: &[Triangle]) -> Self {
        let mut lanes = [[[0.0_f32; 4]; 3]; 4];
        for (lane, &item) in items.iter().enumerate() {
            let [a, b, c] = triangles[item as usize].corners;
            let (edge_1, edge_2) = (sub(b, a), sub(c, a));
            for (vector, part) in [a, edge_1, edge_2, cross(edge_1, edge_2)].into_iter().zip(&mut lanes) {
                for axis in 0..3 {
                    part[axis][lane] = vector[axis];
                }
            }
        }
        let [corner, edge_1, edge_2, normal] = lanes.map(|part| part.map(f32x4::new));
        Self { corner, edge_1, edge_2, normal }
    }

    /// Bit mask of the triangles hit before `reach`, and the distances.
    ///
    /// Möller and Trumbore, "Fast, Minimum Storage Ray-Triangle Intersection" (1997), with the triple products permuted
    /// such that the normal can be stored and the distance is known first.
    #[inline(always)]
    fn meets(&self, origin: &[f32x4; 3], d: &[f32x4; 3], reach: f32) -> (u32, f32x4) {
        let n = &self.normal;
        let ([ox, oy, oz], [cx, cy, cz]) = (*origin, self.corner);
        let s = [ox - cx, oy - cy, oz - cz];
        let one = f32x4::ONE;
        let zero = f32x4::ZERO;
        let inverse = -one / dot(d, n);
        let distance = dot(&s, n) * inverse;
        let in_reach = distance.simd_gt(zero) & distance.simd_le(f32x4::splat(reach));
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
