//! Detector weights and their file format.
//!
//! Trees trained here store thresholds in one byte and leaves in two; imported models keep their floats.

use serde::{Deserialize, Serialize};

use super::decorrelate::SIDE;
use super::suppress::Overlap;
use super::{Template, Trees, blocks};
use crate::channels::{CHANNELS, ORIENTATIONS};
use crate::weights_file::{WeightsFile, ensure};

pub use crate::weights_file::WeightsError;

const FILE: WeightsFile = WeightsFile { of: "detector", magic: "SWERVDET", version: 2 };

/// Trained models of a detector and their operating points.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Weights {
    /// Origin of the weights, free text.
    pub source: String,
    /// Side of a cell, pixels.
    pub shrink: usize,
    /// Exponents of the power law by which colour, magnitude and orientations change with scale, negative.
    pub decay: [f32; 3],
    /// Filters of each channel, empty for ACF: filter by filter, channel by channel, five rows of five coefficients.
    pub filters: Vec<f32>,
    /// Names of the object classes.
    pub classes: Vec<String>,
    /// Models, one or more for each class.
    pub models: Vec<Model>,
    /// Operating points, from fastest to most accurate.
    pub rungs: Vec<Rung>,
    /// Overlap with a better box above which a box is suppressed.
    pub overlap: (f64, Overlap),
}

/// Detection window and its scorer.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(from = "Stored", into = "Stored")]
pub struct Model {
    /// Index into the classes.
    pub class: usize,
    /// Width and height of the window in cells; cells of the halved planes if there are filters.
    pub cells: [usize; 2],
    /// Width and height of the object at the centre of the window, pixels.
    pub object_px: [f64; 2],
    /// Smallest and largest object height, metres; used with a known ground plane.
    pub heights_m: [f64; 2],
    /// Scorer of the window.
    pub scorer: Scorer,
}

/// Scoring function of a window.
#[derive(Clone, PartialEq, Debug)]
pub enum Scorer {
    /// Boosted trees over channels.
    Trees(Trees),
    /// Linear template over blocks of histograms of oriented gradients.
    Template(Template),
}

/// Features of a window.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Features {
    /// Ten channels (ACF).
    Channels,
    /// Filtered and halved channels (LDCF).
    Decorrelated,
    /// Block-normalised histograms of oriented gradients (HOG).
    Blocks,
}

/// Operating point of a detector.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Rung {
    /// Name of the operating point.
    pub name: String,
    /// First octave of the pyramid: 1 for the image at twice its size, 0 at its size, -1 at half its size.
    pub first_octave: i32,
    /// Pyramid levels per octave.
    pub per_octave: usize,
    /// Cells between neighbouring windows, across and down.
    pub stride: usize,
    /// Largest number of trees evaluated per model.
    pub trees: usize,
    /// Windows whose score falls to this value or below are rejected.
    pub reject: f32,
    /// One of this many images is searched completely, the others only around tracks; 1 searches every image
    /// completely.
    pub whole_every: u32,
    /// Uncertainty of the horizon, radians, if objects are expected on a known ground plane; `None` searches
    /// everywhere.
    pub tolerance_rad: Option<f64>,
    /// Calibration of each class; empty to report raw scores.
    pub calibrations: Vec<Calibration>,
}

/// Probability of a score: the logistic function of `slope * score + offset` (Platt 1999).
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Calibration {
    /// Slope of the logistic function.
    pub slope: f64,
    /// Offset of the logistic function.
    pub offset: f64,
}

impl Calibration {
    /// Probability that a window of this score is correct, 0 to 1.
    pub fn probability(&self, score: f64) -> f64 {
        1.0 / (1.0 + swerve_geom::math::exp(-(self.slope * score + self.offset)))
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

    /// Number of feature planes.
    pub fn planes(&self) -> usize {
        match self.features() {
            Features::Channels => CHANNELS,
            Features::Decorrelated => self.filters.len() / (SIDE * SIDE),
            Features::Blocks => blocks::PLANES,
        }
    }

    /// Quantisation step of a plane's features stored as bytes.
    pub fn feature_step(&self, plane: usize) -> f32 {
        match self.features() {
            Features::Channels | Features::Decorrelated => feature_step(plane % CHANNELS),
            Features::Blocks => blocks::STEP,
        }
    }

    /// Index of the plane that corresponds to this one in the mirrored image; gradient directions are mirrored.
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
            // Left and right blocks are swapped.
            Features::Blocks => ORIENTATIONS + ((plane - ORIENTATIONS) ^ 1),
        }
    }

    /// Features used by all of its models.
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

/// Unit of a threshold on a channel: a byte covers colours up to 1 and gradients up to 2.
pub const fn feature_step(channel: usize) -> f32 {
    if channel < 3 { 1.0 / 256.0 } else { 1.0 / 128.0 }
}

/// Unit of a leaf value.
pub const fn leaf_step() -> f32 {
    1.0 / 4096.0
}

/// Stored form of a [`Model`].
#[derive(Serialize, Deserialize)]
struct Stored {
    class: usize,
    cells: [usize; 2],
    object_px: [f64; 2],
    heights_m: [f64; 2],
    scorer: Form,
}

#[derive(Serialize, Deserialize)]
enum Form {
    Units { depth: usize, features: Vec<u16>, thresholds: Vec<u8>, leaves: Vec<i16> },
    Floats(Trees),
    Template(Template),
}

/// Unit of a feature's threshold.
fn step(cells: [usize; 2], feature: u16) -> f32 {
    feature_step(usize::from(feature) / (cells[0] * cells[1]).max(1) % CHANNELS)
}

/// Number of units, or `None` if it is not an integer in range.
fn units<T: TryFrom<i32>>(number: f32, unit: f32) -> Option<T> {
    let units = number / unit;
    let whole = units == units.round() && units.abs() < 65536.0;
    if whole { T::try_from(units as i32).ok() } else { None }
}

impl From<Model> for Stored {
    fn from(model: Model) -> Self {
        let Model { class, cells, object_px, heights_m, scorer } = model;
        let scorer = match scorer {
            Scorer::Trees(trees) => of_trees(cells, trees),
            Scorer::Template(template) => Form::Template(template),
        };
        Self { class, cells, object_px, heights_m, scorer }
    }
}

/// Stored form in integer units if all values allow it, else in floats.
fn of_trees(cells: [usize; 2], trees: Trees) -> Form {
    let nodes = trees.features.iter().zip(&trees.thresholds);
    let thresholds = nodes.map(|(f, threshold)| units(*threshold, step(cells, *f))).collect::<Option<_>>();
    let leaves = trees.leaves.iter().map(|leaf| units(*leaf, leaf_step())).collect::<Option<_>>();
    match (thresholds, leaves) {
        (Some(thresholds), Some(leaves)) => {
            Form::Units { depth: trees.depth, features: trees.features, thresholds, leaves }
        }
        _ => Form::Floats(trees),
    }
}

impl From<Stored> for Model {
    fn from(stored: Stored) -> Self {
        let Stored { class, cells, object_px, heights_m, scorer } = stored;
        let scorer = match scorer {
            Form::Template(template) => Scorer::Template(template),
            Form::Floats(trees) => Scorer::Trees(trees),
            Form::Units { depth, features, thresholds, leaves } => {
                let nodes = features.iter().zip(thresholds);
                let thresholds = nodes.map(|(f, units)| f32::from(units) * step(cells, *f)).collect();
                let leaves = leaves.into_iter().map(|units| f32::from(units) * leaf_step()).collect();
                Scorer::Trees(Trees { depth, features, thresholds, leaves })
            }
        };
        Self { class, cells, object_px, heights_m, scorer }
    }
}
