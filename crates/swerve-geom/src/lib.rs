//! Geometry with frames as types: points, vectors, poses and transforms, oriented boxes, polylines, assignment.
//!
//! **Frames** are zero-sized markers ([`Map`], [`Ego`], [`Lidar`], [`Camera`]). A transform is named and typed
//! `to_from`: `map_from_ego: Transform<Map, Ego>`; adjacent frames of a product must match, so a wrong chain does not
//! compile. The types do not distinguish *which* camera or *which* instant: the ego frame at two instants is one
//! type.
//!
//! **Conventions**: metres, radians, right-handed, z up. Map: east-north-up. Ego: x forward, y left,
//! origin at the centre of the rear axle on the ground. Camera: x right, y down, z forward.
//!
//! **Arithmetic**: trigonometry goes through [`math`] (`libm`), loops for wide vector instructions through [`simd`],
//! so that results are the same bits on every machine. Excluded: parry, rapier, glam.

mod angle;
mod area;
mod assignment;
mod frame;
mod line_tracker;
pub mod math;
mod obb;
mod planar;
mod polyline;
mod rectangle;
pub mod simd;

pub use angle::{angle_between, wrap_angle};
pub use area::{hull_area_m2, shared_area_m2};
pub use assignment::heaviest_pairs;
pub use frame::{Camera, Ego, Lidar, Map, Odom, Point, Transform, Vector};
pub use line_tracker::LineTracker;
pub use obb::Obb;
pub use planar::{Point2, Pose2, Vector2};
pub use polyline::{FrenetPoint, Polyline, PolylineError, PolylinePoint};
pub use rectangle::image_iou;
