//! Content of a study file.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use schemars::JsonSchema;
use serde::Deserialize;
use swerve_drive::shipped::Kind;
use swerve_text::{Document, Problems, is_one_value, number};

use super::forms::{Files, Values, label_of, name_of};
use crate::tables::{Curve, Plot, Ranking, Timely, TimelyPrediction, no_axis};

/// Content of a study file.
#[derive(Clone, PartialEq, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StudyFile {
    /// Purpose of the study; the title of its picture.
    #[serde(default)]
    pub description: String,
    /// Run that the axes vary.
    pub base: Base,
    /// Axes of the study, the slowest first.
    pub axis: Vec<Axis>,
    /// Search for a latency budget instead of a plain grid.
    pub budget: Option<Budget>,
    /// Count drives that ended by timeout, safely stopped or not, as good in the picture, since there was no collision.
    #[serde(default)]
    pub timeout_is_good: bool,
    /// Count drives that left the road without a collision as good in the picture: the paper's criterion.
    #[serde(default)]
    pub off_road_is_good: bool,
    /// Quantity drawn over time for every combination, in `curve.svg`.
    pub curve: Option<Curve>,
    /// Mean of a metric over an axis, drawn in `plot.svg`.
    pub plot: Option<Plot>,
    /// Combinations that are not driven: those with one of the named steps on every named axis.
    #[serde(default)]
    pub leave_out: Vec<LeaveOut>,
    /// Ranking of settings.
    pub ranking: Option<Ranking>,
    /// Timely accuracy of perception, measured instead of a verdict.
    pub timely: Option<Timely>,
    /// Timely accuracy of predictions, measured in addition to the drives.
    pub timely_prediction: Option<TimelyPrediction>,
}

/// Labels of steps by axis.
pub type LeaveOut = BTreeMap<String, Vec<String>>;

/// Run that the axes vary.
#[derive(Clone, PartialEq, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Base {
    /// Scenario file, relative to the study's folder.
    pub scenario: PathBuf,
    /// Configuration file, relative to the study's folder, or several: the later over the earlier.
    #[serde(default)]
    pub config: Files,
    /// Keys set in every cell.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, serde_json::Value>")]
    pub set: toml::Table,
}

/// Axis of the study.
#[derive(Clone, PartialEq, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// Column name; default: the last part of the key.
    pub name: Option<String>,
    /// Dotted key of the configuration, or of the scenario (`actor.NAME.KEY`, `scenario.KEY`), that takes the values;
    /// `scenario` alone: the values are scenario files, relative to the study's folder. Absent if the axis uses
    /// `settings`.
    pub key: Option<String>,
    /// Values for `key`.
    #[serde(default)]
    pub values: Values,
    /// Named settings of several keys at once, instead of `values`.
    #[serde(default)]
    pub settings: Vec<Setting>,
}

/// Several keys set together under one name.
#[derive(Clone, PartialEq, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Setting {
    /// Name in tables.
    pub name: String,
    /// Scenario file, relative to the study's folder, instead of the base's.
    pub scenario: Option<PathBuf>,
    /// Configuration file, relative to the study's folder, over the base's, or several.
    #[serde(default)]
    pub config: Files,
    /// Keys and values.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, serde_json::Value>")]
    pub set: toml::Table,
}

/// Search for the largest added latency at which the verdict is still good.
#[derive(Clone, PartialEq, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Budget {
    /// Largest added latency tested, ms.
    pub max_ms: f64,
    /// Step of the scan, ms; at most `max_ms`.
    #[serde(default = "Budget::scan_ms")]
    pub scan_ms: f64,
    /// Interval width at which the bisection ends, ms; at most `scan_ms`.
    #[serde(default = "Budget::resolution_ms")]
    pub resolution_ms: f64,
    /// Axis that gets one more step, `limit`: the largest reaction time at which the vehicle itself can still avoid a
    /// collision.
    pub limit: Option<String>,
}

/// Key of an axis over scenarios.
pub(crate) const SCENARIO: &str = "scenario";

/// Name of the step for the vehicle's own limit.
pub const LIMIT: &str = "limit";

impl Budget {
    fn scan_ms() -> f64 {
        50.0
    }

    fn resolution_ms() -> f64 {
        5.0
    }

    /// True if a budget in milliseconds is a lower bound because no tested latency failed.
    pub fn is_bound(&self, ms: f64) -> bool {
        ms >= self.max_ms
    }

    pub(super) fn check(&self, document: &Document, axes: &[String], problems: &mut Problems) {
        if let Some(axis) = self.limit.as_ref().filter(|name| !axes.contains(name)) {
            problems.push(document.problem("budget.limit", no_axis(axis, axes)));
        }
        let times =
            [("max_ms", self.max_ms), ("scan_ms", self.scan_ms), ("resolution_ms", self.resolution_ms)];
        let mut below = (1e5, String::new());
        for (name, ms) in times {
            let (most_ms, whose) = below;
            if !(BUDGET_MIN_MS..=most_ms).contains(&ms) {
                let (most, found) = (number(most_ms), number(ms));
                let message = format!("expected {BUDGET_MIN_MS} to {most}{whose}, found {found}");
                problems.push(document.problem(&format!("budget.{name}"), message));
                return;
            }
            below = (ms, format!(" (budget.{name})"));
        }
    }
}

/// Minimum of a budget's times, ms.
const BUDGET_MIN_MS: f64 = 0.1;

/// Keys with their values, in order of assignment.
pub type Sets = Vec<(String, toml::Value)>;

/// One step of an axis.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Step {
    /// Label in tables.
    pub label: String,
    /// Scenario, if the step names one.
    pub scenario: Option<PathBuf>,
    /// Configuration files over the base's.
    pub config: Vec<PathBuf>,
    /// Assignments of the step.
    pub sets: Sets,
}

impl Axis {
    pub(super) fn steps(&self, folder: &Path) -> Result<(String, Vec<Step>), String> {
        let from_values = self.values.0.iter().map(|value| {
            let key = self.key.clone().ok_or("`values` need a `key`")?;
            if key == SCENARIO {
                let file = value.as_str().ok_or("expected scenario files")?;
                let stem = Path::new(file).file_stem().map_or(file.into(), |stem| stem.to_string_lossy());
                let scenario = beside(folder, Path::new(file), Kind::Scenario);
                return Ok(Step { label: stem.into_owned(), scenario: Some(scenario), ..Step::default() });
            }
            Ok(Step { label: label_of(value), sets: vec![(key, value.clone())], ..Step::default() })
        });
        let from_settings = self.settings.iter().map(|setting| {
            let mut sets = Vec::new();
            flatten("", &setting.set, &mut sets);
            let scenario = setting.scenario.as_ref().map(|path| beside(folder, path, Kind::Scenario));
            let config = setting.config.0.iter().map(|path| beside(folder, path, Kind::Config)).collect();
            Ok(Step { label: setting.name.clone(), scenario, config, sets })
        });
        let steps: Vec<Step> = from_values.chain(from_settings).collect::<Result<_, &str>>()?;
        if steps.is_empty() {
            return Err("expected `values` or `settings` that are not empty".into());
        }
        let mut labels = BTreeSet::new();
        if let Some(twice) = steps.iter().find(|step| !labels.insert(&step.label)) {
            return Err(format!("`{}` occurs twice", twice.label));
        }
        if let Some([one, other]) = self.values.equal_numbers() {
            return Err(format!("`{one}` and `{other}` are the same number"));
        }
        let name = self
            .name
            .clone()
            .or(self.key.as_deref().map(name_of))
            .ok_or("an axis without `key` needs a `name`")?;
        Ok((name, steps))
    }
}

/// Flattens nested tables to dotted keys; keys that contain dots are kept as written.
pub(super) fn flatten(prefix: &str, table: &toml::Table, out: &mut Vec<(String, toml::Value)>) {
    for (name, value) in table {
        let key = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
        match value {
            toml::Value::Table(inner) if !inner.is_empty() && !is_one_value(&key) => {
                flatten(&key, inner, out)
            }
            _ => out.push((key, value.clone())),
        }
    }
}

/// `path` relative to `folder`, without detours to the same file (`configs/../scenarios`); or the name of a built-in
/// file.
pub(super) fn beside(folder: &Path, path: &Path, kind: Kind) -> PathBuf {
    let joined = folder.join(path);
    let mut short = PathBuf::new();
    for part in joined.components() {
        match (part, short.components().next_back()) {
            (Component::ParentDir, Some(Component::Normal(_))) => {
                short.pop();
            }
            _ => short.push(part),
        }
    }
    // Through a symbolic link, `a/..` may be elsewhere.
    let same = joined.canonicalize().ok() == short.canonicalize().ok();
    kind.meant(path, if same { short } else { joined })
}
