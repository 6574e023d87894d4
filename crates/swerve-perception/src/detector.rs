//! Detector emulated from ground truth with a given accuracy.
//!
//! Every draw is keyed by (seed, operator name, instant, actor), so that it is independent of the order of frames and
//! of other actors. Errors of real detectors persist over frames, so neighbouring instants share most of each draw
//! ([`Drift`]), with an unchanged distribution at each instant.
//!
//! For an actor at distance `d` with visible share `s`:
//! - it is **missed** unless a draw falls below
//!   `recall_best * L((half_distance - d * 1.7 m / height) / spread) * L((s - half_visibility) / visibility_scale)`,
//!   `L` the logistic function: small and distant objects cover few pixels;
//! - its **position** has an error along the line of sight of `range_noise_m + range_noise_share * d` and across it of
//!   `bearing_noise_rad`; the errors of **size** and **heading** are multiplied by `1 + d / 30 m`;
//! - its **score** is `L(±score_separation / 2 + n)`, `n` standard normal, plus for actors, minus for false positives.
//!
//! **False positives** have fixed positions in the map (cells of 4 m) for the duration of a draw, in a corridor ahead
//! of the ego.

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

/// Object height to which `half_distance_m` refers, metres: a person.
const USUAL_HEIGHT_M: f64 = 1.7;

/// Distance at which the errors of size and heading are twice those at zero distance, metres; distant objects cover
/// fewer pixels.
const DOUBLES_AT_M: f64 = 30.0;

/// Smallest reported size of a box, as a share of the true size.
const SHRINKS_TO: f64 = 0.3;

/// Emulated detector. Stateless: the result is a function of its inputs.
#[derive(Clone, PartialEq, Debug)]
pub struct Detector {
    params: Params,
    camera: Option<ImageCamera>,
    key: u64,
}

impl Detector {
    /// Detector with its parameters, the camera into which the boxes are projected, and the key of its draws.
    ///
    /// # Errors
    /// If a parameter is outside its range.
    pub fn new(
        params: Params,
        camera: Option<ImageCamera>,
        seed: u64,
        name: &str,
    ) -> Result<Self, ParamError> {
        params.validate()?;
        Ok(Self { params, camera, key: Rng::keyed(seed, name, &[]).bits() })
    }

    /// Detections of the surroundings. With a camera, objects outside its image are not reported.
    pub fn detect(&self, seen: &Surroundings) -> Detections {
        let found = seen.obstacles.iter().filter_map(|obstacle| self.found(obstacle, seen));
        let mut boxes: Vec<DetectedBox> =
            found.chain(self.false_positives(seen)).filter_map(|found| self.pictured(found)).collect();
        // Sorted, so that the order does not reveal true and false positives.
        boxes.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.pose.x_m.total_cmp(&b.pose.x_m)));
        Detections { stamp: seen.stamp, boxes }
    }

    /// Detection probability.
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
        // Round objects keep equal length and width.
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

    /// Adds the image box; `None` if the object is outside the camera's image.
    fn pictured(&self, found: DetectedBox) -> Option<DetectedBox> {
        let Some(camera) = &self.camera else { return Some(found) };
        let image_px = camera.image_px(found.pose, found.bottom_m, found.extent)?;
        Some(DetectedBox { image_px: Some(image_px), ..found })
    }

    /// Standard normal draw for this object at this instant.
    fn draw(&self, of: Of, drift: Drift) -> f64 {
        drift.at(of.at, |when, index| self.rng(of.what, &[of.id, when, index]).normal())
    }

    fn rng(&self, what: &str, key: &[i64]) -> Rng {
        Rng::keyed(self.key, what, key)
    }
}

/// Key of a draw.
#[derive(Clone, Copy)]
struct Of {
    what: &'static str,
    id: i64,
    at: Time,
}

fn logistic(x: f64) -> f64 {
    1.0 / (1.0 + math::exp(-x))
}

/// Standard normal distribution function: maps a normal number to a uniform one in 0 to 1.
fn uniform(normal: f64) -> f64 {
    0.5 * libm::erfc(-normal / core::f64::consts::SQRT_2)
}
