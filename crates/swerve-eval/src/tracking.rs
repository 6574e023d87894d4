//! Metrics of tracking: CLEAR MOT, IDF1 and HOTA of one sequence.
//!
//! They count what TrackEval 1.3 counts, frame by frame: its tolerance of one unit in the last place at thresholds, its
//! order of matching. A ratio without anything to divide by is `None`, where TrackEval prints 0 or 1.

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

/// The least overlap of a match in CLEAR MOT and IDF1.
pub const SIMILARITY_MIN: f64 = 0.5;

/// One instant: who is there, who is reported, and how alike they are. No identity is there twice.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct TrackingFrame {
    /// Identities that are there.
    pub truth: Vec<u64>,
    /// Identities that are reported.
    pub found: Vec<u64>,
    /// Place in `truth`, place in `found`, similarity above 0 and at most 1; each pair at most once.
    pub alike: Vec<(usize, usize, f64)>,
}

impl TrackingFrame {
    /// Of boxes in an image, each an identity with left, top, right and bottom, pixels; similarity is intersection over
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
    /// Of all frames, boxes that are there.
    pub truth_boxes: usize,
    /// Of all frames, boxes that are reported.
    pub found_boxes: usize,
    /// Misses, false alarms, switches.
    pub clear: ClearMot,
    /// Who is followed longest under one identity.
    pub identity: IdentityScore,
    /// Detection and association in balance.
    pub hota: Hota,
}

impl TrackingMetrics {
    /// Of a sequence's frames in order; those without any box may be absent.
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

/// The quotient, unless there is nothing to divide by.
fn ratio(of: f64, by: f64) -> Option<f64> {
    (by > 0.0).then(|| of / by)
}
