//! Position on the ground of the object in an image box.

use swerve_geom::{Camera, Ego, Obb, Point, Point2, Pose2, Transform, Vector, math};
use swerve_msg::{ActorKind, CameraInfo, Extent, Intrinsics};
use swerve_vision::acf::Ground;

use crate::image_box::ImageCamera;
use crate::road::Road;

/// Standard deviation of the row of a box's foot and of the box height, as a share of that height; half as much for the
/// centre column.
const EDGE_SHARE: f64 = 0.04;
/// Standard deviation of the camera's pitch relative to the ground, radians: residual suspension motion.
const PITCH_RAD: f64 = 0.003;
/// Standard deviation of the ground level at an object, as a share of the camera's height: kerbs.
const LEVEL_SHARE: f64 = 0.06;
/// Factor on the standard deviation of depth. Depth errors persist from frame to frame, as a person's height and a kerb
/// do, but filters treat them as independent and would become overconfident.
const GOES_ON: f64 = 2.0;
/// Largest distance of an object that is reported, metres.
const FAR_M: f64 = 120.0;

/// Geometric properties of an object class.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Class {
    /// Name of the class in detectors.
    pub(super) name: &'static str,
    pub(super) kind: ActorKind,
    /// Typical size.
    pub(super) extent: Extent,
    /// Standard deviation of the height, as a share.
    height_share: f64,
    /// Standard deviation of the centre relative to the visible face, metres, due to different lengths.
    middle_m: f64,
}

const fn class(
    name: &'static str,
    kind: ActorKind,
    size_m: [f64; 3],
    [height_share, middle_m]: [f64; 2],
) -> Class {
    let [length_m, width_m, height_m] = size_m;
    Class { name, kind, extent: Extent { length_m, width_m, height_m }, height_share, middle_m }
}

/// Known classes. Sizes and deviations are those of adults, cars and vans, lorries, and riders. A van is classified as
/// a car as often as a truck, so the heights of both are imprecise.
pub(super) const CLASSES: [Class; 4] = [
    class("pedestrian", ActorKind::Pedestrian, [0.5, 0.5, 1.73], [0.07, 0.05]),
    class("car", ActorKind::Car, [4.5, 1.9, 1.7], [0.3, 0.5]),
    class("truck", ActorKind::Truck, [6.5, 2.55, 3.0], [0.3, 0.8]),
    class("cyclist", ActorKind::Cyclist, [1.8, 0.6, 1.75], [0.07, 0.2]),
];

impl Class {
    /// Class of this name.
    pub(super) fn of(name: &str) -> Option<Self> {
        CLASSES.into_iter().find(|class| class.name == name)
    }
}

/// Camera above level ground.
pub(super) struct Eye {
    lens: Intrinsics,
    /// Rotation includes the body's pitch.
    level_from_camera: Transform<Ego, Camera>,
    /// Position on the ground; the heading is that of the optical axis.
    stand: Pose2<Ego>,
    height_m: f64,
}

impl Eye {
    /// Camera on a body with this pitch, nose down positive.
    pub(super) fn new(camera: &CameraInfo, pitch_rad: f64) -> Self {
        let level_from_ego: Transform<Ego, Ego> =
            Transform::from_roll_pitch_yaw(Point::default(), 0.0, pitch_rad, 0.0);
        let level_from_camera = level_from_ego * camera.ego_from_camera;
        let axis = (level_from_camera * Vector::<Camera>::new(0.0, 0.0, 1.0)).coords;
        // Pitch rotates about the middle of the car, so the camera height hardly changes.
        let at = camera.ego_from_camera.origin().coords;
        let stand = Pose2::new(at.x, at.y, math::atan2(axis.y, axis.x));
        Self { lens: camera.intrinsics, level_from_camera, stand, height_m: at.z.max(0.1) }
    }

    /// Ground constraint for the detector: horizon row, focal length and camera height.
    pub(super) fn ground(&self) -> Ground {
        let down = |y: f64| -(self.level_from_camera * Vector::<Camera>::new(0.0, y, 1.0)).coords.z;
        // Row of the centre column's horizontal ray.
        let level = down(0.0) / (down(0.0) - down(1.0));
        let horizon_px = self.lens.cy_px + self.lens.fy_px * level;
        Ground { horizon_px, focal_px: self.lens.fy_px, height_m: self.height_m }
    }

    /// Left, top, width and height of the projection of an upright object on the ground; `None` if it is outside the
    /// image.
    pub(super) fn picture(&self, pose: Pose2<Ego>, extent: Extent, size: [usize; 2]) -> Option<[f64; 4]> {
        let info = CameraInfo { intrinsics: self.lens, ego_from_camera: self.level_from_camera };
        let [width_px, height_px] = size.map(|px| px as u32);
        let [left, top, right, bottom] =
            ImageCamera { info, width_px, height_px }.image_px(pose, 0.0, extent)?;
        Some([left, top, right - left, bottom - top])
    }

    /// Position on the ground of an object whose image is this box (left, top, width, height; `rows` is the image
    /// height), and its covariance (xx, xy, yy, m²); `None` if the object is too far away.
    pub(super) fn place(
        &self,
        class: &Class,
        bbox: [f64; 4],
        rows: f64,
        road: &Road<'_>,
    ) -> Option<(Pose2<Ego>, [f64; 3])> {
        let [left, top, across, down] = bbox;
        let foot = self.foot(left + 0.5 * across, top + down);
        let by_foot = foot.rho.filter(|_| top + down < rows).map(|rho| {
            let row = EDGE_SHARE * down / (self.lens.fy_px * self.height_m);
            (rho, sum_of_squares([row, PITCH_RAD / self.height_m, LEVEL_SHARE * rho]))
        });
        let rho = down / (self.lens.fy_px * class.extent.height_m);
        let by_height = (rho, sum_of_squares([EDGE_SHARE * rho, class.height_share * rho]));
        let (rho, variance) = by_foot.map_or(by_height, |by_foot| mean(by_foot, by_height));
        if rho * FAR_M <= 1.0 {
            return None;
        }
        let pose = self.complete(class, 1.0 / rho, foot.leftwards, road);
        // A depth error moves the object along its ray; a column error moves it perpendicular to the axis.
        let depth = sum_of_squares([GOES_ON * variance.sqrt() / (rho * rho), class.middle_m]);
        let column = 0.5 * EDGE_SHARE * down / (self.lens.fx_px * rho);
        let across = sum_of_squares([column, 0.5 * class.middle_m]);
        let (sin, cos) = math::sin_cos(self.stand.heading_rad);
        let ray = [cos - foot.leftwards * sin, sin + foot.leftwards * cos];
        let part = |a: f64, b: f64, c: f64, d: f64| depth * a * b + across * c * d;
        let covariance =
            [part(ray[0], ray[0], sin, sin), part(ray[0], ray[1], -sin, cos), part(ray[1], ray[1], cos, cos)];
        Some((pose, covariance))
    }

    /// Centre of an object whose nearest face is `near_m` ahead along the optical axis and whose image centre is
    /// `leftwards` to the left per metre of that.
    fn complete(&self, class: &Class, near_m: f64, leftwards: f64, road: &Road<'_>) -> Pose2<Ego> {
        let at = |ahead_m: f64, leftwards: f64| {
            self.stand.from_local::<Ego>(Point2::new(ahead_m, leftwards * ahead_m))
        };
        let along = road.at(at(near_m, leftwards)).map_or(0.0, |(heading_rad, _)| heading_rad);
        let heading_rad = if class.kind.is_person() { 0.0 } else { along };
        let turn_rad = heading_rad - self.stand.heading_rad;
        let (sin, cos) = math::sin_cos(turn_rad);
        let Extent { length_m, width_m, .. } = class.extent;
        let ahead_m = near_m + 0.5 * (length_m * cos.abs() + width_m * sin.abs());
        // The image centre is not the projection of the object's centre, as near corners appear larger.
        let mut middle = leftwards;
        for _ in 0..3 {
            let body: Obb<Ego> = Obb::new(Pose2::new(ahead_m, middle * ahead_m, turn_rad), length_m, width_m);
            let sides = body.corners().map(|corner| corner.y_m / corner.x_m);
            let [least, most] = [f64::min, f64::max].map(|of| sides.into_iter().reduce(of).unwrap_or(middle));
            middle += leftwards - 0.5 * (least + most);
        }
        let place = at(ahead_m, middle);
        Pose2::new(place.x_m, place.y_m, heading_rad)
    }

    /// Ray of the pixel at an object's foot.
    fn foot(&self, column: f64, row: f64) -> Foot {
        let Intrinsics { fx_px, fy_px, cx_px, cy_px, .. } = self.lens;
        let ray = Vector::<Camera>::new((column - cx_px) / fx_px, (row - cy_px) / fy_px, 1.0);
        let ray = (self.level_from_camera * ray).coords;
        let (sin, cos) = math::sin_cos(self.stand.heading_rad);
        let (ahead, left) = (ray.x * cos + ray.y * sin, ray.y * cos - ray.x * sin);
        let rho = -ray.z / (self.height_m * ahead);
        Foot { rho: (rho > 0.0 && ahead > 0.0).then_some(rho), leftwards: left / ahead }
    }
}

/// Foot of a box.
struct Foot {
    /// Inverse depth at which its ray meets the ground, 1/m; `None` above the horizon.
    rho: Option<f64>,
    /// Metres to the left per metre of depth.
    leftwards: f64,
}

/// Inverse-variance weighted mean of two values (value, variance), and its variance.
fn mean(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    let weight = 1.0 / a.1 + 1.0 / b.1;
    ((a.0 / a.1 + b.0 / b.1) / weight, 1.0 / weight)
}

fn sum_of_squares<const N: usize>(parts: [f64; N]) -> f64 {
    parts.iter().map(|part| part * part).sum()
}
