//! Shapes: triangles with their surfaces, and poses.

use std::sync::Arc;

use swerve_geom::{Map, Transform};
use swerve_scene::vector::{add, scale};
use swerve_scene::{Body, Instance, Mesh, MeshId, MeshLibrary, SemanticClass};
use wide::f32x8;

use crate::bvh::{Aabb, Builder, Packet};
use crate::soup::{Soup, Triangle};

/// Surface of a triangle, with attributes of its instance if known.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    pub(crate) instance_id: u32,
    pub(crate) class: SemanticClass,
    pub(crate) mesh: MeshId,
    pub(crate) material: u16,
    pub(crate) reflectance: f32,
    pub(crate) is_retro_reflective: bool,
    /// True if the class is the material's own.
    pub(crate) keeps_class: bool,
}

impl Surface {
    /// Surface of a mesh's material, on an instance if known.
    pub(crate) fn new(mesh_id: MeshId, mesh: &Mesh, material: u16, instance: Option<&Instance>) -> Self {
        let own = mesh.materials()[usize::from(material)];
        Self {
            instance_id: instance.map_or(0, |i| i.instance_id),
            class: own.class.or(instance.map(|i| i.class)).unwrap_or_default(),
            mesh: mesh_id,
            material,
            reflectance: own.reflectance,
            is_retro_reflective: own.is_retro_reflective,
            keeps_class: own.class.is_some(),
        }
    }
}

/// Triangles and their surfaces.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shape {
    pub(crate) soup: Soup,
    pub(crate) surfaces: Vec<Surface>,
}

impl Shape {
    /// Shape of one mesh in its own frame.
    pub(crate) fn new(id: MeshId, mesh: &Mesh, builder: &mut Builder) -> Self {
        let surfaces = (0..mesh.materials().len()).map(|k| Surface::new(id, mesh, k as u16, None)).collect();
        let triangles: Vec<Triangle> = mesh
            .triangles()
            .iter()
            .zip(mesh.triangle_materials())
            .map(|(corners, &material)| Triangle {
                corners: corners.map(|corner| mesh.positions()[corner as usize]),
                surface: u32::from(material),
            })
            .collect();
        Self { soup: Soup::new(&triangles, builder), surfaces }
    }
}

/// Tree of one mesh, and the content it was built from.
#[derive(Clone, Debug, Default)]
pub(crate) struct CachedShape {
    pub(crate) key: Option<u64>,
    pub(crate) shape: Arc<Shape>,
}

/// Builds the tree of a mesh unless it is cached.
pub(crate) fn keep_shape(
    shapes: &mut Vec<CachedShape>,
    id: MeshId,
    meshes: &MeshLibrary,
    builder: &mut Builder,
) {
    if shapes.len() <= id.index() {
        shapes.resize_with(id.index() + 1, CachedShape::default);
    }
    let mesh = meshes.get(id);
    let kept = &mut shapes[id.index()];
    if kept.key != Some(mesh.key().0) {
        *kept = CachedShape { key: Some(mesh.key().0), shape: Arc::new(Shape::new(id, mesh, builder)) };
    }
}

/// Rotation and translation in `f32`: tree from body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pose {
    /// Columns of the rotation: the body's axes in the tree's frame.
    pub(crate) axes: [[f32; 3]; 3],
    pub(crate) origin: [f32; 3],
}

impl Pose {
    pub(crate) fn new(map_from_body: &Transform<Map, Body>, centre_m: [f64; 3]) -> Self {
        let rotation = map_from_body.rotation().to_rotation_matrix();
        let at = map_from_body.origin().coords;
        Self {
            axes: [0, 1, 2].map(|axis| [0, 1, 2].map(|row| rotation[(row, axis)] as f32)),
            origin: [0, 1, 2].map(|k| (at[k] - centre_m[k]) as f32),
        }
    }

    pub(crate) fn rotate(&self, v: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = self.axes;
        add(add(scale(x, v[0]), scale(y, v[1])), scale(z, v[2]))
    }

    pub(crate) fn apply(&self, point: [f32; 3]) -> [f32; 3] {
        add(self.rotate(point), self.origin)
    }

    /// Transforms a packet to the body's frame.
    #[inline(always)]
    pub(crate) fn local(&self, packet: &Packet) -> Packet {
        let rotate = |[x, y, z]: [f32x8; 3]| {
            let along = |axis: [f32; 3]| {
                x * f32x8::splat(axis[0]) + y * f32x8::splat(axis[1]) + z * f32x8::splat(axis[2])
            };
            let [i, j, k] = self.axes;
            [along(i), along(j), along(k)]
        };
        let ([x, y, z], [ox, oy, oz]) = (packet.origin, self.origin);
        let from = [x - f32x8::splat(ox), y - f32x8::splat(oy), z - f32x8::splat(oz)];
        Packet::new(rotate(from), rotate(packet.direction))
    }

    pub(crate) fn bounds(&self, (min, max): ([f32; 3], [f32; 3])) -> Aabb {
        let mut aabb = Aabb::NONE;
        for corner in 0..8 {
            let point = [0, 1, 2].map(|axis| if corner >> axis & 1 == 0 { min[axis] } else { max[axis] });
            aabb.add(self.apply(point));
        }
        for axis in 0..3 {
            let pad = 1e-3 + 1e-6 * aabb.min[axis].abs().max(aabb.max[axis].abs());
            aabb.min[axis] -= pad;
            aabb.max[axis] += pad;
        }
        aabb
    }
}
