//! Study files: a base run and axes over configuration keys, expanded to cells.

mod forms;
mod left_out;
mod places;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_drive::shipped::Kind;
use swerve_report::output::quoted;
use swerve_text::{Document, Problem, Problems, number};

pub use forms::{Files, Values};
use forms::{label_of, name_of};
use left_out::{check_left_out, left_out};
pub(crate) use places::{no_axis, overridden};

use super::curve::Curve;
use super::ranking::Ranking;
use super::timely::Timely;
use super::timely_prediction::TimelyPrediction;

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

    fn check(&self, document: &Document, axes: &[String], problems: &mut Problems) {
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

/// A checked study.
#[derive(Clone, Debug)]
pub struct Study {
    /// Study file, as named by the caller.
    pub file: String,
    /// Reason not to start any program that the file names.
    pub(crate) doubt: Option<String>,
    /// Lines of the file that set configuration keys, by key.
    pub lines: BTreeMap<String, usize>,
    /// Places in the file that name other files.
    pub(crate) files: BTreeMap<PathBuf, Problem>,
    /// Name of the study: its file's stem.
    pub name: String,
    /// Title for pictures.
    pub description: String,
    /// Scenario file.
    pub scenario: PathBuf,
    /// Configuration files, the later over the earlier.
    pub config: Vec<PathBuf>,
    /// Column names, one per axis.
    pub axes: Vec<String>,
    /// Assignments for every cell, before those of the axes.
    pub base: Sets,
    /// Steps of each axis.
    pub steps: Vec<Vec<Step>>,
    /// All combinations, the last axis fastest; empty before [`expand`](Self::expand).
    pub cells: Vec<Cell>,
    /// Search for a latency budget, if requested.
    pub budget: Option<Budget>,
    /// True if drives that ended by timeout, safely stopped or not, count as good in the picture.
    pub timeout_is_good: bool,
    /// True if drives that left the road without a collision count as good in the picture.
    pub off_road_is_good: bool,
    /// Quantity drawn over time, if requested.
    pub curve: Option<Curve>,
    /// Combinations that are not driven.
    pub leave_out: Vec<LeaveOut>,
    /// Ranking of settings, if requested.
    pub ranking: Option<Ranking>,
    /// Timely accuracy of perception, measured instead of a verdict.
    pub timely: Option<Timely>,
    /// Timely accuracy of predictions, and the study's folder.
    pub timely_prediction: Option<(TimelyPrediction, PathBuf)>,
}

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

/// One combination of the axes.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Cell {
    /// Position in the study, from 0.
    pub index: usize,
    /// Labels in tables, one per axis.
    pub labels: Vec<String>,
    /// Scenario, if not the base's.
    pub scenario: Option<PathBuf>,
    /// Configuration files, the later over the earlier.
    pub config: Vec<PathBuf>,
    /// Assignments on top of the base configuration, in order.
    pub sets: Sets,
}

/// Maximum number of cells; more are considered a mistake.
pub(crate) const CELLS_MAX: usize = 1_000_000;

impl Study {
    /// Reads a study file. `sets` are applied after the base's assignments and before the axes.
    ///
    /// # Errors
    /// All problems of the file itself; its cells are not checked.
    pub fn read(path: &Path, sets: &[(String, toml::Value)]) -> Result<Self, Problems> {
        let document = Kind::Study.document(path)?;
        let folder = Kind::Study.place(path).parent().unwrap_or(Path::new(""));
        let stem = path.file_stem().map_or_else(|| "study".into(), |s| s.to_string_lossy().into_owned());
        let study = document.to_checked(|file| Self::checked(&document, file, (folder, stem), sets))?;
        Ok(Self { doubt: Kind::Study.doubt(path, &document.text), ..study })
    }

    fn checked(
        document: &Document,
        file: StudyFile,
        (folder, name): (&Path, String),
        sets: &[(String, toml::Value)],
    ) -> Result<Self, Problems> {
        let mut problems = Problems::new();
        let (axes, steps) = read_axes(document, (&file, folder), sets, &mut problems);
        if let Some(budget) = &file.budget {
            budget.check(document, &axes, &mut problems);
        }
        if let Some(ranking) = &file.ranking {
            ranking.check(document, &axes, &mut problems);
        }
        if let Some(timely) = &file.timely {
            timely.check(document, &axes, &mut problems);
            if file.budget.is_some()
                || file.curve.is_some()
                || file.ranking.is_some()
                || file.timely_prediction.is_some()
            {
                let message = "not with budget, curve, ranking or timely_prediction: nothing is driven";
                problems.push(document.problem("timely", message));
            }
        }
        if let Some(timely_prediction) = &file.timely_prediction {
            timely_prediction.check(document, &mut problems);
        }
        check_left_out(document, &file.leave_out, (&axes, &steps), &mut problems);
        if !problems.is_empty() {
            return Err(problems);
        }
        let mut base = Vec::new();
        flatten("", &file.base.set, &mut base);
        base.extend_from_slice(sets);
        Ok(Self {
            file: document.file.clone(),
            doubt: None,
            lines: places::lines(document, &file),
            files: places::files(document, &file, folder),
            name,
            description: file.description,
            scenario: places::beside(folder, &file.base.scenario, Kind::Scenario),
            config: file.base.config.0.iter().map(|c| places::beside(folder, c, Kind::Config)).collect(),
            axes,
            base,
            steps,
            cells: Vec::new(),
            budget: file.budget,
            timeout_is_good: file.timeout_is_good,
            off_road_is_good: file.off_road_is_good,
            curve: file.curve,
            leave_out: file.leave_out,
            ranking: file.ranking,
            timely: file.timely,
            timely_prediction: file
                .timely_prediction
                .map(|timely_prediction| (timely_prediction, folder.to_owned())),
        })
    }

    /// Expands the axes to cells.
    #[must_use]
    pub fn expand(mut self) -> Self {
        let (config, sets) = (self.config.clone(), self.base.clone());
        let mut cells = vec![Cell { index: 0, labels: Vec::new(), scenario: None, config, sets }];
        for steps in &self.steps {
            cells = cells.iter().flat_map(|cell| steps.iter().map(move |step| cell.and(step))).collect();
        }
        cells.retain(|cell| !left_out(&self.leave_out, &self.axes, &cell.labels));
        for (index, cell) in cells.iter_mut().enumerate() {
            cell.index = index;
        }
        self.cells = cells;
        self
    }

    /// Scenario file of a cell.
    pub fn scenario<'a>(&'a self, cell: &'a Cell) -> &'a Path {
        cell.scenario.as_deref().unwrap_or(&self.scenario)
    }

    /// All scenario files, without duplicates.
    pub fn scenarios(&self) -> BTreeSet<&Path> {
        let named = self.steps.iter().flatten().filter_map(|step| step.scenario.as_deref());
        named.chain([self.scenario.as_path()]).collect()
    }

    /// All combinations of configuration files, without duplicates.
    pub fn configs(&self) -> BTreeSet<Vec<PathBuf>> {
        let mut all = BTreeSet::from([self.config.clone()]);
        for steps in &self.steps {
            let over = |base: &Vec<PathBuf>| {
                let base = base.clone();
                steps.iter().map(move |step| [base.as_slice(), &step.config].concat()).collect::<Vec<_>>()
            };
            all = all.iter().flat_map(over).collect();
        }
        all
    }

    /// Problem of a file that the study names, at the place that names it.
    pub fn unread(&self, path: &Path, problem: Problem) -> Problem {
        let named = |at: &Problem| Problem { message: problem.to_string(), ..at.clone() };
        self.files.get(path).map_or_else(|| problem.clone(), named)
    }

    /// Command line that repeats one cell.
    pub fn command(&self, cell: &Cell) -> String {
        let mut line = format!("swerve run {}", quoted(&self.scenario(cell).display().to_string()));
        for config in &cell.config {
            line += &format!(" -c {}", quoted(&config.display().to_string()));
        }
        for (key, value) in &cell.sets {
            line += &format!(" --set {}", quoted(&format!("{key}={value}")));
        }
        line
    }
}

/// Names and steps of the axes; errors are appended to `problems`.
fn read_axes(
    document: &Document,
    (file, folder): (&StudyFile, &Path),
    sets: &[(String, toml::Value)],
    problems: &mut Problems,
) -> (Vec<String>, Vec<Vec<Step>>) {
    let (mut axes, mut all): (Vec<String>, Vec<Vec<Step>>) = (Vec::new(), Vec::new());
    if file.axis.is_empty() {
        problems.push(document.problem("axis", "expected at least one axis"));
    }
    for (i, axis) in file.axis.iter().enumerate() {
        let mut wrong = |message| problems.push(document.problem(&format!("axis[{i}]"), message));
        let (name, mut steps) = match axis.steps(folder) {
            Ok(read) => read,
            Err(message) => {
                wrong(message);
                continue;
            }
        };
        if file.budget.as_ref().and_then(|b| b.limit.as_ref()) == Some(&name) {
            steps.push(Step { label: LIMIT.into(), ..Step::default() });
        }
        if axes.contains(&name) {
            wrong(format!(
                "a second axis of the name `{name}`: give one of them another by `name = \"...\"`"
            ));
        }
        let before: usize = all.iter().map(Vec::len).product();
        if before <= CELLS_MAX && before.saturating_mul(steps.len()) > CELLS_MAX {
            wrong(format!("more than {CELLS_MAX} cells"));
        }
        problems.extend(overridden(sets, &steps, &name));
        axes.push(name);
        all.push(steps);
    }
    (axes, all)
}

impl Cell {
    fn and(&self, step: &Step) -> Self {
        let mut cell = self.clone();
        cell.labels.push(step.label.clone());
        cell.scenario = step.scenario.clone().or(cell.scenario);
        cell.config.extend(step.config.iter().cloned());
        cell.sets.extend(step.sets.iter().cloned());
        cell
    }

    /// Label of the cell on an axis.
    pub fn label(&self, axis: usize) -> &str {
        &self.labels[axis]
    }
}

impl Axis {
    fn steps(&self, folder: &Path) -> Result<(String, Vec<Step>), String> {
        let from_values = self.values.0.iter().map(|value| {
            let key = self.key.clone().ok_or("`values` need a `key`")?;
            if key == SCENARIO {
                let file = value.as_str().ok_or("expected scenario files")?;
                let stem = Path::new(file).file_stem().map_or(file.into(), |stem| stem.to_string_lossy());
                let scenario = places::beside(folder, Path::new(file), Kind::Scenario);
                return Ok(Step { label: stem.into_owned(), scenario: Some(scenario), ..Step::default() });
            }
            Ok(Step { label: label_of(value), sets: vec![(key, value.clone())], ..Step::default() })
        });
        let from_settings = self.settings.iter().map(|setting| {
            let mut sets = Vec::new();
            flatten("", &setting.set, &mut sets);
            let scenario = setting.scenario.as_ref().map(|path| places::beside(folder, path, Kind::Scenario));
            let config =
                setting.config.0.iter().map(|path| places::beside(folder, path, Kind::Config)).collect();
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
        let name = self
            .name
            .clone()
            .or(self.key.as_deref().map(name_of))
            .ok_or("an axis without `key` needs a `name`")?;
        Ok((name, steps))
    }
}

/// Flattens nested tables to dotted keys; keys that contain dots are kept as written.
fn flatten(prefix: &str, table: &toml::Table, out: &mut Vec<(String, toml::Value)>) {
    for (name, value) in table {
        let key = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
        match value {
            toml::Value::Table(inner) if !inner.is_empty() && prefix_is_section(&key) => {
                flatten(&key, inner, out)
            }
            _ => out.push((key, value.clone())),
        }
    }
}

/// True for a table of separate keys. Run-time models and deadlines are values in the form of tables: they replace the
/// earlier value as a whole.
fn prefix_is_section(key: &str) -> bool {
    let last = key.rsplit('.').next().unwrap_or(key);
    !matches!(last, "runtime" | "deadline")
}

#[cfg(test)]
mod tests;
