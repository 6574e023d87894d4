use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::{Ego, Pose2};

use crate::{ActorKind, Extent};

/// One thing that a detector reports: a box that stands upright, without identity or velocity.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct DetectedBox {
    /// What it is taken for.
    pub kind: ActorKind,
    /// How sure the detector is, 0 to 1; not a probability.
    pub score: f64,
    /// Pose of the centre of its footprint in the ego frame of the stamp.
    pub pose: Pose2<Ego>,
    /// Height of its bottom over the ego's ground plane, metres.
    pub bottom_m: f64,
    /// Size.
    pub extent: Extent,
    /// Left, top, right and bottom edge of its picture, cut at the image's edges, pixels; `None` without a camera
    /// and where nothing of it is in the image.
    pub image_px: Option<[f64; 4]>,
    /// Covariance of the place in the ego frame: xx, xy, yy, m²; `None` from what does not know it.
    #[serde(default)]
    pub covariance_m2: Option<[f64; 3]>,
    /// Speed over ground along the line of sight, m/s, positive for what goes away; `None` where no radar says it.
    #[serde(default)]
    pub radial_speed_mps: Option<f64>,
}

impl DetectedBox {
    /// Whether it is somewhere and has a size, and whether what is told of its picture and its errors are edges and a
    /// covariance.
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

/// All that a detector reports of one instant.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Detections {
    /// Instant of the measurement.
    pub stamp: Time,
    /// By falling score.
    pub boxes: Vec<DetectedBox>,
}
