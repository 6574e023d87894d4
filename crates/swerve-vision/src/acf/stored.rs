//! Stored form of models: thresholds in one byte and leaves in two, if all are integer multiples of their units.

use serde::{Deserialize, Serialize};

use super::{Model, Scorer, Template, Trees};
use crate::channels::CHANNELS;

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
pub(super) struct Stored {
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
