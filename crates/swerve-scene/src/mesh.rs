//! Triangle meshes.

mod builder;

pub use builder::MeshBuilder;
pub(crate) use builder::{Placed, circle};

use crate::hash::Key;
use crate::material::Material;

/// Frame of one mesh: x forward, y left, z up; for objects on the ground the origin is on it, at the centre of their
/// footprint.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Body;

/// Arrays from which a mesh is created.
///
/// Triangles are counter-clockwise seen from outside; coordinates in the frame [`Body`], metres.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct MeshParts {
    /// Position of each vertex.
    pub positions: Vec<[f32; 3]>,
    /// Normal of each vertex, unit length.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates of each vertex, metres along the surface (or 0 to 1 over a sign's face).
    pub uvs: Vec<[f32; 2]>,
    /// Triangles, three vertex indices each.
    pub triangles: Vec<[u32; 3]>,
    /// Material of each triangle: index into `materials`.
    pub triangle_materials: Vec<u16>,
    /// Surfaces.
    pub materials: Vec<Material>,
}

/// Reason why arrays do not form a mesh.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum MeshError {
    /// Arrays per vertex differ in length.
    #[error(
        "{positions} positions, {normals} normals and {uvs} texture coordinates: expected as many of each"
    )]
    Vertices {
        /// Number of positions.
        positions: usize,
        /// Number of normals.
        normals: usize,
        /// Number of texture coordinates.
        uvs: usize,
    },
    /// The numbers of triangles and triangle materials differ.
    #[error("{triangles} triangles, but {materials} material indices")]
    Triangles {
        /// Number of triangles.
        triangles: usize,
        /// Number of triangle materials.
        materials: usize,
    },
    /// A triangle refers to a vertex or material that does not exist.
    #[error("triangle {triangle} names a vertex or material that does not exist")]
    Index {
        /// Index of the triangle.
        triangle: usize,
    },
    /// A number is not finite.
    #[error("vertex {vertex} is not finite")]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// More triangles than the renderer's ids can count.
    #[error("{triangles} triangles, at most {most} in one mesh")]
    TooLarge {
        /// Number of triangles.
        triangles: usize,
        /// Maximum.
        most: usize,
    },
}

/// Maximum number of triangles of one mesh.
const MESH_TRIANGLES_MAX: usize = 1 << 22;

/// Height above the lowest point up to which vertices count for the base, metres.
const BASE_M: f32 = 0.8;

/// A validated, immutable mesh.
#[derive(Clone, PartialEq, Debug)]
pub struct Mesh {
    parts: MeshParts,
    min: [f32; 3],
    max: [f32; 3],
    radius_m: f32,
    /// Smallest and largest x and y near the ground.
    base: [[f32; 2]; 2],
    key: Key,
}

impl Mesh {
    /// Validates the arrays.
    ///
    /// # Errors
    /// If lengths differ, indices are out of range, or numbers are not finite.
    pub fn new(parts: MeshParts) -> Result<Self, MeshError> {
        let (positions, normals, uvs) = (parts.positions.len(), parts.normals.len(), parts.uvs.len());
        if positions != normals || positions != uvs {
            return Err(MeshError::Vertices { positions, normals, uvs });
        }
        let (triangles, materials) = (parts.triangles.len(), parts.triangle_materials.len());
        if triangles != materials {
            return Err(MeshError::Triangles { triangles, materials });
        }
        if triangles > MESH_TRIANGLES_MAX {
            return Err(MeshError::TooLarge { triangles, most: MESH_TRIANGLES_MAX });
        }
        for (triangle, (corners, material)) in
            parts.triangles.iter().zip(&parts.triangle_materials).enumerate()
        {
            let known = corners.iter().all(|&c| (c as usize) < positions);
            if !known || usize::from(*material) >= parts.materials.len() {
                return Err(MeshError::Index { triangle });
            }
        }
        let finite = |vertex: usize| {
            let uv = parts.uvs[vertex];
            parts.positions[vertex].iter().chain(&parts.normals[vertex]).chain(&uv).all(|x| x.is_finite())
        };
        if let Some(vertex) = (0..positions).find(|&vertex| !finite(vertex)) {
            return Err(MeshError::NotFinite { vertex });
        }
        Ok(Self::measured(parts))
    }

    fn measured(parts: MeshParts) -> Self {
        let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for position in &parts.positions {
            for axis in 0..3 {
                min[axis] = min[axis].min(position[axis]);
                max[axis] = max[axis].max(position[axis]);
            }
        }
        if parts.positions.is_empty() {
            (min, max) = ([0.0; 3], [0.0; 3]);
        }
        let middle = [0, 1, 2].map(|axis| 0.5 * (min[axis] + max[axis]));
        let squared = |p: &[f32; 3]| {
            (0..3).map(|axis| (p[axis] - middle[axis]) * (p[axis] - middle[axis])).sum::<f32>()
        };
        let radius_m = parts.positions.iter().map(squared).fold(0.0, f32::max).sqrt();
        let mut key = Key::default();
        for position in &parts.positions {
            position.iter().for_each(|x| key.number(*x));
        }
        parts.normals.iter().flatten().for_each(|x| key.number(*x));
        parts.uvs.iter().flatten().for_each(|x| key.number(*x));
        for (triangle, material) in parts.triangles.iter().zip(&parts.triangle_materials) {
            triangle.iter().for_each(|corner| key.word(*corner));
            key.word(u32::from(*material));
        }
        parts.materials.iter().for_each(|material| material.add_to(&mut key));
        let low = parts.positions.iter().filter(|p| p[2] <= min[2] + BASE_M);
        let base = low.fold([[f32::INFINITY; 2], [f32::NEG_INFINITY; 2]], |[a, b], p| {
            [[a[0].min(p[0]), a[1].min(p[1])], [b[0].max(p[0]), b[1].max(p[1])]]
        });
        Self { parts, min, max, radius_m, base, key }
    }

    /// Position of each vertex.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.parts.positions
    }

    /// Normal of each vertex, unit length.
    pub fn normals(&self) -> &[[f32; 3]] {
        &self.parts.normals
    }

    /// Texture coordinates of each vertex.
    pub fn uvs(&self) -> &[[f32; 2]] {
        &self.parts.uvs
    }

    /// Triangles, counter-clockwise seen from outside.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.parts.triangles
    }

    /// Material of each triangle: index into [`Self::materials`].
    pub fn triangle_materials(&self) -> &[u16] {
        &self.parts.triangle_materials
    }

    /// Surfaces.
    pub fn materials(&self) -> &[Material] {
        &self.parts.materials
    }

    /// Smallest and largest coordinates.
    pub fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        (self.min, self.max)
    }

    /// Centre of the bounds, and radius of the bounding sphere around it.
    pub fn sphere(&self) -> ([f32; 3], f32) {
        ([0, 1, 2].map(|axis| 0.5 * (self.min[axis] + self.max[axis])), self.radius_m)
    }

    /// Smallest and largest x and y near its lowest point.
    pub fn base(&self) -> [[f32; 2]; 2] {
        self.base
    }

    /// Content hash: meshes with equal keys are equal.
    pub fn key(&self) -> Key {
        self.key
    }
}

#[cfg(test)]
mod tests;
