//! Projection of upright boxes into an image.

use swerve_geom::{Camera, Ego, Point, Pose2, Transform};
use swerve_msg::{CameraInfo, Extent};

/// Near clipping distance from the camera plane, metres.
const NEAR_M: f64 = 0.1;

/// Camera on the ego with its image size, treated as rectified.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ImageCamera {
    /// Calibration.
    pub info: CameraInfo,
    /// Number of columns.
    pub width_px: u32,
    /// Number of rows.
    pub height_px: u32,
}

/// Corner pairs of the edges: bottom, top, vertical.
const EDGES: [(usize, usize); 12] =
    [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)];

impl ImageCamera {
    /// Bounding rectangle of a box's projection: left, top, right and bottom, pixels, clipped to the image; only the
    /// part in front of the camera counts. `None` if it is outside the image.
    pub fn image_px(&self, pose: Pose2<Ego>, bottom_m: f64, extent: Extent) -> Option<[f64; 4]> {
        let camera_from_ego: Transform<Camera, Ego> = self.info.ego_from_camera.inverse();
        let ground = swerve_geom::Obb::new(pose, extent.length_m, extent.width_m).corners();
        let corners: [[f64; 3]; 8] = core::array::from_fn(|k| {
            let up_m = if k < 4 { 0.0 } else { extent.height_m };
            let p = camera_from_ego * Point::new(ground[k % 4].x_m, ground[k % 4].y_m, bottom_m + up_m);
            [p.coords.x, p.coords.y, p.coords.z]
        });
        let mut edges = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        for (a, b) in EDGES {
            let Some(ends) = in_front(corners[a], corners[b]) else { continue };
            for [x, y, z] in ends {
                let k = &self.info.intrinsics;
                let (u, v) = (k.fx_px * x / z + k.cx_px, k.fy_px * y / z + k.cy_px);
                edges = [edges[0].min(u), edges[1].min(v), edges[2].max(u), edges[3].max(v)];
            }
        }
        let (width, height) = (f64::from(self.width_px), f64::from(self.height_px));
        let [left, top, right, bottom] = edges;
        let cut = [
            left.clamp(0.0, width),
            top.clamp(0.0, height),
            right.clamp(0.0, width),
            bottom.clamp(0.0, height),
        ];
        (left < right && cut[0] < cut[2] && cut[1] < cut[3]).then_some(cut)
    }
}

/// Part of an edge in front of the camera.
fn in_front(a: [f64; 3], b: [f64; 3]) -> Option<[[f64; 3]; 2]> {
    let cut = |inside: [f64; 3], outside: [f64; 3]| {
        let t = (NEAR_M - inside[2]) / (outside[2] - inside[2]);
        let at = |k: usize| inside[k] + t * (outside[k] - inside[k]);
        [at(0), at(1), NEAR_M]
    };
    match (a[2] >= NEAR_M, b[2] >= NEAR_M) {
        (true, true) => Some([a, b]),
        (true, false) => Some([a, cut(a, b)]),
        (false, true) => Some([cut(b, a), b]),
        (false, false) => None,
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use swerve_msg::Intrinsics;

    /// Camera of 640 x 360 pixels, 90 degrees, 1.4 m up, looking ahead.
    pub(crate) fn camera() -> ImageCamera {
        let intrinsics = Intrinsics {
            fx_px: 320.0,
            fy_px: 320.0,
            cx_px: 320.0,
            cy_px: 180.0,
            distortion: [0.0; 5],
            is_parallel: false,
        };
        let quarter = core::f64::consts::FRAC_PI_2;
        let origin = Point::new(1.75, 0.0, 1.4);
        let ego_from_camera = Transform::from_roll_pitch_yaw(origin, -quarter, 0.0, -quarter);
        ImageCamera { info: CameraInfo { intrinsics, ego_from_camera }, width_px: 640, height_px: 360 }
    }

    const CUBE: Extent = Extent { length_m: 2.0, width_m: 2.0, height_m: 2.0 };

    #[test]
    fn image_px_matches_the_pinhole_projection() {
        // Its near face is 10 m in front of the camera, from 1 m left to 1 m right and from 1.4 m below to 0.6 m above.
        let [left, top, right, bottom] = camera().image_px(Pose2::new(12.75, 0.0, 0.0), 0.0, CUBE).unwrap();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
        near(left, 320.0 - 32.0);
        near(right, 320.0 + 32.0);
        near(top, 180.0 - 0.6 * 32.0);
        near(bottom, 180.0 + 1.4 * 32.0);
        let left_of_it = camera().image_px(Pose2::new(12.75, 5.0, 0.0), 0.0, CUBE).unwrap();
        assert!(left_of_it[2] < 320.0, "y is to the left: {left_of_it:?}");
    }

    #[test]
    fn image_px_omits_boxes_outside_the_image_and_clips_others() {
        let camera = camera();
        assert_eq!(camera.image_px(Pose2::new(-8.0, 0.0, 0.0), 0.0, CUBE), None);
        assert_eq!(camera.image_px(Pose2::new(5.0, 30.0, 0.0), 0.0, CUBE), None);
        let beside = camera.image_px(Pose2::new(2.0, 2.0, 0.0), 0.0, CUBE).unwrap();
        assert!(beside[0] == 0.0 && beside[2] <= 320.0, "{beside:?}");
        assert_eq!(camera.image_px(Pose2::new(f64::NAN, 0.0, 0.0), 0.0, CUBE), None);
    }
}
