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
}

/// All that a detector reports of one instant.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Detections {
    /// Instant of the measurement.
    pub stamp: Time,
    /// By falling score.
    pub boxes: Vec<DetectedBox>,
}
