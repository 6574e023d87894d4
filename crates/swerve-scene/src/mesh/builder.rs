//! Builds meshes from shapes: boxes, cylinders, balls, capsules, extrusions.
//!
//! Shapes are collected as separate triangles. At the end, coincident corners get a common normal if their faces meet
//! at less than the crease angle, and identical corners become one vertex.

use std::collections::BTreeMap;

use super::{Mesh, MeshParts};
use crate::material::Material;
use crate::vector::{add, cross, dot, normalized, scale, sub};

/// Placement of a shape: a rotation (by its columns) and a translation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    /// Images of the x, y and z axis.
    pub(crate) axes: [[f32; 3]; 3],
    /// Image of the origin.
    pub(crate) origin: [f32; 3],
}

impl Placed {
    /// Identity.
    pub(crate) const HERE: Self =
        Self { axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], origin: [0.0; 3] };

    /// Translation.
    pub(crate) fn at(origin: [f32; 3]) -> Self {
        Self { origin, ..Self::HERE }
    }

    /// Rotation about z, then translation.
    pub(crate) fn turned(origin: [f32; 3], yaw_rad: f32) -> Self {
        let (s, c) = libm::sincosf(yaw_rad);
        Self { axes: [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]], origin }
    }

    /// Placement with z along a direction; x and y are arbitrary directions across it.
    pub(crate) fn along(origin: [f32; 3], direction: [f32; 3]) -> Self {
        let z = normalized(direction);
        let helper = if z[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let y = normalized(cross(z, helper));
        Self { axes: [cross(y, z), y, z], origin }
    }

    fn point(&self, p: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = self.axes;
        add(add(add(scale(x, p[0]), scale(y, p[1])), scale(z, p[2])), self.origin)
    }
}

#[derive(Clone, Copy, Debug)]
struct Corner {
    position: [f32; 3],
    uv: [f32; 2],
}

/// Collects triangles for a mesh.
#[derive(Clone, Debug)]
pub struct MeshBuilder {
    corners: Vec<[Corner; 3]>,
    triangle_materials: Vec<u16>,
    materials: Vec<Material>,
    crease_cos: f32,
    /// Placement of the next shapes.
    pub(crate) place: Placed,
}

impl MeshBuilder {
    /// Creates an empty builder. Faces that meet at less than `crease_deg` share normals.
    pub fn new(crease_deg: f32) -> Self {
        let crease_cos = libm::cosf(crease_deg * core::f32::consts::PI / 180.0);
        Self {
            corners: Vec::new(),
            triangle_materials: Vec::new(),
            materials: Vec::new(),
            crease_cos,
            place: Placed::HERE,
        }
    }

    /// Index of a material, which is added if new.
    pub fn material(&mut self, material: Material) -> u16 {
        let found = self.materials.iter().position(|m| *m == material);
        found.unwrap_or_else(|| {
            self.materials.push(material);
            self.materials.len() - 1
        }) as u16
    }

    /// Adds a triangle with texture coordinates; degenerate ones are skipped.
    pub fn triangle(&mut self, material: u16, points: [[f32; 3]; 3], uvs: [[f32; 2]; 3]) {
        let corner = |k: usize| Corner { position: self.place.point(points[k]), uv: uvs[k] };
        let [a, b, c] = [corner(0), corner(1), corner(2)];
        let normal = cross(sub(b.position, a.position), sub(c.position, a.position));
        if dot(normal, normal) > 1e-14 {
            self.corners.push([a, b, c]);
            self.triangle_materials.push(material);
        }
    }

    /// Adds a quadrilateral, counter-clockwise from outside, with texture coordinates.
    pub(crate) fn quad_uv(&mut self, material: u16, p: [[f32; 3]; 4], uv: [[f32; 2]; 4]) {
        self.triangle(material, [p[0], p[1], p[2]], [uv[0], uv[1], uv[2]]);
        self.triangle(material, [p[0], p[2], p[3]], [uv[0], uv[2], uv[3]]);
    }

    /// Adds a quadrilateral with texture coordinates in metres along its first two edges.
    pub fn quad(&mut self, material: u16, p: [[f32; 3]; 4]) {
        let u = normalized(sub(p[1], p[0]));
        let v = normalized(sub(sub(p[3], p[0]), scale(u, dot(sub(p[3], p[0]), u))));
        let uv = p.map(|q| [dot(sub(q, p[0]), u), dot(sub(q, p[0]), v)]);
        self.quad_uv(material, p, uv);
    }

    /// Adds a box between two corners, with its faces' textures in metres of the box's frame.
    pub(crate) fn cuboid(&mut self, material: u16, min: [f32; 3], max: [f32; 3]) {
        self.cuboid_of([material; 6], min, max);
    }

    /// Adds a box with a material for each face: -x, +x, -y, +y, -z, +z.
    pub(crate) fn cuboid_of(&mut self, materials: [u16; 6], [x0, y0, z0]: [f32; 3], [x1, y1, z1]: [f32; 3]) {
        let faces = [
            [[x0, y1, z0], [x0, y0, z0], [x0, y0, z1], [x0, y1, z1]],
            [[x1, y0, z0], [x1, y1, z0], [x1, y1, z1], [x1, y0, z1]],
            [[x0, y0, z0], [x1, y0, z0], [x1, y0, z1], [x0, y0, z1]],
            [[x1, y1, z0], [x0, y1, z0], [x0, y1, z1], [x1, y1, z1]],
            [[x0, y1, z0], [x1, y1, z0], [x1, y0, z0], [x0, y0, z0]],
            [[x0, y0, z1], [x1, y0, z1], [x1, y1, z1], [x0, y1, z1]],
        ];
        for (face, material) in faces.into_iter().zip(materials) {
            self.quad(material, face);
        }
    }

    /// Adds a tube around z from `z0` to `z1` with radii `r0` to `r1`, closed by discs on request.
    pub(crate) fn cone(
        &mut self,
        material: u16,
        (z0, r0): (f32, f32),
        (z1, r1): (f32, f32),
        sides: u32,
        closed: bool,
    ) {
        let ring = circle(sides);
        let around = core::f32::consts::TAU * r0.max(r1) / sides as f32;
        for k in 0..sides as usize {
            let (a, b) = (ring[k], ring[(k + 1) % sides as usize]);
            let p = |c: [f32; 2], r: f32, z: f32| [c[0] * r, c[1] * r, z];
            let (u0, u1) = (around * k as f32, around * (k + 1) as f32);
            self.quad_uv(
                material,
                [p(a, r0, z0), p(b, r0, z0), p(b, r1, z1), p(a, r1, z1)],
                [[u0, z0], [u1, z0], [u1, z1], [u0, z1]],
            );
        }
        if closed {
            self.disc(material, z1, r1, sides, true);
            self.disc(material, z0, r0, sides, false);
        }
    }

    /// Adds a disc across z, facing up or down; texture coordinates 0 to 1 over its square.
    pub(crate) fn disc(&mut self, material: u16, z: f32, radius: f32, sides: u32, from_above: bool) {
        let ring = circle(sides);
        let count = sides as usize;
        for k in 0..count {
            let (a, b) =
                if from_above { (ring[k], ring[(k + 1) % count]) } else { (ring[(k + 1) % count], ring[k]) };
            let uv = |c: [f32; 2]| [0.5 + 0.5 * c[0], 0.5 + 0.5 * c[1]];
            let p = |c: [f32; 2]| [c[0] * radius, c[1] * radius, z];
            self.triangle(material, [[0.0, 0.0, z], p(a), p(b)], [[0.5, 0.5], uv(a), uv(b)]);
        }
    }

    /// Adds an ellipsoid; `bump` scales the offset of each vertex from the centre.
    pub fn ball(
        &mut self,
        material: u16,
        radii: [f32; 3],
        sides: u32,
        rows: u32,
        bump: impl Fn(usize, usize) -> f32,
    ) {
        let ring = circle(sides);
        let count = sides as usize;
        let point = |row: usize, k: usize| {
            let (s, c) = libm::sincosf(core::f32::consts::PI * row as f32 / rows as f32);
            let around = ring[k % count];
            let pole = row == 0 || row == rows as usize;
            let grow = bump(row, if pole { 0 } else { k % count });
            [radii[0] * grow * s * around[0], radii[1] * grow * s * around[1], -radii[2] * grow * c]
        };
        let uv = |row: usize, k: usize| {
            let across = core::f32::consts::TAU * radii[0].max(radii[1]) / sides as f32;
            [across * k as f32, core::f32::consts::PI * radii[2] * row as f32 / rows as f32]
        };
        for row in 0..rows as usize {
            for k in 0..count {
                let p = [point(row, k), point(row, k + 1), point(row + 1, k + 1), point(row + 1, k)];
                self.quad_uv(material, p, [uv(row, k), uv(row, k + 1), uv(row + 1, k + 1), uv(row + 1, k)]);
            }
        }
    }

    /// Adds a limb between two points: a tapered tube with a ball at each end.
    pub(crate) fn limb(
        &mut self,
        material: u16,
        (from, r0): ([f32; 3], f32),
        (to, r1): ([f32; 3], f32),
        sides: u32,
    ) {
        let saved = self.place;
        let length = dot(sub(to, from), sub(to, from)).sqrt();
        let local = Placed::along(from, sub(to, from));
        self.place = saved.then(&local);
        self.cone(material, (0.0, r0), (length, r1), sides, false);
        self.cap(material, r0, 0.0, -1.0, sides);
        self.cap(material, r1, length, 1.0, sides);
        self.place = saved;
    }

    /// Adds a blunt cone on the end of a tube; common normals make it look round.
    fn cap(&mut self, material: u16, radius: f32, z: f32, up: f32, sides: u32) {
        let ring = circle(sides);
        let count = sides as usize;
        let levels = [(1.0, 0.0), (0.0, 0.75)];
        for pair in levels.windows(2) {
            for k in 0..count {
                let p = |(r, h): (f32, f32), k: usize| {
                    let c = ring[k % count];
                    [c[0] * r * radius, c[1] * r * radius, z + up * h * radius]
                };
                let q = [p(pair[0], k), p(pair[0], k + 1), p(pair[1], k + 1), p(pair[1], k)];
                let q = if up > 0.0 { q } else { [q[1], q[0], q[3], q[2]] };
                self.quad(material, q);
            }
        }
    }

    /// Scales everything so far to fill a bounding box: centred in x and y, from the ground up in z. Axes with a 0 are
    /// not scaled.
    pub(crate) fn fit(&mut self, outline: [f32; 3]) {
        for (axis, &size) in outline.iter().enumerate().filter(|(_, size)| **size > 0.0) {
            let all = || self.corners.iter().flatten().map(|corner| corner.position[axis]);
            let (low, high) = (all().fold(f32::INFINITY, f32::min), all().fold(f32::NEG_INFINITY, f32::max));
            let start = if axis == 2 { 0.0 } else { -0.5 * size };
            let by = size / (high - low).max(1e-6);
            for corner in self.corners.iter_mut().flatten() {
                corner.position[axis] = start + (corner.position[axis] - low) * by;
            }
        }
    }

    /// Builds the mesh.
    pub fn finish(self) -> Mesh {
        let faces: Vec<[f32; 3]> = self
            .corners
            .iter()
            .map(|[a, b, c]| cross(sub(b.position, a.position), sub(c.position, a.position)))
            .collect();
        let place = |p: [f32; 3]| p.map(|x| (x * 4096.0).round() as i32);
        let mut meeting: BTreeMap<[i32; 3], Vec<usize>> = BTreeMap::new();
        for (face, corners) in self.corners.iter().enumerate() {
            for corner in corners {
                meeting.entry(place(corner.position)).or_default().push(face);
            }
        }
        let mut parts = MeshParts { materials: self.materials, ..MeshParts::default() };
        let mut known: BTreeMap<[u32; 8], u32> = BTreeMap::new();
        for (face, corners) in self.corners.iter().enumerate() {
            let own = normalized(faces[face]);
            let triangle = corners.map(|corner| {
                let near = meeting[&place(corner.position)].iter().map(|&f| faces[f]);
                let common = near.filter(|&n| dot(normalized(n), own) >= self.crease_cos).fold([0.0; 3], add);
                let normal = normalized(common);
                let (p, n, t) = (corner.position, normal, corner.uv);
                let bits = [p[0], p[1], p[2], n[0], n[1], n[2], t[0], t[1]].map(f32::to_bits);
                *known.entry(bits).or_insert_with(|| {
                    parts.positions.push(p);
                    parts.normals.push(n);
                    parts.uvs.push(t);
                    parts.positions.len() as u32 - 1
                })
            });
            parts.triangles.push(triangle);
        }
        parts.triangle_materials = self.triangle_materials;
        Mesh::new(parts).expect("shapes have finite corners and known materials")
    }
}

impl Placed {
    /// Composition with an inner placement.
    pub(crate) fn then(&self, inner: &Self) -> Self {
        let turn = |v: [f32; 3]| sub(self.point(v), self.origin);
        Self { axes: inner.axes.map(turn), origin: self.point(inner.origin) }
    }
}

/// Points of the unit circle.
pub(crate) fn circle(sides: u32) -> Vec<[f32; 2]> {
    (0..sides)
        .map(|k| {
            let (s, c) = libm::sincosf(core::f32::consts::TAU * k as f32 / sides as f32);
            [c, s]
        })
        .collect()
}
