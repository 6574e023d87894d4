//! Recipe of a segmentation (TOML): training data and parameters.

use std::path::Path;

use serde::Deserialize;
use swerve_measure::labels::{PixelClass, cityscapes_id};
use swerve_scene::SemanticClass;
use swerve_text::{Document, Problem};
use swerve_vision::segmentation::{CLASSES, ForestParams, TREES};

use crate::train::images::{Camera, ImageSet, Purpose, check, read};

/// Recipe of a segmentation.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::train) struct Recipe {
    /// Seed of all random draws in training.
    pub(super) seed: u64,
    pub(super) camera: Camera,
    /// Image sets, each with its purpose.
    pub(super) set: Vec<ImageSet>,
    /// Classes of pixels; all other pixels form one more class.
    pub(super) class: Vec<PixelClass>,
    pub(super) learning: Learning,
}

/// Parameters of forest growth.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Learning {
    /// Maximum number of cells per class and image.
    pub(super) cells: usize,
    /// Exponent of a class's share of all cells in its weight: 1 by frequency, 0 equal weights.
    pub(super) power: f64,
    /// Maximum unknown tilt of the camera, either way, degrees; drawn for each image.
    pub(super) tilt_deg: f64,
    pub(super) trees: usize,
    /// Levels of nodes.
    depth: usize,
    /// Minimum share of the total weight for a node to be split.
    least: f64,
    /// Each node is offered one in this many features.
    one_of: usize,
}

impl Learning {
    pub(super) fn forest(&self, seed: u64) -> ForestParams {
        ForestParams { depth: self.depth, least: self.least, one_of: self.one_of, seed }
    }
}

impl Recipe {
    /// Reads and checks a recipe.
    pub(super) fn read(path: &Path) -> anyhow::Result<(Self, String)> {
        read(path, Self::problems)
    }

    /// For each Cityscapes id, the index of its class; the last index for all others.
    pub(super) fn class_of(&self) -> [u8; 256] {
        let mut class_of = [self.class.len() as u8; 256];
        for (k, class) in self.class.iter().enumerate() {
            class.ids().for_each(|id| class_of[usize::from(id)] = k as u8);
        }
        class_of
    }

    fn problems(&self, document: &Document) -> Vec<Problem> {
        let mut problems = Vec::new();
        let mut ensure = |holds: bool, key: String, what: &str| {
            if !holds {
                problems.push(document.problem(&key, what));
            }
        };
        check(Some(&self.camera), &self.set, &[Purpose::Training, Purpose::Test], &mut ensure);
        for (k, _) in self.set.iter().enumerate().filter(|(_, set)| set.pictures.is_some()) {
            let expected = "expected `streets`, `seed` and `weather`: only detectors learn from pictures";
            ensure(false, format!("set[{k}].pictures"), expected);
        }
        let count = self.class.len();
        ensure((1..CLASSES).contains(&count), "class".into(), &format!("expected 1 to {}", CLASSES - 1));
        for (k, class) in self.class.iter().enumerate() {
            ensure(!class.labels.is_empty(), format!("class[{k}].labels"), "expected at least one");
            for label in class.labels.iter().filter(|label| cityscapes_id(label).is_none()) {
                let near = swerve_text::did_you_mean(label, SemanticClass::ALL.iter().map(|c| c.name()));
                ensure(
                    false,
                    format!("class[{k}].labels"),
                    &format!("no class `{label}` of Cityscapes{near}"),
                );
            }
        }
        let learning = &self.learning;
        ensure((1..=10_000).contains(&learning.cells), "learning.cells".into(), "expected 1 to 10000");
        ensure((0.0..=1.0).contains(&learning.power), "learning.power".into(), "expected 0 to 1");
        ensure((0.0..=10.0).contains(&learning.tilt_deg), "learning.tilt_deg".into(), "expected 0 to 10");
        ensure(
            (1..=TREES).contains(&learning.trees),
            "learning.trees".into(),
            &format!("expected 1 to {TREES}"),
        );
        ensure((1..=24).contains(&learning.depth), "learning.depth".into(), "expected 1 to 24");
        ensure((0.0..=1.0).contains(&learning.least), "learning.least".into(), "expected 0 to 1");
        ensure((1..=64).contains(&learning.one_of), "learning.one_of".into(), "expected 1 to 64");
        problems
    }
}
