//! Positions of objects and their covariances.

use nalgebra::{Matrix2, Vector2 as Column2};
use swerve_geom::{Ego, Map, Point, Point2, Pose2, Vector2, math};
use swerve_msg::{DetectedBox, Image, Pixels};

use super::params::Params;
use super::sight::CameraSight;
use crate::image_box::ImageCamera;

/// Lower bound of a standard deviation, metres.
const LEAST_M: f64 = 0.05;
/// Fewest valid depths in a box.
const DEPTHS_MIN: usize = 8;
/// Lower bound of the camera's height above the ground, metres.
const HEIGHT_MIN_M: f64 = 0.3;

/// Covariance of a position in the ego frame, m².
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Spread(Matrix2<f64>);

impl Spread {
    /// Covariance from the entries of a message: xx, xy, yy.
    pub(super) fn told([xx, xy, yy]: [f64; 3]) -> Self {
        Self(Matrix2::new(xx, xy, xy, yy))
    }

    /// Entries xx, xy, yy.
    pub(super) fn entries(&self) -> [f64; 3] {
        [self.0.m11, self.0.m12, self.0.m22]
    }

    /// Covariance with these standard deviations along and across a line of sight, metres.
    pub(super) fn along(bearing_rad: f64, along_m: f64, across_m: f64) -> Self {
        let square = |m: f64| m * m + LEAST_M * LEAST_M;
        Self(Matrix2::new(square(along_m), 0.0, 0.0, square(across_m))).turned(bearing_rad)
    }

    /// Covariance of a lidar box.
    pub(super) fn of_lidar(pose: Pose2<Ego>, params: &Params) -> Self {
        let (bearing_rad, range_m) = polar(pose.point() - Point2::default());
        let grows_m = params.lidar_noise_share * range_m;
        Self::along(bearing_rad, params.lidar_noise_m + grows_m, params.lidar_noise_m + grows_m)
    }

    /// Covariance of the intersection of a camera box's lower edge with the ground: an angular error changes the
    /// distance by r²/h per radian.
    pub(super) fn of_ground_plane(pose: Pose2<Ego>, camera: &ImageCamera, params: &Params) -> Self {
        let eye = camera.info.ego_from_camera.origin().coords;
        let (bearing_rad, range_m) = polar(pose.point() - Point2::new(eye.x, eye.y));
        let edge_rad = params.edge_noise_px / camera.info.intrinsics.fy_px;
        let along_m =
            range_m * range_m / eye.z.max(HEIGHT_MIN_M) * math::hypot(edge_rad, params.pitch_noise_rad);
        Self::along(bearing_rad, along_m, range_m * params.edge_noise_px / camera.info.intrinsics.fx_px)
    }

    /// Adds an independent isotropic error of this standard deviation, metres.
    pub(super) fn grown(self, by_m: f64) -> Self {
        Self(self.0 + Matrix2::identity() * (by_m * by_m))
    }

    /// Rotates the covariance by this angle.
    fn turned(self, by_rad: f64) -> Self {
        let (sin, cos) = math::sin_cos(by_rad);
        let turn = Matrix2::new(cos, -sin, sin, cos);
        Self(turn * self.0 * turn.transpose())
    }

    /// Standard deviation along a bearing, metres.
    pub(super) fn deviation_m(&self, bearing_rad: f64) -> f64 {
        let (sin, cos) = math::sin_cos(bearing_rad);
        let direction = Column2::new(cos, sin);
        (direction.transpose() * self.0 * direction)[0].max(0.0).sqrt()
    }

    /// Squared Mahalanobis distance of two positions that differ by `off`; `None` if the covariance is singular.
    pub(super) fn distance(&self, off: Vector2<Ego>, other: Self) -> Option<f64> {
        let off = Column2::new(off.x, off.y);
        Some((off.transpose() * (self.0 + other.0).try_inverse()? * off)[0])
    }
}

/// Bearing and length of a vector, radians and metres.
pub(super) fn polar(way: Vector2<Ego>) -> (f64, f64) {
    (math::atan2(way.y, way.x), way.norm())
}

/// Transforms a pose and its covariance from the ego frame of one instant to that of another.
pub(super) fn moved(
    (pose, spread): (Pose2<Ego>, Spread),
    from: Pose2<Map>,
    to: Pose2<Map>,
) -> (Pose2<Ego>, Spread) {
    if from == to {
        return (pose, spread);
    }
    let turn_rad = from.heading_rad - to.heading_rad;
    let at: Point2<Ego> = to.to_local(from.from_local::<Ego>(pose.point()));
    (Pose2::new(at.x_m, at.y_m, pose.heading_rad + turn_rad), spread.turned(turn_rad))
}

/// Position of a camera box by depth: the median depth of its inner part, without the lower edge, which shows ground,
/// plus half of the object's narrower side, as depths are those of the visible surface.
pub(super) fn by_depth(
    sight: &CameraSight<'_>,
    found: &DetectedBox,
    params: &Params,
) -> Option<(Pose2<Ego>, Spread)> {
    let (image, box_px) =
        (sight.depth.filter(|image| image.stamp == sight.boxes.found.stamp)?, found.image_px?);
    let depth_m = median_m(image, &sight.camera, box_px)?;
    let (k, [left, top, right, bottom]) = (&sight.camera.info.intrinsics, box_px);
    let (across, down) =
        ((0.5 * (left + right) - k.cx_px) / k.fx_px, (0.5 * (top + bottom) - k.cy_px) / k.fy_px);
    let surface = Point::new(across * depth_m, down * depth_m, depth_m);
    let eye = sight.camera.info.ego_from_camera.origin().coords;
    let at = (sight.camera.info.ego_from_camera * surface).coords;
    let (bearing_rad, range_m) = polar(Vector2::new(at.x - eye.x, at.y - eye.y));
    let range_m = range_m + 0.5 * found.extent.length_m.min(found.extent.width_m);
    let (sin, cos) = math::sin_cos(bearing_rad);
    let pose = Pose2::new(eye.x + range_m * cos, eye.y + range_m * sin, found.pose.heading_rad);
    let across_m = range_m * params.edge_noise_px / k.fx_px;
    // The centre is not known better than a quarter of the narrower side.
    let thick_m = 0.25 * found.extent.length_m.min(found.extent.width_m);
    let along_m = math::hypot(params.depth_noise_1pm * depth_m * depth_m, thick_m);
    Some((pose, Spread::along(bearing_rad, along_m, across_m)))
}

/// Median depth in the middle half of a box's columns and the upper two thirds of its rows; `None` with too few valid
/// depths.
fn median_m(image: &Image, camera: &ImageCamera, [left, top, right, bottom]: [f64; 4]) -> Option<f64> {
    let Pixels::DepthF32M(depths) = &image.pixels else { return None };
    image.check().ok()?;
    let (columns, rows) = (image.width_px as usize, image.height_px as usize);
    let scale = [
        f64::from(image.width_px) / f64::from(camera.width_px),
        f64::from(image.height_px) / f64::from(camera.height_px),
    ];
    // NaN casts to 0; positions beyond the border are clamped.
    let pixel = |px: f64, scale: f64, most: usize| ((px * scale) as usize).min(most);
    let inner = 0.25 * (right - left);
    let [first, last] = [left + inner, right - inner].map(|px| pixel(px, scale[0], columns));
    let [above, below] = [top, bottom - (bottom - top) / 3.0].map(|px| pixel(px, scale[1], rows));
    let line = |row: usize| depths.get(row * columns + first..row * columns + last).unwrap_or_default();
    let mut found: Vec<f32> =
        (above..below).flat_map(line).copied().filter(|depth| depth.is_finite() && *depth > 0.0).collect();
    if found.len() < DEPTHS_MIN {
        return None;
    }
    let middle = found.len() / 2;
    let (_, median, _) = found.select_nth_unstable_by(middle, f32::total_cmp);
    Some(f64::from(*median))
}
