//! Object detection in the images of one camera: sliding-window detections and their positions on the ground.
//!
//! A box in the image gives two estimates of the distance (Hoiem, Efros, Hebert: "Putting objects in perspective", IJCV
//! 2008, section 2): its foot lies on a ray that meets level ground, and its height is the usual height of the class.
//! Both estimate `rho`, the inverse depth of the visible face, and are averaged with their inverse variances (module
//! `place`). Objects are completed behind that face to the size of their class.

mod place;
#[cfg(test)]
mod tests;

use swerve_geom::{Ego, Pose2};
use swerve_msg::{DetectedBox, Detections, Image, Pixels, Route, TrackList};
use swerve_vision::acf::{Detection, Ground, Overlap, Rung, Scanner, Weights, share, suppress, vote};
use swerve_vision::{ImageError, Rgb};
use thiserror::Error;

use crate::road::Road;
use place::{CLASSES, Class, Eye};

/// Overlap, as a share of the smaller box, above which boxes of similar classes are the same object; the higher score
/// wins.
const OVERLAP: f64 = 0.65;

/// IoU with a kept box above which a suppressed box contributes to its position.
const VOTES: f64 = 0.65;

/// Horizon shift after which the scanner is rebuilt, pixels; smaller than the tolerance of any rung.
const HORIZON_STEP_PX: f64 = 3.0;

/// Image and the state of the ego when it was taken.
#[derive(Clone, Copy, Debug)]
pub struct Shot<'a> {
    /// Colour image, treated as rectified.
    pub image: &'a Image,
    /// Ego pose at the image's stamp.
    pub ego: Pose2,
    /// Pitch of the body relative to the ground, radians, nose down positive.
    pub pitch_rad: f64,
    /// Route, if known; vehicles mostly stand parallel to it.
    pub route: Option<&'a Route>,
}

/// Error of a detector that cannot be used in a pipeline.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum DetectorError {
    /// Detector class unknown to the stack.
    #[error("it finds `{0}`, expected classes of {expected}", expected = CLASSES.map(|class| class.name).join(", "))]
    Class(String),
    /// Detector without calibrated scores.
    #[error("its scores are sums, expected a detector whose scores are probabilities")]
    Scores,
}

/// Error of an image that cannot be processed.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum ShotError {
    /// Image without colours.
    #[error("an image without colours, expected red, green and blue")]
    NoColour,
    /// Image of a parallel projection.
    #[error("an image of parallel rays, expected one through a lens")]
    Parallel,
    /// Image size that does not match its number of bytes.
    #[error(transparent)]
    Size(#[from] ImageError),
    /// Reason of a custom detector.
    #[error("{0}")]
    Other(String),
}

/// A detector of objects in the images of one camera.
pub trait CameraDetector: Send {
    /// Detects the objects of an image, by falling score, and replaces the content of `out`: boxes on the ground, in the
    /// ego frame at the image's stamp. `tracks` are present for a detector that searches around them.
    ///
    /// # Errors
    /// If the image cannot be processed; this ends the run.
    fn detect(
        &mut self,
        shot: &Shot<'_>,
        tracks: Option<&TrackList>,
        out: &mut Detections,
    ) -> Result<(), ShotError>;
}

impl CameraDetector for CameraObjects {
    fn detect(
        &mut self,
        shot: &Shot<'_>,
        tracks: Option<&TrackList>,
        out: &mut Detections,
    ) -> Result<(), ShotError> {
        self.detect(shot, tracks, out)
    }
}

/// Detects objects in images. Stateless except for reused buffers, unless the rung does not search each image
/// completely; then previous detections define search areas.
#[derive(Clone, Debug)]
pub struct CameraObjects {
    weights: Weights,
    rung: Rung,
    classes: Vec<Class>,
    score_min: f64,
    /// Scanner with the image size and ground that it was built for.
    scanner: Option<([usize; 2], Ground, Scanner)>,
    /// All boxes of the last image, and those kept, with positions averaged between windows.
    all: Vec<Detection>,
    found: Vec<Detection>,
    /// Search areas: projections of tracks, and detections of the previous image.
    near: Vec<[f64; 4]>,
    images: u32,
}

impl CameraObjects {
    /// Detector with these weights at one of their rungs; boxes with a lower score than `score_min` are not reported.
    ///
    /// # Errors
    /// If the detector has unknown classes or uncalibrated scores.
    pub fn new(weights: Weights, rung: Rung, score_min: f64) -> Result<Self, DetectorError> {
        let known = |name: &String| Class::of(name).ok_or_else(|| DetectorError::Class(name.clone()));
        let classes = weights.classes.iter().map(known).collect::<Result<_, _>>()?;
        if rung.calibrations.is_empty() {
            return Err(DetectorError::Scores);
        }
        let (all, found, near) = (Vec::new(), Vec::new(), Vec::new());
        Ok(Self { weights, rung, classes, score_min, scanner: None, all, found, near, images: 0 })
    }

    /// Detects the objects of an image, by falling score, and replaces the content of `out`. With `tracks`, a rung that
    /// does not search each image completely searches the others only around the tracks and around the detections of
    /// the previous image.
    ///
    /// # Errors
    /// If the image has no colours, a size that does not match its bytes, or parallel rays.
    pub fn detect(
        &mut self,
        shot: &Shot<'_>,
        tracks: Option<&TrackList>,
        out: &mut Detections,
    ) -> Result<(), ShotError> {
        let Pixels::Rgb8(bytes) = &shot.image.pixels else { return Err(ShotError::NoColour) };
        if shot.image.camera.intrinsics.is_parallel {
            return Err(ShotError::Parallel);
        }
        let size = [shot.image.width_px, shot.image.height_px].map(|px| px as usize);
        let eye = Eye::new(&shot.image.camera, shot.pitch_rad);
        let image = Rgb::new(size[0], size[1], bytes)?;
        let followed = tracks.filter(|_| !self.images.is_multiple_of(self.rung.whole_every));
        self.images = self.images.wrapping_add(1);
        self.near.clear();
        if let Some(tracks) = followed {
            let passed_s = (shot.image.stamp - tracks.stamp).as_secs();
            self.near.extend(tracks.tracks.iter().filter_map(|track| {
                let at = shot.ego.to_local::<Ego>(track.pose.point() + track.velocity_mps * passed_s);
                let heading_rad = track.pose.heading_rad - shot.ego.heading_rad;
                eye.picture(Pose2::new(at.x_m, at.y_m, heading_rad), track.extent, size)
            }));
            // New detections are not tracked yet, as a track is reported only after further hits.
            self.near.extend(self.found.iter().filter(|one| one.score >= self.score_min).map(|one| one.bbox));
        }
        self.look(image, eye.ground(), followed.is_some());
        let (road, size) = (Road::new(shot.route, shot.ego), size.map(|px| px as f64));
        out.stamp = shot.image.stamp;
        out.boxes.clear();
        let mut kept: Vec<[f64; 4]> = Vec::new();
        for one in self.found.iter().filter(|one| one.score >= self.score_min) {
            let class = self.classes[one.class];
            let is_again = |(other, bbox): (&DetectedBox, &[f64; 4])| {
                other.kind.is_person() == class.kind.is_person()
                    && share(*bbox, one.bbox, Overlap::Smaller) > OVERLAP
            };
            if out.boxes.iter().zip(&kept).any(is_again) {
                continue;
            }
            let Some((pose, covariance_m2)) = eye.place(&class, one.bbox, size[1], &road) else { continue };
            out.boxes.push(DetectedBox {
                kind: class.kind,
                score: one.score,
                pose,
                bottom_m: 0.0,
                extent: class.extent,
                image_px: Some(cut(one.bbox, size)),
                covariance_m2: Some(covariance_m2),
                radial_speed_mps: None,
            });
            kept.push(one.bbox);
        }
        Ok(())
    }

    /// Fills `found` by falling score; if `is_near`, only from the search areas.
    fn look(&mut self, image: Rgb<'_>, ground: Ground, is_near: bool) {
        let size = [image.width(), image.height()];
        let stays = |(of, at, _): &([usize; 2], Ground, Scanner)| {
            let moved_px = (at.horizon_px - ground.horizon_px).abs();
            *of == size
                && moved_px <= HORIZON_STEP_PX
                && *at == Ground { horizon_px: at.horizon_px, ..ground }
        };
        let known = self.scanner.take().filter(stays);
        let (of, at, mut scanner) = known.unwrap_or_else(|| {
            (size, ground, Scanner::new(self.weights.clone(), self.rung.clone(), size, Some(ground)))
        });
        self.found.clear();
        scanner.look_near(is_near.then_some(&self.near));
        scanner.detect_all(image, &mut self.all).expect("it is for images of this size");
        self.found.extend_from_slice(&self.all);
        suppress(&mut self.found, self.weights.overlap.0, self.weights.overlap.1);
        vote(&mut self.found, &self.all, VOTES);
        self.scanner = Some((of, at, scanner));
    }
}

/// Edges (left, top, right, bottom) of a box given as left, top, width and height, clipped to the image.
fn cut([left, top, across, down]: [f64; 4], [width, height]: [f64; 2]) -> [f64; 4] {
    [
        left.clamp(0.0, width),
        top.clamp(0.0, height),
        (left + across).clamp(0.0, width),
        (top + down).clamp(0.0, height),
    ]
}
