//! Sliding-window detection: a window of cells slides over every level of a channel pyramid and is scored either by
//! boosted trees, which stop early when the score falls too low (a *soft cascade*), or by a linear template (HOG).
//!
//! Dollár, Appel, Belongie, Perona: "Fast feature pyramids for object detection", PAMI 2014 (ACF); Nam, Dollár, Han:
//! "Local decorrelation for improved pedestrian detection", NIPS 2014 (LDCF: ACF over filtered and halved channels);
//! module `blocks` for HOG. Boxes are left, top, width and height in image pixels.

mod blocks;
mod cascade;
mod decorrelate;
mod detector;
mod ground;
mod suppress;
mod template;
mod weights;
mod windows;

pub use detector::{Candidate, Scanner, SizeError};
pub use ground::Ground;
pub use suppress::{Overlap, iou, share, suppress, vote};
pub use template::Template;
pub use weights::{Calibration, Model, Rung, Scorer, Weights, WeightsError, feature_step, leaf_step};

use serde::{Deserialize, Serialize};

/// Object detected in an image.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Detection {
    /// Index into [`Weights::classes`].
    pub class: usize,
    /// Left, top, width, height in pixels.
    pub bbox: [f64; 4],
    /// Probability, 0 to 1, if the weights hold a calibration; else the raw sum of the trees or the template.
    pub score: f64,
}

/// Full binary trees of equal depth; the leaves reached are summed to a score.
///
/// A tree has `2^depth - 1` nodes; the children of node `k` are `2 k + 1` (feature below its threshold) and `2 k + 2`.
/// Its `2^depth` leaves are stored from left to right.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Trees {
    /// Levels of nodes per tree.
    pub depth: usize,
    /// Feature of each node: index within the window, plane by plane, each row by row.
    pub features: Vec<u16>,
    /// Threshold of each node.
    pub thresholds: Vec<f32>,
    /// Score contribution of each leaf.
    pub leaves: Vec<f32>,
}

impl Trees {
    /// Number of trees.
    pub fn len(&self) -> usize {
        self.leaves.len() >> self.depth
    }

    /// Returns true if there are no trees.
    pub fn is_empty(&self) -> bool {
        self.leaves.is_empty()
    }
}

#[cfg(test)]
mod tests;
