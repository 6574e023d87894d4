//! What a detector has learnt, as a file.
//!
//! Trees that were trained here keep thresholds in a byte and leaves in two; other makers' keep them as they are.

use serde::{Deserialize, Serialize};

use super::decorrelate::SIDE;
use super::stored::{Stored, feature_step};
use super::suppress::Overlap;
use super::{Template, Trees, blocks};
use crate::channels::{CHANNELS, ORIENTATIONS};
use crate::weights_file::{WeightsFile, ensure};

pub use crate::weights_file::WeightsError;

const FILE: WeightsFile = WeightsFile { of: "detector", magic: "SWERVDET", version: 2 };

/// All that a detector has learnt, and how it is to be used.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Weights {
    /// Where it comes from, in words.
    pub source: String,
    /// Pixels along a cell.
    pub shrink: usize,
    /// Powers of the scale that colour, magnitude and orientations fall with, negative.
    pub decay: [f32; 3],
    /// Filters of each channel, none for ACF: filter after filter, channel after channel, five rows of five.
    pub filters: Vec<f32>,
    /// Names of what is found.
    pub classes: Vec<String>,
    /// One or more for each class.
    pub models: Vec<Model>,
    /// Ways to use it, from fast to good.
    pub rungs: Vec<Rung>,
    /// Boxes that share more than this with a better one are left out.
    pub overlap: (f64, Overlap),
}

/// A window and what gives it a score.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(from = "Stored", into = "Stored")]
pub struct Model {
    /// Of the classes.
    pub class: usize,
    /// Width and height of the window in cells, of halved planes where there are filters.
    pub cells: [usize; 2],
    /// Width and height of the object in the middle of the window, in pixels.
    pub object_px: [f64; 2],
    /// The smallest and the largest height that an object has, for ground that is known.
    pub heights_m: [f64; 2],
    /// What the score is the sum of.
    pub scorer: Scorer,
}

/// What gives a window its score.
#[derive(Clone, PartialEq, Debug)]
pub enum Scorer {
    /// Boosted trees, over channels.
    Trees(Trees),
    /// A linear template, over blocks of histograms of oriented gradients.
    Template(Template),
}

/// What windows are described by.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Features {
    /// The ten channels (ACF).
    Channels,
    /// These filtered and halved (LDCF).
    Decorrelated,
    /// Histograms of oriented gradients, normalised by blocks (HOG).
    Blocks,
}

/// A way to use a detector.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Rung {
    /// What it goes by.
    pub name: String,
    /// 1 to look at the image twice as large, 0 as it is, -1 half as large.
    pub first_octave: i32,
    /// Levels from one size to half of it.
    pub per_octave: usize,
    /// Cells from one window to the next, across and down.
    pub stride: usize,
    /// How many trees of each model are asked, at most.
    pub trees: usize,
    /// A window whose score falls to this or below is given up.
    pub reject: f32,
    /// Of so many images one is searched whole, the others around tracks alone; 1 to search each whole.
    pub whole_every: u32,
    /// How far the horizon may be off if the camera is known and objects stand on the ground; none to look anywhere.
    pub tolerance_rad: Option<f64>,
    /// Of each class; none to give scores as they are.
    pub calibrations: Vec<Calibration>,
}

/// Probability of a score: the logistic function of `slope * score + offset` (Platt 1999).
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Calibration {
    /// How fast it rises.
    pub slope: f64,
    /// Of a score of zero.
    pub offset: f64,
}

impl Calibration {
    /// How likely a window of this score is right, 0 to 1.
    pub fn probability(&self, score: f64) -> f64 {
        1.0 / (1.0 + swerve_geom::math::exp(-(self.slope * score + self.offset)))
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

    /// Planes that features are taken from.
    pub fn planes(&self) -> usize {
        match self.features() {
            Features::Channels => CHANNELS,
            Features::Decorrelated => self.filters.len() / (SIDE * SIDE),
            Features::Blocks => blocks::PLANES,
        }
    }

    /// One unit of a feature of a plane, where a byte holds it.
    pub fn feature_step(&self, plane: usize) -> f32 {
        match self.features() {
            Features::Channels | Features::Decorrelated => feature_step(plane % CHANNELS),
            Features::Blocks => blocks::STEP,
        }
    }

    /// Which plane of a picture is this one of its mirror image: gradients lean the other way.
    pub fn mirrored(&self, plane: usize) -> usize {
        let turned = |bin: usize| (ORIENTATIONS - bin) % ORIENTATIONS;
        let channel = |plane: usize| {
            let first = CHANNELS - ORIENTATIONS;
            if plane < first { plane } else { first + turned(plane - first) }
        };
        match self.features() {
            Features::Channels => channel(plane),
            Features::Decorrelated => plane / CHANNELS * CHANNELS + channel(plane % CHANNELS),
            Features::Blocks if plane < ORIENTATIONS => turned(plane),
            // Left and right blocks change places.
            Features::Blocks => ORIENTATIONS + ((plane - ORIENTATIONS) ^ 1),
        }
    }

    /// What all its models look at.
    pub(super) fn features(&self) -> Features {
        match self.models.first().map(|model| &model.scorer) {
            Some(Scorer::Template(_)) => Features::Blocks,
            _ if self.filters.is_empty() => Features::Channels,
            _ => Features::Decorrelated,
        }
    }

    fn check(&self) -> Result<(), &'static str> {
        let filters = CHANNELS * SIDE * SIDE;
        ensure((1..=16).contains(&self.shrink), "cells of 1 to 16 pixels expected")?;
        ensure(
            self.filters.len().is_multiple_of(filters) && finite(&self.filters),
            "filters of ten channels expected",
        )?;
        ensure(finite(&self.decay), "finite powers expected")?;
        ensure(!self.classes.is_empty() && !self.rungs.is_empty(), "a class and a rung expected")?;
        ensure(self.overlap.0 >= 0.0, "an overlap of at least 0 expected")?;
        for rung in &self.rungs {
            ensure((-1..=1).contains(&rung.first_octave), "a first octave of -1, 0 or 1 expected")?;
            ensure((1..=32).contains(&rung.per_octave), "1 to 32 levels an octave expected")?;
            ensure(rung.stride > 0 && rung.trees > 0, "a stride and trees of at least 1 expected")?;
            ensure(rung.whole_every > 0, "an image searched whole expected")?;
            let calibrated = rung.calibrations.len();
            ensure(
                calibrated == 0 || calibrated == self.classes.len(),
                "a calibration of each class expected",
            )?;
        }
        self.models.iter().try_for_each(|model| {
            let [columns, lines] = model.cells;
            ensure(
                (1..=256).contains(&columns) && (1..=256).contains(&lines),
                "windows of 1 to 256 cells expected",
            )?;
            let features = self.planes() * columns * lines;
            match (&model.scorer, self.features()) {
                (Scorer::Trees(trees), Features::Channels | Features::Decorrelated) => {
                    trees.check(features)?
                }
                (Scorer::Template(template), Features::Blocks) => {
                    let whole = template.weights.len() == features && template.offset.is_finite();
                    ensure(whole && finite(&template.weights), "finite weights of the window expected")?;
                }
                _ => return Err("trees or templates alone expected"),
            }
            ensure(model.class < self.classes.len(), "models of the classes expected")?;
            let sizes = [model.object_px, model.heights_m].concat();
            ensure(sizes.iter().all(|size| size.is_finite() && *size > 0.0), "objects of some size expected")
        })
    }
}

impl Trees {
    fn check(&self, features: usize) -> Result<(), &'static str> {
        ensure((1..=8).contains(&self.depth), "trees of 1 to 8 levels expected")?;
        let nodes = self.len() * ((1 << self.depth) - 1);
        let whole = self.leaves.len() == self.len() << self.depth;
        ensure(
            whole && nodes == self.features.len() && nodes == self.thresholds.len(),
            "full trees expected",
        )?;
        ensure(
            self.features.iter().all(|f| usize::from(*f) < features),
            "features within the window expected",
        )?;
        ensure(finite(&self.thresholds) && finite(&self.leaves), "finite thresholds and leaves expected")
    }
}

fn finite(numbers: &[f32]) -> bool {
    numbers.iter().all(|number| number.is_finite())
}
