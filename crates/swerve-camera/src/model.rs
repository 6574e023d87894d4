//! Camera model: intrinsics, lens, exposure, noise, shutter, and closed-form projection.
//!
//! **Frame.** `Camera` of `swerve-geom`: x right, y down, z forward along the optical axis.
//! A pixel `(column, row)` covers `[column, column + 1) x [row, row + 1)` of the image plane; its centre is at
//! `(column + 0.5, row + 0.5)`, so the principal point of a symmetric camera is at half the image size.

mod distortion;

pub use distortion::Distortion;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, Ranges, require, require_within};
use swerve_geom::{Ego, Point, Transform, math};

/// Largest width or height of an image, pixels.
pub const IMAGE_SIDE_MAX_PX: u32 = 8192;
/// Largest number of pixels of an image.
const IMAGE_AREA_MAX_PX: u64 = 1 << 25;
/// Largest number of sub-frames of motion blur and of slabs of a rolling shutter.
pub const SUBFRAMES_MAX: u32 = 32;

/// Projection of rays to pixels, before lens distortion.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Intrinsics {
    /// Horizontal field of view between the left and right image edges, radians, in (0, pi); square pixels, centred.
    HorizontalFovRad(f64),
    /// Camera matrix `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]`, pixels.
    Matrix([[f64; 3]; 3]),
    /// Orthographic projection along the optical axis: a map if the camera looks down. Metres per pixel, equal in both
    /// directions; centred. Excludes lens distortion and vignetting.
    OrthographicMPerPx(f64),
}

/// Exposure control.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Exposure {
    /// Metered from the light of the scene's weather: the same for every frame of one weather.
    #[default]
    Metered,
    /// Exposure compensation relative to metered, stops; positive is brighter.
    Stops(f64),
    /// Fixed factor from radiance to full scale; the radiance of white paper in full sun is 1.
    Factor(f64),
}

/// Noise of the image sensor, drawn by a hash of seed, frame and pixel.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(default, deny_unknown_fields)]
pub struct SensorNoise {
    /// Standard deviation of the read-out noise, as a share of full scale.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub read: f64,
    /// Standard deviation of the photon noise at full scale, as a share of it; grows with the square root of the
    /// signal.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub shot: f64,
    /// Seed of the noise.
    pub seed: u64,
}

impl SensorNoise {
    /// Noise of a small automotive sensor by day.
    pub const TYPICAL: Self = Self { read: 0.002, shot: 0.012, seed: 0 };
}

/// Exposure time and row read-out.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(default, deny_unknown_fields)]
pub struct Shutter {
    /// Exposure time, seconds; with `blur_samples` above 1, motion blurs the colour image.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub exposure_s: f64,
    /// Number of sub-frames averaged in the colour image; 1 for a sharp image. They differ by sub-pixel offsets, which
    /// smooths edges, and in their instants, spread over the exposure. Depth and ids are those of one sub-frame, at the
    /// pixel centres.
    #[schemars(range(min = 1, max = SUBFRAMES_MAX))]
    pub blur_samples: u32,
    /// Time between the first and the last row, seconds; 0 for a global shutter.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub readout_s: f64,
    /// Number of slabs of rows with a common instant if `readout_s` is not 0.
    #[schemars(range(min = 1, max = SUBFRAMES_MAX))]
    pub readout_slabs: u32,
}

impl Default for Shutter {
    fn default() -> Self {
        Self { exposure_s: 0.0, blur_samples: 1, readout_s: 0.0, readout_slabs: 8 }
    }
}

/// Description of a camera; [`Camera::new`] checks it.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(default, deny_unknown_fields)]
pub struct CameraSpec {
    /// Image width, pixels.
    #[schemars(range(min = 1, max = IMAGE_SIDE_MAX_PX))]
    pub width_px: u32,
    /// Image height, pixels.
    #[schemars(range(min = 1, max = IMAGE_SIDE_MAX_PX))]
    pub height_px: u32,
    /// Projection: field of view, matrix or orthographic scale.
    pub intrinsics: Intrinsics,
    /// Lens distortion.
    #[ranges(nested)]
    pub distortion: Distortion,
    /// Exposure control.
    pub exposure: Exposure,
    /// Sensor noise; none by default.
    #[ranges(nested)]
    pub noise: SensorNoise,
    /// Brightness fall-off towards the corners: 0 for none, 1 for that of a simple lens (cosine to the fourth power).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub vignetting: f64,
    /// Exposure time and read-out.
    #[ranges(nested)]
    pub shutter: Shutter,
    /// Near clipping distance along the optical axis, metres.
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub near_m: f64,
    /// Far clipping distance along the optical axis, metres.
    pub far_m: f64,
}

impl Default for CameraSpec {
    /// 800 x 600 pixels, 90 degrees, an ideal lens and sensor.
    fn default() -> Self {
        Self {
            width_px: 800,
            height_px: 600,
            intrinsics: Intrinsics::HorizontalFovRad(core::f64::consts::FRAC_PI_2),
            distortion: Distortion::default(),
            exposure: Exposure::default(),
            noise: SensorNoise::default(),
            vignetting: 0.0,
            shutter: Shutter::default(),
            near_m: 0.1,
            far_m: 2000.0,
        }
    }
}

/// Validated camera.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Camera {
    spec: CameraSpec,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
}

impl Camera {
    /// Camera from a description.
    ///
    /// # Errors
    /// The first field that is zero, not finite, out of its range or larger than the stated limits.
    pub fn new(spec: CameraSpec) -> Result<Self, ParamError> {
        spec.check_ranges()?;
        let area = u64::from(spec.width_px) * u64::from(spec.height_px);
        require("width_px x height_px", area as f64, area <= IMAGE_AREA_MAX_PX, "at most 33554432 pixels")?;
        check_optics(&spec)?;
        let (width, height) = (f64::from(spec.width_px), f64::from(spec.height_px));
        let (fx, fy, cx, cy) = match spec.intrinsics {
            Intrinsics::HorizontalFovRad(fov_rad) => {
                let inside = fov_rad > 0.0 && fov_rad < core::f64::consts::PI;
                require(
                    "intrinsics.horizontal_fov_rad",
                    fov_rad,
                    inside,
                    "an angle above 0 and below pi (180 degrees)",
                )?;
                let f = 0.5 * width / math::tan(0.5 * fov_rad);
                require(
                    "intrinsics.horizontal_fov_rad",
                    fov_rad,
                    f.is_finite() && f > 1e-3,
                    "an angle below pi (180 degrees)",
                )?;
                (f, f, 0.5 * width, 0.5 * height)
            }
            Intrinsics::Matrix(matrix) => focal(&matrix)?,
            Intrinsics::OrthographicMPerPx(m_per_px) => {
                check_orthographic(&spec, m_per_px)?;
                (1.0 / m_per_px, 1.0 / m_per_px, 0.5 * width, 0.5 * height)
            }
        };
        let camera = Self { spec, fx, fy, cx, cy };
        camera.check_lens()?;
        Ok(camera)
    }

    /// Description of the camera.
    pub fn spec(&self) -> &CameraSpec {
        &self.spec
    }

    /// Number of columns.
    pub fn width_px(&self) -> usize {
        self.spec.width_px as usize
    }

    /// Number of rows.
    pub fn height_px(&self) -> usize {
        self.spec.height_px as usize
    }

    /// Returns true for an orthographic camera.
    pub fn is_orthographic(&self) -> bool {
        matches!(self.spec.intrinsics, Intrinsics::OrthographicMPerPx(_))
    }

    /// Focal lengths and principal point `(fx, fy, cx, cy)`, pixels; for an orthographic camera, pixels per metre
    /// instead of focal lengths.
    pub fn focal_px(&self) -> (f64, f64, f64, f64) {
        (self.fx, self.fy, self.cx, self.cy)
    }

    /// Camera matrix, 3x3 row by row, for calibration messages. For an orthographic camera it applies to `(x, y, 1)`,
    /// not to `(x, y, z)`.
    pub fn matrix(&self) -> [[f64; 3]; 3] {
        [[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]]
    }

    /// Projects a point to pixels `(column, row)`, with lens distortion; `None` if it is not in front of the camera.
    /// The pixel may be outside the image.
    pub fn project(&self, point: Point<swerve_geom::Camera>) -> Option<[f64; 2]> {
        let p = point.coords;
        (p.z >= self.spec.near_m).then(|| {
            if self.is_orthographic() {
                return [self.fx * p.x + self.cx, self.fy * p.y + self.cy];
            }
            let [x, y] = self.spec.distortion.distort([p.x / p.z, p.y / p.z]);
            [self.fx * x + self.cx, self.fy * y + self.cy]
        })
    }

    /// Ray through an image point, as `(x/z, y/z)` in the camera frame; zero for an orthographic camera, whose rays are
    /// parallel to the optical axis.
    pub fn ray(&self, pixel: [f64; 2]) -> [f64; 2] {
        if self.is_orthographic() {
            return [0.0; 2];
        }
        self.spec.distortion.undistort([(pixel[0] - self.cx) / self.fx, (pixel[1] - self.cy) / self.fy])
    }

    /// Checks that every pixel of the image has a unique ray: the lens model must not fold over inside the image.
    fn check_lens(&self) -> Result<(), ParamError> {
        if self.spec.distortion.is_none() {
            return Ok(());
        }
        let (width, height) = (f64::from(self.spec.width_px), f64::from(self.spec.height_px));
        for k in 0..=8 {
            let t = f64::from(k) / 8.0;
            for pixel in [[t * width, 0.0], [t * width, height], [0.0, t * height], [width, t * height]] {
                let ray = self.ray(pixel);
                let [x, y] = self.spec.distortion.distort(ray);
                let off = math::hypot(self.fx * x + self.cx - pixel[0], self.fy * y + self.cy - pixel[1]);
                let fine = off < 0.01 && math::hypot(ray[0], ray[1]) < 20.0;
                require("distortion", off, fine, "a lens that gives every pixel of the image one ray")?;
            }
        }
        Ok(())
    }
}

fn check_orthographic(spec: &CameraSpec, m_per_px: f64) -> Result<(), ParamError> {
    let at = "intrinsics.orthographic_m_per_px";
    require(at, m_per_px, (1e-4..=100.0).contains(&m_per_px), "0.0001 to 100 metres per pixel")?;
    let vignetting = spec.vignetting;
    require("vignetting", vignetting, vignetting == 0.0, "0 with orthographic intrinsics")?;
    let bent = spec.distortion.coefficients().into_iter().find(|k| *k != 0.0);
    require("distortion", bent.unwrap_or(0.0), bent.is_none(), "no lens with orthographic intrinsics")
}

/// Focal lengths and principal point of a matrix.
fn focal(matrix: &[[f64; 3]; 3]) -> Result<(f64, f64, f64, f64), ParamError> {
    let [[fx, skew, cx], [shear, fy, cy], last] = *matrix;
    let at = "intrinsics.matrix";
    require(at, fx, fx.is_finite() && fx > 1e-3 && fx < 1e7, "a focal length fx above 0")?;
    require(at, fy, fy.is_finite() && fy > 1e-3 && fy < 1e7, "a focal length fy above 0")?;
    require(at, skew, skew == 0.0, "0 in the first row's second place")?;
    require(at, shear, shear == 0.0, "0 in the second row's first place")?;
    require(at, last[2], last == [0.0, 0.0, 1.0], "a last row 0, 0, 1")?;
    let side = 4.0 * f64::from(IMAGE_SIDE_MAX_PX);
    require(at, cx, cx.abs() <= side, "a principal point within 32768 pixels")?;
    require(at, cy, cy.abs() <= side, "a principal point within 32768 pixels")?;
    Ok((fx, fy, cx, cy))
}

fn check_optics(spec: &CameraSpec) -> Result<(), ParamError> {
    let far_in = spec.far_m > spec.near_m && spec.far_m <= 1e5;
    require("far_m", spec.far_m, far_in, "more than near_m, at most 100000 m")?;
    match spec.exposure {
        Exposure::Metered => Ok(()),
        Exposure::Stops(stops) => require_within("exposure.stops", stops, [-16.0, 16.0]),
        Exposure::Factor(factor) => require_within("exposure.factor", factor, [1e-6, 1e6]),
    }
}

/// Mounting pose of a camera on the ego vehicle.
///
/// Position in the ego frame; roll, pitch and yaw of the camera *body* (x forward, y left, z up): all zero looks
/// straight ahead, positive pitch looks down, positive yaw looks to the left.
pub fn mount(
    position_m: [f64; 3],
    roll_rad: f64,
    pitch_rad: f64,
    yaw_rad: f64,
) -> Transform<Ego, swerve_geom::Camera> {
    let [x, y, z] = position_m;
    let ego_from_body: Transform<Ego, CameraBody> =
        Transform::from_roll_pitch_yaw(Point::new(x, y, z), roll_rad, pitch_rad, yaw_rad);
    ego_from_body * body_from_optical()
}

/// Frame of a camera's housing: x along the optical axis, y left, z up.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
struct CameraBody;

/// Rotation from optical axes (x right, y down, z forward) to those of the housing (x forward, y left, z up).
fn body_from_optical() -> Transform<CameraBody, swerve_geom::Camera> {
    let quarter = core::f64::consts::FRAC_PI_2;
    Transform::from_roll_pitch_yaw(Point::default(), -quarter, 0.0, -quarter)
}

#[cfg(test)]
mod tests;
