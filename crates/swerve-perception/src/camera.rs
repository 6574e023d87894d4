//! Objects in the images of one camera: what a sliding window finds, and where that stands on the ground.
//!
//! A box in the image tells the distance twice (Hoiem, Efros, Hebert: "Putting objects in perspective", IJCV 2008,
//! section 2). Its foot lies on a ray that meets level ground, and it is as high as such a thing mostly is. Both give
//! `rho`, one over the depth of the face that is seen, each with a deviation of its own, and the mean weighs them by
//! these (module `place`). Objects are completed to the size of their class behind that face.

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

/// Boxes of like things that share more than this of the smaller one are of one thing, and the surer stays.
const OVERLAP: f64 = 0.65;

/// Boxes that share more than this of the union with a better one say where it is.
const VOTES: f64 = 0.65;

/// Rows that the horizon may move by before the scanner is made anew, pixels: less than any rung tolerates.
const HORIZON_STEP_PX: f64 = 3.0;

/// An image, and what is known of where it was taken.
#[derive(Clone, Copy, Debug)]
pub struct Shot<'a> {
    /// The image, in colour. A lens that bends is taken as rectified.
    pub image: &'a Image,
    /// The ego at its stamp.
    pub ego: Pose2,
    /// Pitch of the body over the ground, nose down positive, radians.
    pub pitch_rad: f64,
    /// The way, where it is known: vehicles mostly stand along it.
    pub route: Option<&'a Route>,
}

/// A detector that cannot stand in a pipeline.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum DetectorError {
    /// What it finds is nothing that the stack knows.
    #[error("it finds `{0}`, expected classes of {expected}", expected = CLASSES.map(|class| class.name).join(", "))]
    Class(String),
    /// Its scores say nothing of how likely a box is right.
    #[error("its scores are sums, expected a detector whose scores are probabilities")]
    Scores,
}

/// An image that nothing can be found in.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum ShotError {
    /// It holds something else.
    #[error("an image without colours, expected red, green and blue")]
    NoColour,
    /// Its rays do not meet in one point.
    #[error("an image of parallel rays, expected one through a lens")]
    Parallel,
    /// It is not whole.
    #[error(transparent)]
    Size(#[from] ImageError),
}

/// Finds objects in images. What it has found before has no effect but on a rung that does not search each image whole;
/// else only its memory is kept.
#[derive(Clone, Debug)]
pub struct CameraObjects {
    weights: Weights,
    rung: Rung,
    classes: Vec<Class>,
    score_min: f64,
    /// With the size and the ground that it is for.
    scanner: Option<([usize; 2], Ground, Scanner)>,
    /// All boxes of the last image, and those of them that are left, between the places that windows have.
    all: Vec<Detection>,
    found: Vec<Detection>,
    /// Where to look: pictures of tracks, and of what was found in the image before.
    near: Vec<[f64; 4]>,
    images: u32,
}

impl CameraObjects {
    /// With what was learnt, on one of its rungs; boxes with a lower score are not reported.
    ///
    /// # Errors
    /// A detector of other things, or of scores that are no probabilities.
    pub fn new(weights: Weights, rung: Rung, score_min: f64) -> Result<Self, DetectorError> {
        let known = |name: &String| Class::of(name).ok_or_else(|| DetectorError::Class(name.clone()));
        let classes = weights.classes.iter().map(known).collect::<Result<_, _>>()?;
        if rung.calibrations.is_empty() {
            return Err(DetectorError::Scores);
        }
        let (all, found, near) = (Vec::new(), Vec::new(), Vec::new());
        Ok(Self { weights, rung, classes, score_min, scanner: None, all, found, near, images: 0 })
    }

    /// Finds the objects of an image, by falling score, and writes them over what was there. Where `tracks` are known, a
    /// rung that does not search each image whole looks in the others around them alone, and around what it found in the
    /// image before.
    ///
    /// # Errors
    /// An image without colours, not whole, or of parallel rays.
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
            // Who was found just now is followed by nobody yet: a tracker waits to see them again.
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

    /// Fills `found`, the likeliest first; around what is near alone, where that is asked for.
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

/// Left, top, right and bottom edge of a box of left, top, width and height, within an image.
fn cut([left, top, across, down]: [f64; 4], [width, height]: [f64; 2]) -> [f64; 4] {
    [
        left.clamp(0.0, width),
        top.clamp(0.0, height),
        (left + across).clamp(0.0, width),
        (top + down).clamp(0.0, height),
    ]
}
