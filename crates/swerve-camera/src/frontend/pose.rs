//! Rotations and motions of poses.

use swerve_geom::{Map, Point, Transform};
use swerve_scene::Motion;
use swerve_scene::vector::dot;

/// Rotation matrix by rows.
pub(crate) fn rotation_rows<A, B>(transform: &Transform<A, B>) -> [[f64; 3]; 3] {
    let m = transform.rotation().to_rotation_matrix();
    let m = m.matrix();
    [0, 1, 2].map(|row| [m[(row, 0)], m[(row, 1)], m[(row, 2)]])
}

/// Converts the rows to single precision.
pub(crate) fn narrow(rows: [[f64; 3]; 3]) -> [[f32; 3]; 3] {
    rows.map(|row| row.map(|x| x as f32))
}

/// Pose after some seconds (negative for earlier): translated, and rotated about its origin. Assumes a small rotation.
pub(crate) fn pose_after<F>(pose: &Transform<Map, F>, motion: &Motion, by_s: f64) -> Transform<Map, F> {
    if *motion == Motion::default() || by_s == 0.0 {
        return *pose;
    }
    let p = pose.origin().coords;
    let [vx, vy, vz] = motion.linear_mps.map(|v| v * by_s);
    let [wx, wy, wz] = motion.angular_radps.map(|w| w * by_s);
    let turn: Transform<Map, Map> = Transform::from_roll_pitch_yaw(Point::default(), wx, wy, wz);
    Transform::new(Point::new(p.x + vx, p.y + vy, p.z + vz), (turn * *pose).rotation())
}

/// Multiplies a matrix, given by rows, by a vector.
pub(crate) fn rotate(rows: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    [dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)]
}
