//! Weights of a segmentation forest and their file format.

use serde::{Deserialize, Serialize};

use super::features::FEATURES;
use crate::weights_file::{WeightsError, WeightsFile, ensure};

/// Largest number of classes.
pub const CLASSES: usize = 8;

/// Largest number of trees.
pub const TREES: usize = 16;

const FILE: WeightsFile = WeightsFile { of: "segmentation", magic: "SWERVSEG", version: 1 };

/// Trained forest of a segmentation.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Weights {
    /// Origin of the weights, free text.
    pub source: String,
    /// Focal length of the training images, pixels; other images are resized.
    pub focal_px: f64,
    /// Classes of pixels; the last one is everything else.
    pub classes: Vec<Class>,
    /// Trees of the forest.
    pub trees: Vec<Tree>,
}

/// Class of pixels.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Class {
    /// Name of the class.
    pub name: String,
    /// Id in masks, as in Cityscapes.
    pub id: u8,
}

/// Binary tree, level by level from the root. If a feature is below the threshold, the walk continues at the first of
/// the node's two children.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Tree {
    /// Feature index plus one of each node; 0 for a leaf.
    pub features: Vec<u16>,
    /// Threshold of each inner node.
    pub thresholds: Vec<u8>,
    /// Share of each class at each leaf, in 1/255.
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
        // Children must follow their parents, so that every walk terminates.
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
    /// Parses a weights file.
    ///
    /// # Errors
    /// If the file is not a weights file, is damaged, or has invalid content.
    pub fn read(bytes: &[u8]) -> Result<Self, WeightsError> {
        let weights: Self = FILE.read(bytes)?;
        weights.check().map_err(WeightsError::Content)?;
        Ok(weights)
    }

    /// Serialises the weights to a file's bytes.
    ///
    /// # Panics
    /// Never: the weights are plain numbers and text.
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
