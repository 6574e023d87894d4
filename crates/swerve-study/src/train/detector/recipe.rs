//! What a detector is to be trained on, and how: a recipe in TOML.

use std::path::Path;

use serde::Deserialize;
use swerve_drive::problems_error;
use swerve_scene::WeatherPreset;
use swerve_text::{Document, Problem};
use swerve_vision::acf::Rung;

/// The whole recipe.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Recipe {
    /// Of all that is drawn in training.
    pub(super) seed: u64,
    pub(super) camera: Camera,
    /// Images, by what they are for.
    pub(super) set: Vec<ImageSet>,
    pub(super) window: Vec<Window>,
    pub(super) learning: Learning,
    pub(super) rung: Vec<Ladder>,
}

/// The camera that images are taken with, level and straight ahead.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Camera {
    pub(super) width_px: u32,
    pub(super) height_px: u32,
    pub(super) fov_deg: f64,
    /// Above the ground.
    pub(super) height_m: f64,
    pub(super) period_ms: f64,
}

impl Camera {
    /// Focal length.
    pub(super) fn focal_px(&self) -> f64 {
        0.5 * f64::from(self.width_px) / swerve_geom::math::tan(0.5 * self.fov_deg.to_radians())
    }
}

/// What images are for.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Purpose {
    Training,
    /// Scores are mapped to probabilities by these.
    Calibration,
    Test,
}

/// Images of some streets.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ImageSet {
    pub(super) name: String,
    pub(super) purpose: Purpose,
    /// The first, and the one behind the last.
    pub(super) streets: [u32; 2],
    /// Of the drives.
    pub(super) seed: u32,
    pub(super) weather: WeatherPreset,
}

/// What is found by one set of trees.
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

/// How trees are grown.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Learning {
    /// Pixels along a cell.
    pub(super) shrink: usize,
    /// Levels of nodes.
    pub(super) depth: usize,
    /// Trees at most, of each round; each but the first adds what the round before took for objects.
    pub(super) rounds: Vec<usize>,
    /// Each tree is offered one of so many features.
    pub(super) one_of: usize,
    /// Windows without an object that one image adds in a round, and that are kept in all.
    pub(super) negatives: [usize; 2],
    /// Farther objects are neither learnt nor counted.
    pub(super) within_m: f64,
}

/// A way to use the detector.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Ladder {
    name: String,
    first_octave: i32,
    per_octave: usize,
    stride: usize,
    trees: usize,
    reject: f32,
    tolerance_deg: Option<f64>,
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
            tolerance_rad: self.tolerance_deg.map(f64::to_radians),
            calibrations: Vec::new(),
        }
    }
}

impl Recipe {
    /// Reads and checks a recipe.
    pub(super) fn read(path: &Path) -> anyhow::Result<(Self, String)> {
        let text =
            swerve_text::read_text(path).map_err(|e| problems_error(&[swerve_text::unreadable(path, &e)]))?;
        let document = Document::parse(&path.display().to_string(), &text)
            .map_err(|problem| problems_error(&[problem]))?;
        let recipe: Self = document.to().map_err(|problems| problems_error(&problems))?;
        let problems = recipe.problems(&document);
        if problems.is_empty() { Ok((recipe, text)) } else { Err(problems_error(&problems)) }
    }

    fn problems(&self, document: &Document) -> Vec<Problem> {
        let mut problems = Vec::new();
        let mut ensure = |holds: bool, key: String, what: &str| {
            if !holds {
                problems.push(document.problem(&key, what));
            }
        };
        let camera = &self.camera;
        ensure((64..=4096).contains(&camera.width_px), "camera.width_px".into(), "expected 64 to 4096");
        ensure((64..=4096).contains(&camera.height_px), "camera.height_px".into(), "expected 64 to 4096");
        ensure(camera.fov_deg > 1.0 && camera.fov_deg < 170.0, "camera.fov_deg".into(), "expected 1 to 170");
        ensure(camera.height_m > 0.0, "camera.height_m".into(), "expected more than 0");
        ensure(camera.period_ms > 0.0, "camera.period_ms".into(), "expected more than 0");
        for (k, set) in self.set.iter().enumerate() {
            ensure(
                set.streets[0] < set.streets[1],
                format!("set[{k}].streets"),
                "expected the first, and one more than the last",
            );
            let others = self
                .set
                .iter()
                .filter(|other| (other.purpose == Purpose::Training) != (set.purpose == Purpose::Training));
            let shared = others
                .into_iter()
                .any(|other| set.streets[0] < other.streets[1] && other.streets[0] < set.streets[1]);
            ensure(
                !shared,
                format!("set[{k}].streets"),
                "expected streets that are not both trained on and held out",
            );
        }
        for purpose in [Purpose::Training, Purpose::Calibration, Purpose::Test] {
            let has = self.set.iter().any(|set| set.purpose == purpose);
            ensure(has, "set".into(), "expected sets for training, calibration and test");
        }
        ensure(!self.window.is_empty(), "window".into(), "expected at least one");
        for (k, window) in self.window.iter().enumerate() {
            let room = |side: usize| {
                window.cells[side] as f64 * self.learning.shrink as f64 >= window.object_px[side]
            };
            let sized = window.object_px.iter().all(|px| *px >= 4.0)
                && window.cells.iter().all(|n| (1..=64).contains(n));
            ensure(
                sized && room(0) && room(1),
                format!("window[{k}].cells"),
                "expected 1 to 64 cells, room for the object",
            );
            ensure(
                window.heights_m[0] > 0.0 && window.heights_m[0] < window.heights_m[1],
                format!("window[{k}].heights_m"),
                "expected from and to, above 0",
            );
        }
        let learning = &self.learning;
        ensure((1..=8).contains(&learning.shrink), "learning.shrink".into(), "expected 1 to 8");
        ensure((1..=6).contains(&learning.depth), "learning.depth".into(), "expected 1 to 6");
        ensure(!learning.rounds.is_empty(), "learning.rounds".into(), "expected at least one");
        ensure(learning.negatives[0] > 0, "learning.negatives".into(), "expected more than 0");
        ensure(!self.rung.is_empty(), "rung".into(), "expected at least one");
        for (k, rung) in self.rung.iter().enumerate() {
            let known = (-1..=1).contains(&rung.first_octave) && (1..=32).contains(&rung.per_octave);
            ensure(
                known && rung.stride > 0 && rung.trees > 0,
                format!("rung[{k}]"),
                "expected a first octave of -1 to 1, 1 to 32 levels an octave, a stride and trees",
            );
        }
        problems
    }
}
