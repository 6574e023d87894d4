//! Conversions between rapier's `f32` maths types and Swerve's types, confined to this module.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rapier3d::math::{Pose, Rotation, Vector as Vec3};
use swerve_geom::{Ego, Map, Point, Transform, Vector};

/// Converts to single precision.
pub(super) fn narrow(x: f64) -> f32 {
    #[expect(clippy::cast_possible_truncation, reason = "the physics engine computes in single precision")]
    let x = x as f32;
    x
}

pub(super) fn to_vec(v: Vector3<f64>) -> Vec3 {
    Vec3::new(narrow(v.x), narrow(v.y), narrow(v.z))
}

pub(super) fn from_vec(v: Vec3) -> Vector<Map> {
    Vector::new(f64::from(v.x), f64::from(v.y), f64::from(v.z))
}

pub(super) fn to_transform(pose: &Pose) -> Transform<Map, Ego> {
    let t = pose.translation;
    let r = pose.rotation;
    let rotation = UnitQuaternion::new_normalize(Quaternion::new(
        f64::from(r.w),
        f64::from(r.x),
        f64::from(r.y),
        f64::from(r.z),
    ));
    Transform::new(Point::new(f64::from(t.x), f64::from(t.y), f64::from(t.z)), rotation)
}

pub(super) fn pose_from_transform(transform: &Transform<Map, Ego>) -> Pose {
    let q = transform.rotation();
    let rotation = Rotation::from_xyzw(narrow(q.i), narrow(q.j), narrow(q.k), narrow(q.w));
    Pose::from_parts(to_vec(transform.origin().coords), rotation)
}
