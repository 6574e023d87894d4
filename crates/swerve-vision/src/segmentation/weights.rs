//! What a forest has learnt, as a file.

use serde::{Deserialize, Serialize};

use super::{CLASSES, FEATURES, TREES};
use crate::weights_file::{WeightsError, WeightsFile, ensure};

const FILE: WeightsFile = WeightsFile { of: "segmentation", magic: "SWERVSEG", version: 1 };

/// All that a segmentation has learnt.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Weights {
    /// Where it comes from, in words.
    pub source: String,
    /// Focal length of the images that it was learnt from; others are resized.
    pub focal_px: f64,
    /// What pixels are told apart as; the last is all else.
    pub classes: Vec<Class>,
    /// The forest.
    pub trees: Vec<Tree>,
}

/// What pixels are labelled as.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Class {
    /// What it goes by.
    pub name: String,
    /// In masks: an id of Cityscapes.
    pub id: u8,
}

/// A binary tree, level by level from the root: where a feature is below the threshold, it goes on at the first of the
/// two nodes of its own.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Tree {
    /// Of each node one more than its feature; 0 for a leaf.
    pub features: Vec<u16>,
    /// Of each node that is no leaf.
    pub thresholds: Vec<u8>,
    /// Of each leaf the share of each class, in 1/255.
    pub leaves: Vec<u8>,
}

impl Tree {
    fn check(&self, classes: usize) -> Result<(), &'static str> {
        let nodes = self.features.len();
        let splits = self.features.iter().filter(|feature| **feature > 0).count();
        ensure((1..=1 << 16).contains(&nodes) && nodes == 2 * splits + 1, "whole trees expected")?;
        let leaves = nodes - splits;
        ensure(
            self.thresholds.len() == splits && self.leaves.len() == leaves * classes,
            "whole trees expected",
        )?;
        let known = |feature: &u16| usize::from(*feature) <= FEATURES;
        ensure(self.features.iter().all(known), "known features expected")?;
        // Children come after their parents, so that every walk ends.
        let mut above = 0;
        let is_above = |(k, feature): (usize, &u16)| {
            let first = 2 * above + 1;
            above += usize::from(*feature > 0);
            *feature == 0 || first > k
        };
        ensure(self.features.iter().enumerate().all(is_above), "trees from the root expected")
    }
}

impl Weights {
    /// Reads a file.
    ///
    /// # Errors
    /// Where it is none, or not whole.
    pub fn read(bytes: &[u8]) -> Result<Self, WeightsError> {
        let weights: Self = FILE.read(bytes)?;
        weights.check().map_err(WeightsError::Content)?;
        Ok(weights)
    }

    /// The bytes of a file.
    ///
    /// # Panics
    /// Never: what is stored is plain numbers and text.
    pub fn write(&self) -> Vec<u8> {
        FILE.write(self)
    }

    fn check(&self) -> Result<(), &'static str> {
        ensure(
            self.focal_px.is_finite() && self.focal_px >= 1.0,
            "a focal length of at least 1 px expected",
        )?;
        ensure((1..=CLASSES).contains(&self.classes.len()), "1 to 8 classes expected")?;
        ensure((1..=TREES).contains(&self.trees.len()), "1 to 16 trees expected")?;
        self.trees.iter().try_for_each(|tree| tree.check(self.classes.len()))
    }
}
