//! Detection by sliding windows: a window of cells slides over every level of a pyramid of channels, and boosted trees
//! add to its score until that is too low to go on (a *soft cascade*), or a linear template is summed up over it (HOG).
//!
//! Dollár, Appel, Belongie, Perona: "Fast feature pyramids for object detection", PAMI 2014 (ACF); Nam, Dollár, Han:
//! "Local decorrelation for improved pedestrian detection", NIPS 2014 (LDCF: the same over channels that are filtered
//! and halved); module `blocks` for HOG. Boxes are left, top, width and height in pixels of the image.

mod blocks;
mod cascade;
mod decorrelate;
mod detector;
mod ground;
mod stored;
mod suppress;
mod template;
mod weights;
mod windows;

pub use detector::{Candidate, Scanner, SizeError};
pub use ground::Ground;
pub use stored::{feature_step, leaf_step};
pub use suppress::{Overlap, iou, share, suppress, vote};
pub use template::Template;
pub use weights::{Calibration, Model, Rung, Scorer, Weights, WeightsError};

use serde::{Deserialize, Serialize};

/// Something found in an image.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Detection {
    /// Of [`Weights::classes`].
    pub class: usize,
    /// Left, top, width, height in pixels.
    pub bbox: [f64; 4],
    /// How likely it is one, 0 to 1, where the weights say how scores map to that; else the sum of the trees or the template.
    pub score: f64,
}

/// Full binary trees of one depth, whose leaves sum up to a score.
///
/// A tree has `2^depth - 1` nodes, children of node `k` are `2 k + 1` (feature below its threshold) and `2 k + 2`;
/// `2^depth` leaves follow from left to right.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Trees {
    /// Levels of nodes.
    pub depth: usize,
    /// Feature of each node: number within the window, plane after plane, each row by row.
    pub features: Vec<u16>,
    /// Threshold of each node.
    pub thresholds: Vec<f32>,
    /// What each leaf adds to the score.
    pub leaves: Vec<f32>,
}

impl Trees {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.leaves.len() >> self.depth
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.leaves.is_empty()
    }
}

#[cfg(test)]
mod tests;
