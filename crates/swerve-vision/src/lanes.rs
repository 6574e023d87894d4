//! Detection of the markings of the ego's lane in one camera image, as curves on the road.
//!
//! ```text
//! image ─> level view ─┬─ ridges ─> aligned offsets ─────┬─> joint fit of both lines and the pitch ─> lines
//!                      └─ edges ─> Hough: pair of lines ─┘
//! ```
//!
//! The level view is the image of an ideal camera at the same position that looks straight ahead: lens distortion and
//! mounting are removed, and each of its rows is a distance on a flat road. Body pitch and road grade appear as one
//! additional angle, estimated in every frame: half a degree moves the road 20 m ahead by 2.6 m under a camera at 1.35
//! m. In the level view both lines of a lane are parabolas with a common heading and curvature (Guiducci, "Parametric
//! model of the perspective projection of a road", 2000; McCall and Trivedi, IEEE T-ITS 7(1), 2006, for a survey).
//!
//! Not modelled: errors of the camera height, known to a few percent only (offsets scale with it), body roll, and
//! vertical curvature of the road.

mod edges;
mod fit;
mod level;
mod ridge;
mod search;
#[cfg(test)]
mod simulated;
#[cfg(test)]
mod tests;

use swerve_core::param::{ParamError, Ranges, require};
use swerve_geom::{Camera, Ego, Point, Transform, math};
use thiserror::Error;

use self::edges::Edges;
use self::fit::{Fit, Fitted, Road};
use self::level::{Lens, LevelView};
use self::ridge::Ridges;
use self::search::Offsets;
use crate::Rgb;

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

/// Method of detecting lane markings.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Method {
    /// Edges (Canny, PAMI 1986) on two straight lines (Hough; Duda and Hart, CACM 1972).
    Hough,
    /// Strips of paint width that are brighter than both neighbours and align along the road.
    #[default]
    Ridge,
}

impl Method {
    /// All methods.
    pub const ALL: [Self; 2] = [Self::Hough, Self::Ridge];

    /// Name of the method.
    pub fn name(self) -> &'static str {
        ["hough", "ridge"][self as usize]
    }
}

/// Settings of lane detection.
#[derive(Clone, Copy, PartialEq, Debug, Ranges)]
pub struct LaneSettings {
    /// Detection method.
    pub method: Method,
    /// Width of a painted line, metres.
    #[schemars(range(min = 0.02, max = 1.0))]
    pub mark_m: f64,
    /// Detection range from the camera, metres. A longer range detects curves earlier, from fewer pixels.
    #[schemars(range(min = 10.0, max = 200.0))]
    pub reach_m: f64,
    /// Standard deviation of the pitch, radians; the search covers three of them.
    #[schemars(range(min = 1e-4, max = 0.05))]
    pub pitch_deviation_rad: f64,
    /// Narrowest and widest lane, metres.
    pub width_m: [f64; 2],
}

impl Default for LaneSettings {
    fn default() -> Self {
        Self {
            method: Method::default(),
            mark_m: 0.15,
            reach_m: 50.0,
            pitch_deviation_rad: 0.015,
            width_m: [2.4, 4.8],
        }
    }
}

impl LaneSettings {
    /// Checks that all values are in range.
    ///
    /// # Errors
    /// The first value out of range.
    pub fn validate(&self) -> Result<(), ParamError> {
        let [narrow, wide] = self.width_m;
        self.check_ranges()?;
        require("width_m", narrow, (1.0..=20.0).contains(&narrow), "a narrowest lane of 1 to 20 m")?;
        require(
            "width_m",
            wide,
            wide > narrow && wide <= 20.0,
            "a widest lane beyond the narrowest, at most 20 m",
        )
    }
}

/// Painted line beside the ego: `y = c0 + c1 x + c2 x²` in the ego frame, metres, valid where it was observed.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LaneLine {
    /// `c0` (m), `c1`, `c2` (1/m).
    pub coefficients: [f64; 3],
    /// Covariance of the coefficients.
    pub covariance: [[f64; 3]; 3],
    /// `x` of the nearest and of the farthest observed mark, metres; there may be gaps in between.
    pub seen_m: [f64; 2],
}

impl LaneLine {
    /// Lateral position at `x_m` ahead of the ego's origin and its standard deviation, metres; `None` outside the
    /// observed range.
    pub fn at(&self, x_m: f64) -> Option<(f64, f64)> {
        let powers = [1.0, x_m, x_m * x_m];
        let is_seen = self.seen_m[0] <= x_m && x_m <= self.seen_m[1];
        is_seen.then(|| {
            let y_m = (0..3).map(|k| self.coefficients[k] * powers[k]).sum();
            let terms = (0..9).map(|k| powers[k / 3] * self.covariance[k / 3][k % 3] * powers[k % 3]);
            (y_m, terms.sum::<f64>().max(0.0).sqrt())
        })
    }
}

/// Lane lines detected in one image.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Lanes {
    /// Line on the ego's left.
    pub left: Option<LaneLine>,
    /// Line on the ego's right.
    pub right: Option<LaneLine>,
    /// Estimated pitch relative to the mounting, radians, positive down; zero without lines.
    pub pitch_rad: f64,
}

/// Reason that an image cannot be processed.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum LaneError {
    /// Invalid camera, camera that does not see the road, or setting out of range.
    #[error(transparent)]
    Param(#[from] ParamError),
    /// Image size that differs from the camera's.
    #[error("an image of {found:?} pixels, expected {expected:?}, which the camera is calibrated for")]
    Size {
        /// Columns and rows.
        expected: [usize; 2],
        /// Columns and rows.
        found: [usize; 2],
    },
}

/// Detects the lines of the ego's lane; reuses its buffers.
#[derive(Clone, Debug)]
pub struct LaneFinder {
    camera: RoadCamera,
    settings: LaneSettings,
    view: LevelView,
    ridges: Ridges,
    offsets: Offsets,
    edges: Edges,
    marks: Vec<Mark>,
    guesses: Vec<Road>,
    fit: Fit,
}

/// Piece of paint in one row of the level view, as the slopes of its ray: left and down per metre ahead.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Mark {
    left: f64,
    down: f64,
    /// Contrast with its surroundings, grey levels of 255.
    contrast: f64,
}

impl Mark {
    /// Weight of the mark; higher contrast is more likely paint.
    fn weight(&self) -> f64 {
        (self.contrast / CONTRAST_FULL).min(1.0)
    }

    /// Position on the road, for a camera at `height_m` pitched down relative to its mounting by an angle of this sine
    /// and cosine: metres ahead of the camera and to its left; `None` above the horizon.
    fn on_road(&self, height_m: f64, [sin, cos]: [f64; 2]) -> Option<[f64; 2]> {
        let ahead = cos - self.down * sin;
        let down = self.down * cos + sin;
        (down > 0.0 && ahead > 0.0).then(|| [height_m * ahead / down, height_m * self.left / down])
    }
}

/// Contrast above which all marks have full weight, grey levels.
const CONTRAST_FULL: f64 = 100.0;
/// Pitch above which marks are detected again with corrected widths, radians.
const LOOK_AGAIN_RAD: f64 = 0.004;

impl LaneFinder {
    /// Finder for the images of one camera.
    ///
    /// # Errors
    /// If a value of the camera or the settings is out of range.
    pub fn new(camera: RoadCamera, settings: LaneSettings) -> Result<Self, LaneError> {
        check_camera(&camera)?;
        settings.validate()?;
        let pitch_rad = 3.0 * settings.pitch_deviation_rad;
        Ok(Self {
            camera,
            settings,
            view: LevelView::new(&camera, pitch_rad, settings.reach_m),
            ridges: Ridges::default(),
            offsets: Offsets::new(settings),
            edges: Edges::new(settings),
            marks: Vec::new(),
            guesses: Vec::new(),
            fit: Fit::new(settings, camera.ego_from_camera.origin().coords.into()),
        })
    }

    /// Detects the lane lines in an image.
    ///
    /// # Errors
    /// If the image size differs from the camera's.
    pub fn find(&mut self, image: Rgb<'_>) -> Result<Lanes, LaneError> {
        let found = [image.width(), image.height()];
        if found != self.camera.size_px {
            return Err(LaneError::Size { expected: self.camera.size_px, found });
        }
        self.view.look(image);
        let mut fitted = self.look(0.0);
        if let Some(first) = fitted.filter(|first| first.road.pitch_rad.abs() > LOOK_AGAIN_RAD) {
            fitted = self.look(first.road.pitch_rad);
        }
        Ok(fitted.map(|fitted| self.fit.lanes(&fitted, &self.marks)).unwrap_or_default())
    }

    /// Best-supported road, with mark widths computed for this pitch.
    fn look(&mut self, pitch_rad: f64) -> Option<Fitted> {
        let (height_m, mark_m) = (self.view.height_m(), self.settings.mark_m);
        self.guesses.clear();
        match self.settings.method {
            Method::Ridge => {
                self.ridges.find(&self.view, pitch_rad, mark_m, &mut self.marks);
                self.offsets.guess(&self.marks, height_m, &mut self.guesses);
            }
            Method::Hough => {
                self.edges.find(&self.view, pitch_rad, mark_m, &mut self.marks);
                self.edges.guess(&self.marks, height_m, &mut self.guesses);
            }
        }
        let fits =
            self.guesses.iter().map(|guess| self.fit.refine(*guess, &self.marks, self.view.focal_px()));
        let fits = fits.filter(|fitted| self.fit.is_plausible(&fitted.road));
        fits.reduce(|best, other| if other.support > best.support { other } else { best })
    }
}

fn check_camera(camera: &RoadCamera) -> Result<(), ParamError> {
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
    let ahead = camera.ego_from_camera * swerve_geom::Vector::new(0.0, 0.0, 1.0);
    require(
        "camera direction",
        ahead.coords.x,
        ahead.coords.x > 0.5,
        "less than 60 degrees from straight ahead",
    )
}
