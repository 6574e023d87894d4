//! Models as they are stored: thresholds in a byte and leaves in two, where all are whole numbers of their units.

use serde::{Deserialize, Serialize};

use super::{Model, Scorer, Template, Trees};
use crate::channels::CHANNELS;

/// One unit of a threshold on a channel: a byte holds colour up to one, gradients up to two.
pub const fn feature_step(channel: usize) -> f32 {
    if channel < 3 { 1.0 / 256.0 } else { 1.0 / 128.0 }
}

/// One unit of a leaf.
pub const fn leaf_step() -> f32 {
    1.0 / 4096.0
}

/// A [`Model`].
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

/// The unit of a feature's threshold.
fn step(cells: [usize; 2], feature: u16) -> f32 {
    feature_step(usize::from(feature) / (cells[0] * cells[1]).max(1) % CHANNELS)
}

/// How many whole units a number is, if it is.
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

/// In whole units where all are.
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
