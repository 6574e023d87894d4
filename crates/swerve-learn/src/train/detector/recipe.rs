//! Recipe of a detector (TOML): training data and parameters.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use swerve_text::{Document, Problem};
use swerve_vision::acf::Rung;

use crate::train::images::{Camera, ImageSet, Purpose, check, error_at, read};

/// Recipe of a detector.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::train) struct Recipe {
    /// Seed of all random draws in training.
    pub(super) seed: u64,
    /// Camera of rendered sets, and of the rungs that use the ground.
    pub(super) camera: Option<Camera>,
    /// Image sets, each with its purpose.
    pub(super) set: Vec<ImageSet>,
    pub(super) window: Vec<Window>,
    pub(super) learning: Learning,
    pub(super) rung: Vec<Ladder>,
    #[serde(skip)]
    path: PathBuf,
}

/// Object window that one set of trees or one template detects.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Window {
    pub(super) class: Class,
    /// Width and height of the object in pixels.
    pub(super) object_px: [f64; 2],
    /// Columns and lines of cells around it.
    pub(super) cells: [usize; 2],
    /// Range of width over height of the training objects.
    pub(super) aspects: [f64; 2],
    /// Minimum and maximum height of an object, metres.
    pub(super) heights_m: [f64; 2],
    /// Maximum occlusion of training objects, by KITTI's levels: 0 visible, 1 partly occluded, 2 largely.
    #[serde(default)]
    pub(super) occluded_max: u32,
}

/// Class of objects.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Class {
    Pedestrian,
    Car,
    Truck,
    Cyclist,
}

impl Class {
    pub(super) const ALL: [Self; 4] = [Self::Pedestrian, Self::Car, Self::Truck, Self::Cyclist];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Pedestrian => "pedestrian",
            Self::Car => "car",
            Self::Truck => "truck",
            Self::Cyclist => "cyclist",
        }
    }

    /// KITTI's type of the class.
    pub(super) fn kind(self) -> &'static str {
        match self {
            Self::Pedestrian => "Pedestrian",
            Self::Car => "Car",
            Self::Truck => "Truck",
            Self::Cyclist => "Cyclist",
        }
    }

    /// True if a type (KITTI's, or `Bus`) is of this class; `None` if it is similar enough to be ignored.
    pub(super) fn is(self, kind: &str) -> Option<bool> {
        let (own, near): (&[&str], &[&str]) = match self {
            Self::Pedestrian => (&["Pedestrian"], &["Cyclist", "Person_sitting", "Misc"]),
            Self::Car => (&["Car", "Van"], &["Truck", "Bus"]),
            Self::Truck => (&["Truck"], &["Van", "Bus"]),
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

/// Parameters of training.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Learning {
    /// Edge of a cell, pixels.
    pub(super) shrink: usize,
    /// Scoring method: trees or templates.
    pub(super) method: Method,
    /// Numbers of negative windows: added by one image in a round, and kept in total.
    pub(super) negatives: [usize; 2],
    /// Maximum distance of objects that are learnt and counted, metres; labels without a distance are within it.
    #[serde(default = "unlimited")]
    pub(super) within_m: f64,
    /// Minimum height of objects that are learnt and counted, pixels.
    #[serde(default)]
    pub(super) height_min_px: f64,
    /// Intersection over union above which only the box of the highest score in a class is kept.
    pub(super) overlap: f64,
}

/// Scoring method of windows.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Method {
    /// Boosted trees over channels.
    Trees(Growing),
    /// Linear templates over histograms of gradients.
    Svm(Svm),
}

/// Parameters of tree growth.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Growing {
    /// Levels of nodes.
    pub(super) depth: usize,
    /// Maximum number of trees in each round; each round but the first adds the false positives of the previous one.
    pub(super) rounds: Vec<usize>,
    /// Each tree is offered one in this many features.
    pub(super) one_of: usize,
}

/// Parameters of a support vector machine.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Svm {
    /// Cost of a window on the wrong side.
    pub(super) cost: f64,
    /// Number of rounds; each but the first adds the false positives of the previous one.
    pub(super) rounds: usize,
}

impl Learning {
    /// Number of rounds of sampling and training.
    pub(super) fn rounds(&self) -> usize {
        match &self.method {
            Method::Trees(growing) => growing.rounds.len(),
            Method::Svm(svm) => svm.rounds,
        }
    }

    fn check(&self, ensure: &mut dyn FnMut(bool, String, &str)) {
        let learning = self;
        let within = learning.within_m > 0.0 && learning.within_m <= 1000.0;
        let within = within || learning.within_m == f64::INFINITY;
        ensure(within, "learning.within_m".into(), "expected more than 0, at most 1000");
        let low = (0.0..=4096.0).contains(&learning.height_min_px);
        ensure(low, "learning.height_min_px".into(), "expected 0 to 4096 pixels");
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
    }
}

/// Operating point of the detector, a rung of the ladder.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Ladder {
    name: String,
    first_octave: i32,
    per_octave: usize,
    stride: usize,
    /// Maximum number of trees evaluated; default: all.
    #[serde(default = "all")]
    trees: usize,
    reject: f32,
    /// One in this many images is searched in full; default: each.
    #[serde(default = "one")]
    whole_every: u32,
    tolerance_deg: Option<f64>,
}

fn unlimited() -> f64 {
    f64::INFINITY
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
        let (recipe, text) = read(path, Self::problems)?;
        Ok((Self { path: path.to_owned(), ..recipe }, text))
    }

    /// Error at a key of this recipe.
    pub(super) fn error_at(&self, key: &str, error: &anyhow::Error) -> anyhow::Error {
        error_at(&self.path, key, error)
    }

    fn problems(&self, document: &Document) -> Vec<Problem> {
        let mut problems = Vec::new();
        let mut ensure = |holds: bool, key: String, what: &str| {
            if !holds {
                problems.push(document.problem(&key, what));
            }
        };
        check(
            self.camera.as_ref(),
            &self.set,
            &[Purpose::Training, Purpose::Calibration, Purpose::Test],
            &mut ensure,
        );
        ensure(!self.window.is_empty(), "window".into(), "expected at least one");
        self.check_windows(&mut ensure);
        self.learning.check(&mut ensure);
        self.check_rungs(&mut ensure);
        problems
    }

    fn check_windows(&self, ensure: &mut dyn FnMut(bool, String, &str)) {
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
    }

    fn check_rungs(&self, ensure: &mut dyn FnMut(bool, String, &str)) {
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
            let seen = rung.tolerance_deg.is_none() || self.camera.is_some();
            let expected = "expected the table `[camera]`: the rung uses the ground";
            ensure(seen, format!("rung[{k}].tolerance_deg"), expected);
        }
    }
}
