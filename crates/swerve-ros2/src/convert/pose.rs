//! Conversion of poses and transforms.

use nalgebra::{Quaternion, UnitQuaternion};
use swerve_geom::{Map, Point, Pose2, Transform, math};

use super::Epoch;
use crate::msg::geometry_msgs as geo;

/// Frame of any sensor.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Sensor;

/// Converts a planar pose to a ROS pose: on the ground, rotated about z.
pub fn pose_to_ros(pose: Pose2) -> geo::Pose {
    let (sin, cos) = math::sin_cos(0.5 * pose.heading_rad);
    geo::Pose {
        position: geo::Point { x: pose.x_m, y: pose.y_m, z: 0.0 },
        orientation: geo::Quaternion { x: 0.0, y: 0.0, z: sin, w: cos },
    }
}

/// Position and heading of a ROS pose; drops height, roll and pitch.
pub fn pose_from_ros(pose: &geo::Pose) -> Pose2<Map> {
    let q = &pose.orientation;
    let heading = math::atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z));
    Pose2::new(pose.position.x, pose.position.y, heading)
}

/// Converts a transform: `to_from` becomes the transform from frame `To` to its child `From`.
pub fn transform_to_ros<To, From>(to_from: &Transform<To, From>) -> geo::Transform {
    let (origin, rotation) = (to_from.origin().coords, to_from.rotation());
    let q = rotation.quaternion();
    geo::Transform {
        translation: geo::Vector3 { x: origin.x, y: origin.y, z: origin.z },
        rotation: geo::Quaternion { x: q.i, y: q.j, z: q.k, w: q.w },
    }
}

/// Converts the transform from frame `To` to its child `From`; normalises the quaternion.
pub fn transform_from_ros<To, From>(transform: &geo::Transform) -> Transform<To, From> {
    let (t, q) = (&transform.translation, &transform.rotation);
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(q.w, q.x, q.y, q.z));
    Transform::new(Point::new(t.x, t.y, t.z), rotation)
}

/// Stamped transform from `parent` to `child`, for `/tf` and `/tf_static`: `parent_from_child` at `at`.
pub fn edge_to_ros<To, From>(
    parent_from_child: &Transform<To, From>,
    parent: &str,
    child: &str,
    at: swerve_core::Time,
    epoch: Epoch,
) -> geo::TransformStamped {
    geo::TransformStamped {
        header: epoch.header(at, parent),
        child_frame_id: child.to_owned(),
        transform: transform_to_ros(parent_from_child),
    }
}
