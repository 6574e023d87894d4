//! A detector emulated from truth: what one of a given accuracy would have reported.
//!
//! Every draw is keyed by (seed, operator name, instant, actor), so that neither the order of frames nor what else is
//! in sight changes it. What real detectors get wrong they get wrong again in the next frame: each draw is therefore
//! mostly one that is shared by neighbouring instants ([`Drift`]), with the same distribution at each single one.
//!
//! Of an actor at distance `d` of which the share `s` is visible:
//! - it is **missed** unless a draw falls below
//!   `recall_best * L((half_distance - d * 1.7 m / height) / spread) * L((s - half_visibility) / visibility_scale)`, `L` the
//!   logistic function: what is small or far covers few pixels;
//! - its **place** is off along the line of sight by `range_noise_m + range_noise_share * d` and across it by
//!   `bearing_noise_rad`, its **size** and **heading** by theirs times `1 + d / 30 m`;
//! - its **score** is `L(±score_separation / 2 + n)`, `n` standard normal, plus for what is there and minus for what is not.
//!
//! **False positives** stand at places of the map (cells of 4 m) for as long as a draw lasts, in a corridor ahead
//! of the car.

mod drift;
mod false_positives;
mod params;
#[cfg(test)]
mod tests;

use swerve_core::{ParamError, Rng, Time};
use swerve_geom::{Ego, Point2, Pose2, math};
use swerve_msg::truth::Surroundings;
use swerve_msg::{DetectedBox, Detections, Extent, Obstacle};

use crate::image_box::ImageCamera;

pub use drift::Drift;
pub use params::{Params, Sensing};

/// Height of the thing that `half_distance_m` is said of, metres: a person.
const USUAL_HEIGHT_M: f64 = 1.7;

/// Errors of size and heading are twice as large at this distance as at none, metres: what is far covers fewer pixels.
const DOUBLES_AT_M: f64 = 30.0;

/// Smallest part of its size that a box is reported with.
const SHRINKS_TO: f64 = 0.3;

/// An emulated detector. It holds no state: what it reports is a function of what it is given.
#[derive(Clone, PartialEq, Debug)]
pub struct Detector {
    params: Params,
    camera: Option<ImageCamera>,
    key: u64,
}

impl Detector {
    /// With its parameters, the camera whose image the boxes are also drawn in, and the key of its draws.
    ///
    /// # Errors
    /// A parameter outside its range.
    pub fn new(
        params: Params,
        camera: Option<ImageCamera>,
        seed: u64,
        name: &str,
    ) -> Result<Self, ParamError> {
        params.validate()?;
        Ok(Self { params, camera, key: Rng::keyed(seed, name, &[]).bits() })
    }

    /// What it makes of what there is to see. With a camera, what has no picture is not reported.
    pub fn detect(&self, seen: &Surroundings) -> Detections {
        let found = seen.obstacles.iter().filter_map(|obstacle| self.found(obstacle, seen));
        let mut boxes: Vec<DetectedBox> =
            found.chain(self.false_positives(seen)).filter_map(|found| self.pictured(found)).collect();
        // The order tells nothing of what is true.
        boxes.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.pose.x_m.total_cmp(&b.pose.x_m)));
        Detections { stamp: seen.stamp, boxes }
    }

    /// Probability that this is reported at all.
    pub fn recall(&self, distance_m: f64, extent: Extent, visible_share: f64) -> f64 {
        let p = &self.params;
        let as_person_m = distance_m * USUAL_HEIGHT_M / extent.height_m.max(0.1);
        p.recall_best
            * logistic((p.half_distance_m - as_person_m) / p.distance_scale_m)
            * logistic((visible_share - p.half_visibility) / p.visibility_scale)
    }

    fn found(&self, obstacle: &Obstacle, seen: &Surroundings) -> Option<DetectedBox> {
        let p = &self.params;
        let at: Point2<Ego> = seen.ego.to_local(obstacle.pose.point());
        let distance_m = math::hypot(at.x_m, at.y_m);
        let of = |what: &'static str| Of { what, id: i64::from(obstacle.id.0), at: seen.stamp };
        let missed = 1.0 - self.recall(distance_m, obstacle.extent, obstacle.visible_share);
        if uniform(self.draw(of("missed"), p.misses)) < missed {
            return None;
        }
        let place = |what| self.draw(of(what), p.pose_errors);
        let range_m =
            (distance_m + (p.range_noise_m + p.range_noise_share * distance_m) * place("range")).max(0.1);
        let bearing_rad = math::atan2(at.y_m, at.x_m) + p.bearing_noise_rad * place("bearing");
        let (sin, cos) = math::sin_cos(bearing_rad);
        let grown = 1.0 + distance_m / DOUBLES_AT_M;
        let true_heading_rad = obstacle.pose.heading_rad - seen.ego.heading_rad;
        let heading_rad = true_heading_rad + p.heading_noise_rad * grown * place("heading");
        let size = |what, m: f64| m * (1.0 + p.size_noise_share * grown * place(what)).max(SHRINKS_TO);
        let length_m = size("length", obstacle.extent.length_m);
        // What is round stays round.
        let is_round = obstacle.extent.length_m == obstacle.extent.width_m;
        let width_m = if is_round { length_m } else { size("width", obstacle.extent.width_m) };
        Some(DetectedBox {
            kind: obstacle.kind,
            score: logistic(0.5 * p.score_separation + self.draw(of("score"), p.misses)),
            pose: Pose2::new(range_m * cos, range_m * sin, heading_rad),
            bottom_m: 0.0,
            extent: Extent { length_m, width_m, height_m: size("height", obstacle.extent.height_m) },
            image_px: None,
            covariance_m2: None,
            radial_speed_mps: None,
        })
    }

    /// With its picture; none for what a camera would have to show and does not.
    fn pictured(&self, found: DetectedBox) -> Option<DetectedBox> {
        let Some(camera) = &self.camera else { return Some(found) };
        let image_px = camera.image_px(found.pose, found.bottom_m, found.extent)?;
        Some(DetectedBox { image_px: Some(image_px), ..found })
    }

    /// A standard normal number of this thing at this instant.
    fn draw(&self, of: Of, drift: Drift) -> f64 {
        drift.at(of.at, |when, index| self.rng(of.what, &[of.id, when, index]).normal())
    }

    fn rng(&self, what: &str, key: &[i64]) -> Rng {
        Rng::keyed(self.key, what, key)
    }
}

/// What a draw is of.
#[derive(Clone, Copy)]
struct Of {
    what: &'static str,
    id: i64,
    at: Time,
}

fn logistic(x: f64) -> f64 {
    1.0 / (1.0 + math::exp(-x))
}

/// The standard normal distribution function: makes of a normal number one that is uniform in 0 to 1.
fn uniform(normal: f64) -> f64 {
    0.5 * libm::erfc(-normal / core::f64::consts::SQRT_2)
}
