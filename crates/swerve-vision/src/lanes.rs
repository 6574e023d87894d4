//! Detection of the markings of the ego's lane in one camera image, as curves on the road.
//!
//! ```text
//! image ─> level view ─┬─ ridges ─> aligned offsets ─────┬─> joint fit of both lines and the pitch ─> lines
//!                      └─ edges ─> Hough: pair of lines ─┘
//! ```
//!
//! The range of the pitch is divided into bands: the width of a mark in the image depends on the pitch, by a factor of
//! two within 2 degrees at 15 m, and marks of a wrong width are missed. The result is the road whose lines have the most
//! marks in excess of chance. The number of marks alone favours roads that meet many marks of grass and traffic.
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

use core::mem;

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
use self::settings::Band;
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
    marks_of_best: Vec<Mark>,
    guesses: Vec<Road>,
    fit: Fit,
}

/// Pitch above which marks are detected again with corrected widths, radians.
const LOOK_AGAIN_RAD: f64 = 0.004;
/// Relative penalty of a road at a pitch of three standard deviations.
const PITCH_LOSS: f64 = 0.2;

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
            marks_of_best: Vec::new(),
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
        if self.settings.method == Method::Hough {
            self.edges.detect(&self.view);
        }
        Ok(self.search().map(|fitted| self.fit.lanes(&fitted, &self.marks)).unwrap_or_default())
    }

    /// Road with the most evidence at any pitch; `marks` are then those at its pitch.
    fn search(&mut self) -> Option<Fitted> {
        let deviation_rad = self.settings.pitch_deviation_rad;
        let mut best: Option<Candidate> = None;
        for band in Band::all(3.0 * deviation_rad) {
            let Some(found) = self.look_twice(band) else { continue };
            if best.is_none_or(|best| found.total() > best.total()) {
                best = Some(found);
                mem::swap(&mut self.marks, &mut self.marks_of_best);
            }
            // A lane at a likely pitch: the others are not searched.
            let is_likely = band.middle_rad == 0.0 && band.half_rad >= deviation_rad;
            if is_likely && found.is_lane() && band.contains(found.fitted.road.pitch_rad) {
                break;
            }
        }
        mem::swap(&mut self.marks, &mut self.marks_of_best);
        best.map(|best| best.fitted)
    }

    /// Best road of a band, with mark widths at its own pitch.
    fn look_twice(&mut self, band: Band) -> Option<Candidate> {
        let first = self.look(band.middle_rad, band)?;
        let pitch_rad = first.fitted.road.pitch_rad;
        let is_near = (pitch_rad - band.middle_rad).abs() <= LOOK_AGAIN_RAD;
        if is_near { Some(first) } else { self.look(pitch_rad, band) }
    }

    /// Road of a band with the most evidence, with mark widths at `pitch_rad`.
    fn look(&mut self, pitch_rad: f64, band: Band) -> Option<Candidate> {
        let (height_m, mark_m) = (self.view.height_m(), self.settings.mark_m);
        self.guesses.clear();
        match self.settings.method {
            Method::Ridge => {
                self.ridges.find(&self.view, pitch_rad, mark_m, &mut self.marks);
                self.offsets.guess(&self.marks, height_m, band, &mut self.guesses);
            }
            Method::Hough => {
                self.edges.marks(&self.view, pitch_rad, mark_m, &mut self.marks);
                self.edges.guess(&self.marks, height_m, band, &mut self.guesses);
            }
        }
        let mut best: Option<Candidate> = None;
        for guess in &self.guesses {
            let fitted = self.fit.refine(*guess, &self.marks, self.view.focal_px());
            if !self.fit.is_plausible(&fitted.road) {
                continue;
            }
            let out = fitted.road.pitch_rad / (3.0 * self.settings.pitch_deviation_rad);
            let evidence = self.fit.evidence(&fitted.road, &self.marks);
            let found =
                Candidate { fitted, evidence: evidence.map(|line| line * (1.0 - PITCH_LOSS * out * out)) };
            if found.total() > best.map_or(0.0, |best| best.total()) {
                best = Some(found);
            }
        }
        best
    }
}

/// Road with its evidence.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    fitted: Fitted,
    /// Marks of each line in excess of those expected by chance, fewer at an unlikely pitch; zero without a line.
    evidence: [f64; 2],
}

impl Candidate {
    fn is_lane(&self) -> bool {
        self.evidence.iter().all(|line| *line > 0.0)
    }

    fn total(&self) -> f64 {
        self.evidence[0] + self.evidence[1]
    }
}
