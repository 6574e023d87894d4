//! Tracking metrics: CLEAR MOT, IDF1 and HOTA of one sequence.
//!
//! They match TrackEval 1.3 frame by frame, including its tolerance of one unit in the last place at thresholds and its
//! choice among equal boxes. A ratio with a zero denominator is `None`, where TrackEval prints 0 or 1.

mod assignment;
mod clear;
mod hota;
mod identity;
#[cfg(test)]
mod tests;

use serde::Serialize;

use crate::overlap::overlapping;

pub use clear::ClearMot;
pub use hota::Hota;
pub use identity::IdentityScore;

/// Minimum overlap of a match in CLEAR MOT and IDF1.
pub const SIMILARITY_MIN: f64 = 0.5;

/// One frame: ground truth ids, track ids and similarities. Each id occurs at most once.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct TrackingFrame {
    /// Ground truth ids.
    pub truth: Vec<u64>,
    /// Track ids.
    pub found: Vec<u64>,
    /// Index in `truth`, index in `found`, similarity above 0 and at most 1; each pair at most once.
    pub alike: Vec<(usize, usize, f64)>,
}

impl TrackingFrame {
    /// Frame from image boxes, each an id with left, top, right and bottom, pixels; similarity is intersection over
    /// union.
    pub fn of_boxes(truth: &[(u64, [f64; 4])], found: &[(u64, [f64; 4])]) -> Self {
        let ids = |of: &[(u64, [f64; 4])]| of.iter().map(|(id, _)| *id).collect();
        let boxes = |of: &[(u64, [f64; 4])]| of.iter().map(|(_, edges)| *edges).collect::<Vec<_>>();
        Self { truth: ids(truth), found: ids(found), alike: overlapping(&boxes(truth), &boxes(found)) }
    }
}

/// All metrics of a sequence.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct TrackingMetrics {
    /// Number of ground truth boxes over all frames.
    pub truth_boxes: usize,
    /// Number of track boxes over all frames.
    pub found_boxes: usize,
    /// CLEAR MOT: misses, false positives, switches.
    pub clear: ClearMot,
    /// IDF1: consistency of identities.
    pub identity: IdentityScore,
    /// HOTA: detection and association in balance.
    pub hota: Hota,
}

impl TrackingMetrics {
    /// Computes the metrics of a sequence's frames in order; frames without boxes may be omitted.
    pub fn of(frames: &[TrackingFrame]) -> Self {
        Self {
            truth_boxes: frames.iter().map(|f| f.truth.len()).sum(),
            found_boxes: frames.iter().map(|f| f.found.len()).sum(),
            clear: ClearMot::of(frames, SIMILARITY_MIN),
            identity: IdentityScore::of(frames, SIMILARITY_MIN),
            hota: Hota::of(frames),
        }
    }
}

/// Quotient; `None` for a zero denominator.
fn ratio(of: f64, by: f64) -> Option<f64> {
    (by > 0.0).then(|| of / by)
}
