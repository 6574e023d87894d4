//! What is drawn in one pass: instances that may be seen, their places before the camera, their surfaces.

use swerve_geom::{Map, Point, Transform};

use super::geometry::{Frustum, Placement, turn};
use crate::library::MeshId;
use crate::mesh::{Body, Mesh};
use crate::scene::Motion;

/// Some triangles of a mesh, placed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    pub(super) mesh: MeshId,
    pub(super) placement: Placement,
    /// First of its surfaces in the table.
    pub(super) surfaces: u32,
    /// Triangles from and up to.
    pub(super) range: (usize, usize),
}

/// Rotation matrix by rows.
pub(crate) fn rows_of<A, B>(transform: &Transform<A, B>) -> [[f64; 3]; 3] {
    let m = transform.rotation().to_rotation_matrix();
    let m = m.matrix();
    [0, 1, 2].map(|row| [m[(row, 0)], m[(row, 1)], m[(row, 2)]])
}

fn narrow(rows: [[f64; 3]; 3]) -> [[f32; 3]; 3] {
    rows.map(|row| row.map(|x| x as f32))
}

/// A pose a little earlier or later: moved, and turned about its own origin. The turn is taken as small.
pub(crate) fn moved<F>(pose: &Transform<Map, F>, motion: &Motion, by_s: f64) -> Transform<Map, F> {
    if *motion == Motion::default() || by_s == 0.0 {
        return *pose;
    }
    let p = pose.origin().coords;
    let [vx, vy, vz] = motion.linear_mps.map(|v| v * by_s);
    let [wx, wy, wz] = motion.angular_radps.map(|w| w * by_s);
    let turn: Transform<Map, Map> = Transform::from_roll_pitch_yaw(Point::default(), wx, wy, wz);
    Transform::new(Point::new(p.x + vx, p.y + vy, p.z + vz), (turn * *pose).rotation())
}

/// The placement of an instance before a camera.
pub(super) fn place(
    camera_from_map: &Transform<swerve_geom::Camera, Map>,
    map_from_body: &Transform<Map, Body>,
) -> Placement {
    let camera_from_body = *camera_from_map * *map_from_body;
    let offset = camera_from_body.origin().coords;
    Placement {
        camera: narrow(rows_of(&camera_from_body)),
        offset: [offset.x as f32, offset.y as f32, offset.z as f32],
        map: narrow(rows_of(map_from_body)),
    }
}

/// Whether an instance may be seen.
pub(super) fn is_seen(frustum: &Frustum, mesh: &Mesh, placement: &Placement) -> bool {
    let (centre, radius) = mesh.sphere();
    let [x, y, z] = turn(&placement.camera, centre);
    let centre = [x + placement.offset[0], y + placement.offset[1], z + placement.offset[2]];
    frustum.touches(centre, radius)
}
