//! Detections in images and point clouds.

use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::{Ego, Pose2};

use crate::{ActorKind, Extent};

/// One detection: an upright box without identity or velocity.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct DetectedBox {
    /// Estimated class.
    pub kind: ActorKind,
    /// Confidence of the detector, 0 to 1; not a probability.
    pub score: f64,
    /// Pose of the footprint's centre in the ego frame at the stamp.
    pub pose: Pose2<Ego>,
    /// Height of the bottom face above the ego's ground plane, metres.
    pub bottom_m: f64,
    /// Size.
    pub extent: Extent,
    /// Left, top, right and bottom edge of the bounding box in the image, clipped to it, pixels; `None` without a
    /// camera or if outside the image.
    pub image_px: Option<[f64; 4]>,
    /// Covariance of the position in the ego frame: xx, xy, yy, m²; `None` if the detector does not estimate it.
    #[serde(default)]
    pub covariance_m2: Option<[f64; 3]>,
    /// Speed over ground along the line of sight, m/s, positive if receding; `None` without a radar measurement.
    #[serde(default)]
    pub radial_speed_mps: Option<f64>,
}

impl DetectedBox {
    /// Box on the ground, without edges in an image, covariance or speed.
    pub fn on_ground(kind: ActorKind, score: f64, pose: Pose2<Ego>, extent: Extent) -> Self {
        let (image_px, covariance_m2, radial_speed_mps) = (None, None, None);
        Self { kind, score, pose, bottom_m: 0.0, extent, image_px, covariance_m2, radial_speed_mps }
    }

    /// Returns true if pose and size are finite, the size is positive, and the image edges and covariance, where
    /// present, are valid.
    pub fn is_finite(&self) -> bool {
        let Extent { length_m, width_m, height_m } = self.extent;
        let is_spread =
            |[xx, xy, yy]: [f64; 3]| xx > 0.0 && yy > 0.0 && xx * yy > xy * xy && (xx * yy).is_finite();
        self.pose.is_finite()
            && self.bottom_m.is_finite()
            && [length_m, width_m, height_m].iter().all(|m| m.is_finite() && *m > 0.0)
            && self.image_px.is_none_or(|edges| edges.iter().all(|px| px.is_finite()))
            && self.covariance_m2.is_none_or(is_spread)
    }
}

/// All detections of a detector at one instant.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Detections {
    /// Instant of the measurement.
    pub stamp: Time,
    /// By falling score.
    pub boxes: Vec<DetectedBox>,
}
