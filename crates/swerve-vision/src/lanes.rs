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

mod camera;
mod edges;
mod fit;
mod level;
mod line;
mod ridge;
mod search;
mod settings;
#[cfg(test)]
mod simulated;
#[cfg(test)]
mod tests;

use swerve_core::param::ParamError;
use thiserror::Error;

pub use self::camera::RoadCamera;
use self::camera::check_camera;
use self::edges::Edges;
use self::fit::{Fit, Fitted, Road};
use self::level::LevelView;
use self::line::Mark;
pub use self::line::{LaneLine, Lanes};
use self::ridge::Ridges;
use self::search::Offsets;
pub use self::settings::{LaneSettings, Method};
use crate::Rgb;

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
