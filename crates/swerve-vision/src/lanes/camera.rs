//! Calibrated camera above a road.

use swerve_core::param::{ParamError, require};
use swerve_geom::{Camera, Ego, Point, Transform, Vector, math};

/// Calibrated camera: a pinhole with Brown's distortion model, as in OpenCV, and its mounting pose.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RoadCamera {
    /// Columns and rows of the image.
    pub size_px: [usize; 2],
    /// Focal lengths, horizontal and vertical, pixels.
    pub focal_px: [f64; 2],
    /// Column and row of the principal point; the centre of the first pixel is at (0.5, 0.5).
    pub center_px: [f64; 2],
    /// Distortion coefficients `k1, k2, p1, p2, k3`; all zero for an undistorted lens.
    pub distortion: [f64; 5],
    /// Mounting pose in the ego frame, without body pitch.
    pub ego_from_camera: Transform<Ego, Camera>,
}

impl RoadCamera {
    /// Undistorted camera with this horizontal field of view, radians.
    pub fn pinhole(size_px: [usize; 2], fov_rad: f64, ego_from_camera: Transform<Ego, Camera>) -> Self {
        let center_px = size_px.map(|px| 0.5 * px as f64);
        let focal_px = [center_px[0] / math::tan(0.5 * fov_rad); 2];
        Self { size_px, focal_px, center_px, distortion: [0.0; 5], ego_from_camera }
    }

    /// Pose of a camera above the ego's origin that looks straight ahead, pitched down by `pitch_rad`.
    pub fn looking_ahead(height_m: f64, pitch_rad: f64) -> Transform<Ego, Camera> {
        let quarter = core::f64::consts::FRAC_PI_2;
        let body = Transform::from_roll_pitch_yaw(Point::new(0.0, 0.0, height_m), 0.0, pitch_rad, 0.0);
        body * Transform::<Ego, Camera>::from_roll_pitch_yaw(Point::default(), -quarter, 0.0, -quarter)
    }

    /// Projects a point of the road (metres, ego frame) to column and row, for a camera pitched down by `pitch_rad`
    /// relative to its mounting; `None` outside the image.
    pub fn pixel(&self, [x_m, y_m]: [f64; 2], pitch_rad: f64) -> Option<[f64; 2]> {
        let at = self.ego_from_camera.origin().coords;
        let ([ahead_m, left_m], (sin, cos)) = ([x_m - at.x, y_m - at.y], math::sin_cos(pitch_rad));
        let (ahead, down) = (ahead_m * cos + at.z * sin, at.z * cos - ahead_m * sin);
        let pixel = Lens::new(self).pixel([left_m / ahead, down / ahead]).filter(|_| ahead > 0.0);
        pixel.map(|px| px.map(|px| px + 0.5))
    }
}

/// Projection of rays of the level view to pixels of the camera.
pub(super) struct Lens {
    camera: RoadCamera,
    camera_from_ego: Transform<Camera, Ego>,
    /// Squared radius beyond which the lens model folds rays back into the image.
    radius2_max: f64,
}

impl Lens {
    pub(super) fn new(camera: &RoadCamera) -> Self {
        let [k1, k2, _, _, k3] = camera.distortion;
        let grows = |r2: f64| 1.0 + r2 * (3.0 * k1 + r2 * (5.0 * k2 + r2 * 7.0 * k3)) > 0.0;
        let radius2_max = (1..=400).map(|k| f64::from(k) * 0.02).find(|r2| !grows(*r2)).unwrap_or(1e3);
        Self { camera: *camera, camera_from_ego: camera.ego_from_camera.inverse(), radius2_max }
    }

    /// Column and row, from the centre of the first pixel, of the ray with these slopes left and down per metre ahead;
    /// `None` unless the image has four pixels around it.
    pub(super) fn pixel(&self, [left, down]: [f64; 2]) -> Option<[f64; 2]> {
        let ray = (self.camera_from_ego * Vector::new(1.0, left, -down)).coords;
        let [x, y] = [ray.x / ray.z, ray.y / ray.z];
        let r2 = x * x + y * y;
        let [k1, k2, p1, p2, k3] = self.camera.distortion;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let bent = [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ];
        let at = [0, 1].map(|k| self.camera.focal_px[k] * bent[k] + self.camera.center_px[k] - 0.5);
        let inside = |k: usize| at[k] >= 0.0 && at[k] + 1.0 < self.camera.size_px[k] as f64;
        (ray.z > 0.0 && r2 < self.radius2_max && inside(0) && inside(1)).then_some(at)
    }
}

/// Checks that the values of a camera are in range and that it looks along the road.
pub(super) fn check_camera(camera: &RoadCamera) -> Result<(), ParamError> {
    let side = "1 to 8192 pixels";
    for (key, px) in [("width", camera.size_px[0]), ("height", camera.size_px[1])] {
        require(key, px, (1..=8192).contains(&px), side)?;
    }
    for (key, focal) in
        [("focal length across", camera.focal_px[0]), ("focal length down", camera.focal_px[1])]
    {
        require(key, focal, (1e-3..=1e6).contains(&focal), "0.001 to 1000000 pixels")?;
    }
    for (key, center) in
        [("optical axis, column", camera.center_px[0]), ("optical axis, row", camera.center_px[1])]
    {
        require(key, center, center.abs() <= 32768.0, "within 32768 pixels")?;
    }
    for k in camera.distortion {
        require("distortion", k, k.abs() <= 10.0, "-10 to 10")?;
    }
    let height_m = camera.ego_from_camera.origin().coords.z;
    require("camera height", height_m, (0.1..=100.0).contains(&height_m), "0.1 to 100 m over the road")?;
    let ahead = camera.ego_from_camera * Vector::new(0.0, 0.0, 1.0);
    require(
        "camera direction",
        ahead.coords.x,
        ahead.coords.x > 0.5,
        "less than 60 degrees from straight ahead",
    )
}
