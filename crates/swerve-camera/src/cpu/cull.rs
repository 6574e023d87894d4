//! Culling: potentially visible instances at an instant, grouped into units of work.

use core::ops::Range;

use swerve_geom::{Map, Transform};
use swerve_scene::{Body, Mesh, MeshId, Scene};

use super::id::ID_BITS;
use crate::View;
use crate::frontend::pinhole::Frustum;
use crate::frontend::pose::{narrow, pose_after, rotate, rotation_rows};
use crate::frontend::surface::Surface;

/// Fewest triangles per unit of geometry work.
const CHUNK_TRIANGLES: usize = 2048;

/// Placement of a mesh relative to the camera: `camera_from_body` rotation by rows and translation, and the rotation of
/// normals to the map.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    pub(super) camera: [[f32; 3]; 3],
    pub(super) offset: [f32; 3],
    pub(super) map: [[f32; 3]; 3],
}

/// Range of triangles of a placed mesh.
#[derive(Clone, Debug)]
pub(super) struct Item {
    pub(super) mesh: MeshId,
    pub(super) placement: Placement,
    /// Index of its first surface in the table.
    pub(super) surfaces: u32,
    /// Triangles of the mesh.
    pub(super) triangles: Range<usize>,
}

/// Potentially visible instances and their surfaces.
#[derive(Default)]
pub(super) struct Culled {
    pub(super) items: Vec<Item>,
    /// Items of each unit of work.
    pub(super) chunks: Vec<Range<usize>>,
    pub(super) surfaces: Vec<Surface>,
}

impl Culled {
    /// Collects the instances that may be visible at an instant, in chunks of enough triangles.
    pub(super) fn collect(
        &mut self,
        scene: &Scene,
        view: &View<'_>,
        camera_from_map: &Transform<swerve_geom::Camera, Map>,
        frustum: &Frustum,
        at_s: f64,
    ) {
        self.items.clear();
        self.surfaces.clear();
        let hidden = view.hidden_instance.filter(|id| *id != 0);
        for instance in scene.statics().instances().iter().chain(&scene.dynamics) {
            if hidden == Some(instance.instance_id) {
                continue;
            }
            let mesh = scene.meshes.get(instance.mesh);
            let pose = pose_after(&instance.map_from_body, &instance.motion, at_s);
            let placement = place(camera_from_map, &pose);
            if mesh.triangles().is_empty() || !is_seen(frustum, mesh, &placement) {
                continue;
            }
            let surfaces = self.surfaces.len() as u32;
            self.surfaces.extend(mesh.materials().iter().map(|m| Surface::new(m, instance, scene)));
            let count = mesh.triangles().len();
            for from in (0..count).step_by(1 << (ID_BITS - 1)) {
                let triangles = from..(from + (1 << (ID_BITS - 1))).min(count);
                self.items.push(Item { mesh: instance.mesh, placement, surfaces, triangles });
            }
        }
        let total: usize = self.items.iter().map(|item| item.triangles.len()).sum();
        // Ids have room for 4096 chunks.
        let least = CHUNK_TRIANGLES.max(total / 2000);
        self.chunks.clear();
        let (mut from, mut count) = (0, 0);
        for (k, item) in self.items.iter().enumerate() {
            count += item.triangles.len();
            if count >= least {
                self.chunks.push(from..k + 1);
                (from, count) = (k + 1, 0);
            }
        }
        if from < self.items.len() {
            self.chunks.push(from..self.items.len());
        }
    }
}

/// Placement of an instance relative to a camera.
fn place(
    camera_from_map: &Transform<swerve_geom::Camera, Map>,
    map_from_body: &Transform<Map, Body>,
) -> Placement {
    let camera_from_body = *camera_from_map * *map_from_body;
    let offset = camera_from_body.origin().coords;
    Placement {
        camera: narrow(rotation_rows(&camera_from_body)),
        offset: [offset.x as f32, offset.y as f32, offset.z as f32],
        map: narrow(rotation_rows(map_from_body)),
    }
}

/// Returns true if an instance may be visible.
fn is_seen(frustum: &Frustum, mesh: &Mesh, placement: &Placement) -> bool {
    let (centre, radius) = mesh.sphere();
    let [x, y, z] = rotate(&placement.camera, centre);
    let centre = [x + placement.offset[0], y + placement.offset[1], z + placement.offset[2]];
    frustum.touches(centre, radius)
}
