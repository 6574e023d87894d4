//! What a detector is to be trained on, and how: a recipe in TOML.

use std::path::Path;

use serde::Deserialize;
use swerve_text::{Document, Problem};
use swerve_vision::acf::Rung;

use crate::train::images::{Camera, ImageSet, Purpose, check, read};

/// The whole recipe.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::train) struct Recipe {
    /// Of all that is drawn in training.
    pub(super) seed: u64,
    pub(super) camera: Camera,
    /// Images, by what they are for.
    pub(super) set: Vec<ImageSet>,
    pub(super) window: Vec<Window>,
    pub(super) learning: Learning,
    pub(super) rung: Vec<Ladder>,
}

/// What is found by one set of trees, or by one template.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Window {
    pub(super) class: Class,
    /// Width and height of the object in pixels.
    pub(super) object_px: [f64; 2],
    /// Columns and lines of cells around it.
    pub(super) cells: [usize; 2],
    /// Width over height of the objects that are learnt, from and to.
    pub(super) aspects: [f64; 2],
    /// The smallest and the largest height of an object.
    pub(super) heights_m: [f64; 2],
    /// The most hidden that is learnt, by KITTI's levels: 0 whole, 1 partly hidden, 2 largely.
    #[serde(default)]
    pub(super) occluded_max: u32,
}

/// A kind of objects.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Class {
    Pedestrian,
    Car,
    Truck,
    Cyclist,
}

impl Class {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Pedestrian => "pedestrian",
            Self::Car => "car",
            Self::Truck => "truck",
            Self::Cyclist => "cyclist",
        }
    }

    /// Whether a type of KITTI's is of this class; none if it is near enough to be left out.
    pub(super) fn is(self, kind: &str) -> Option<bool> {
        let (own, near): (&[&str], &[&str]) = match self {
            Self::Pedestrian => (&["Pedestrian"], &["Cyclist", "Person_sitting", "Misc"]),
            Self::Car => (&["Car", "Van"], &["Truck"]),
            Self::Truck => (&["Truck"], &["Van"]),
            Self::Cyclist => (&["Cyclist"], &["Pedestrian", "Misc"]),
        };
        if own.contains(&kind) {
            Some(true)
        } else if near.contains(&kind) || kind == "DontCare" {
            None
        } else {
            Some(false)
        }
    }
}

/// How it learns.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Learning {
    /// Pixels along a cell.
    pub(super) shrink: usize,
    /// Trees or templates.
    pub(super) method: Method,
    /// Windows without an object that one image adds in a round, and that are kept in all.
    pub(super) negatives: [usize; 2],
    /// Farther objects are neither learnt nor counted.
    pub(super) within_m: f64,
    /// Of boxes of a class that share more than this of their union, the surest stays.
    pub(super) overlap: f64,
}

/// What gives windows their scores.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Method {
    /// Boosted trees over channels.
    Trees(Growing),
    /// Linear templates over histograms of gradients.
    Svm(Svm),
}

/// How trees are grown.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Growing {
    /// Levels of nodes.
    pub(super) depth: usize,
    /// Trees at most, of each round; each but the first adds what the round before took for objects.
    pub(super) rounds: Vec<usize>,
    /// Each tree is offered one of so many features.
    pub(super) one_of: usize,
}

/// How a support vector machine is trained.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Svm {
    /// What a window on the wrong side costs.
    pub(super) cost: f64,
    /// Rounds; each but the first adds what the round before took for objects.
    pub(super) rounds: usize,
}

impl Learning {
    /// How often windows are looked for and learnt from.
    pub(super) fn rounds(&self) -> usize {
        match &self.method {
            Method::Trees(growing) => growing.rounds.len(),
            Method::Svm(svm) => svm.rounds,
        }
    }
}

/// A way to use the detector.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Ladder {
    name: String,
    first_octave: i32,
    per_octave: usize,
    stride: usize,
    /// Trees asked at most; all.
    #[serde(default = "all")]
    trees: usize,
    reject: f32,
    /// Of so many images one is searched whole; each.
    #[serde(default = "one")]
    whole_every: u32,
    tolerance_deg: Option<f64>,
}

fn all() -> usize {
    u32::MAX as usize
}

fn one() -> u32 {
    1
}

impl Ladder {
    pub(super) fn rung(&self) -> Rung {
        Rung {
            name: self.name.clone(),
            first_octave: self.first_octave,
            per_octave: self.per_octave,
            stride: self.stride,
            trees: self.trees,
            reject: self.reject,
            whole_every: self.whole_every,
            tolerance_rad: self.tolerance_deg.map(f64::to_radians),
            calibrations: Vec::new(),
        }
    }
}

impl Recipe {
    /// Reads and checks a recipe.
    pub(super) fn read(path: &Path) -> anyhow::Result<(Self, String)> {
        read(path, Self::problems)
    }

    fn problems(&self, document: &Document) -> Vec<Problem> {
        let mut problems = Vec::new();
        let mut ensure = |holds: bool, key: String, what: &str| {
            if !holds {
                problems.push(document.problem(&key, what));
            }
        };
        check(
            &self.camera,
            &self.set,
            &[Purpose::Training, Purpose::Calibration, Purpose::Test],
            &mut ensure,
        );
        ensure(!self.window.is_empty(), "window".into(), "expected at least one");
        for (k, window) in self.window.iter().enumerate() {
            let room = |side: usize| {
                window.cells[side] as f64 * self.learning.shrink as f64 >= window.object_px[side]
            };
            let sized = window.object_px.iter().all(|px| (4.0..=512.0).contains(px));
            ensure(sized, format!("window[{k}].object_px"), "expected 4 to 512 pixels");
            let celled = window.cells.iter().all(|n| (1..=64).contains(n));
            ensure(
                celled && (!sized || room(0) && room(1)),
                format!("window[{k}].cells"),
                "expected 1 to 64 cells, room for the object",
            );
            let rising = |[from, to]: [f64; 2]| from >= 0.0 && from < to && to.is_finite();
            ensure(
                rising(window.heights_m) && window.heights_m[0] > 0.0,
                format!("window[{k}].heights_m"),
                "expected from and to, above 0",
            );
            ensure(
                rising(window.aspects),
                format!("window[{k}].aspects"),
                "expected from and to, neither below 0",
            );
            ensure(window.occluded_max <= 2, format!("window[{k}].occluded_max"), "expected 0 to 2");
        }
        let learning = &self.learning;
        let within = learning.within_m > 0.0 && learning.within_m <= 1000.0;
        ensure(within, "learning.within_m".into(), "expected more than 0, at most 1000");
        ensure((1..=8).contains(&learning.shrink), "learning.shrink".into(), "expected 1 to 8");
        match &learning.method {
            Method::Trees(Growing { depth, one_of, .. }) => {
                ensure((1..=6).contains(depth), "learning.method.trees.depth".into(), "expected 1 to 6");
                ensure(*one_of > 0, "learning.method.trees.one_of".into(), "expected at least 1");
            }
            Method::Svm(Svm { cost, .. }) => {
                let is_positive = cost.is_finite() && *cost > 0.0;
                ensure(is_positive, "learning.method.svm.cost".into(), "expected more than 0");
            }
        }
        ensure(learning.rounds() > 0, "learning.method".into(), "expected at least one round");
        ensure(learning.negatives[0] > 0, "learning.negatives".into(), "expected more than 0");
        let is_share = learning.overlap > 0.0 && learning.overlap <= 1.0;
        ensure(is_share, "learning.overlap".into(), "expected more than 0, at most 1");
        ensure(!self.rung.is_empty(), "rung".into(), "expected at least one");
        for (k, rung) in self.rung.iter().enumerate() {
            let known = (-1..=1).contains(&rung.first_octave) && (1..=32).contains(&rung.per_octave);
            ensure(
                known && rung.stride > 0 && rung.trees > 0 && rung.whole_every > 0,
                format!("rung[{k}]"),
                "expected a first octave of -1 to 1, 1 to 32 levels an octave, a stride, trees, an image searched whole",
            );
            ensure(rung.reject.is_finite(), format!("rung[{k}].reject"), "expected a finite number");
            let tolerance = rung.tolerance_deg.is_none_or(|deg| (0.0..=45.0).contains(&deg));
            ensure(tolerance, format!("rung[{k}].tolerance_deg"), "expected 0 to 45");
        }
        problems
    }
}
