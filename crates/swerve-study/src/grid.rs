//! Study files: a base run and axes over configuration keys, expanded to cells.

mod file;
mod forms;
mod left_out;
mod places;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Serialize;
use swerve_drive::shipped::Kind;
use swerve_report::output::quoted;
use swerve_text::{Document, Problem, Problems};

pub(crate) use file::SCENARIO;
use file::flatten;
pub use file::{Axis, Base, Budget, LIMIT, LeaveOut, Sets, Setting, Step, StudyFile};
pub use forms::{Files, Values};
use left_out::{check_left_out, left_out};
pub(crate) use places::overridden;

use crate::tables::{Curve, Plot, Ranking, Timely, TimelyPrediction};

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
    /// Mean of a metric over an axis, if requested.
    pub plot: Option<Plot>,
    /// Combinations that are not driven.
    pub leave_out: Vec<LeaveOut>,
    /// Ranking of settings, if requested.
    pub ranking: Option<Ranking>,
    /// Timely accuracy of perception, measured instead of a verdict.
    pub timely: Option<Timely>,
    /// Timely accuracy of predictions, and the study's folder.
    pub timely_prediction: Option<(TimelyPrediction, PathBuf)>,
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
        Self::read_meant(path, sets).map_err(|(problems, _)| problems)
    }

    /// Same as [`read`](Self::read), but the error also contains the study without its wrong axes, if that can be read.
    pub(crate) fn read_meant(
        path: &Path,
        sets: &[(String, toml::Value)],
    ) -> Result<Self, (Problems, Option<Box<Self>>)> {
        let mut meant = None;
        Self::read_or(path, sets, &mut meant).map_err(|problems| (problems, meant))
    }

    fn read_or(
        path: &Path,
        sets: &[(String, toml::Value)],
        meant: &mut Option<Box<Self>>,
    ) -> Result<Self, Problems> {
        let document = Kind::Study.document(path)?;
        let folder = Kind::Study.place(path).parent().unwrap_or(Path::new(""));
        let stem = path.file_stem().map_or_else(|| "study".into(), |s| s.to_string_lossy().into_owned());
        let study = document.to_checked(|file| {
            let (study, problems) = Self::checked(&document, file, (folder, stem), sets);
            if problems.is_empty() {
                return Ok(study);
            }
            *meant = Some(Box::new(study));
            Err(problems)
        })?;
        Ok(Self { doubt: Kind::Study.doubt(path, &document.text), ..study })
    }

    fn checked(
        document: &Document,
        file: StudyFile,
        (folder, name): (&Path, String),
        sets: &[(String, toml::Value)],
    ) -> (Self, Problems) {
        let mut problems = Problems::new();
        let (axes, steps) = read_axes(document, (&file, folder), sets, &mut problems);
        if let Some(budget) = &file.budget {
            budget.check(document, &axes, &mut problems);
        }
        if let Some(ranking) = &file.ranking {
            ranking.check(document, &axes, &mut problems);
        }
        if let Some(plot) = &file.plot {
            plot.check(document, (&axes, &steps), &mut problems);
            if file.budget.is_some() {
                problems.push(document.problem("plot", "not with budget: a budget has bounds, no mean"));
            }
        }
        if let Some(timely) = &file.timely {
            timely.check(document, &axes, &mut problems);
            if file.budget.is_some()
                || file.curve.is_some()
                || file.plot.is_some()
                || file.ranking.is_some()
                || file.timely_prediction.is_some()
            {
                let message = "not with budget, curve, plot, ranking or timely_prediction: nothing is driven";
                problems.push(document.problem("timely", message));
            }
        }
        if let Some(timely_prediction) = &file.timely_prediction {
            timely_prediction.check(document, &mut problems);
        }
        check_left_out(document, &file.leave_out, (&axes, &steps), &mut problems);
        let mut base = Vec::new();
        flatten("", &file.base.set, &mut base);
        base.extend_from_slice(sets);
        let study = Self {
            file: document.file.clone(),
            doubt: None,
            lines: places::lines(document, &file),
            files: places::files(document, &file, folder),
            name,
            description: file.description,
            scenario: file::beside(folder, &file.base.scenario, Kind::Scenario),
            config: file.base.config.0.iter().map(|c| file::beside(folder, c, Kind::Config)).collect(),
            axes,
            base,
            steps,
            cells: Vec::new(),
            budget: file.budget,
            timeout_is_good: file.timeout_is_good,
            off_road_is_good: file.off_road_is_good,
            curve: file.curve,
            plot: file.plot,
            leave_out: file.leave_out,
            ranking: file.ranking,
            timely: file.timely,
            timely_prediction: file
                .timely_prediction
                .map(|timely_prediction| (timely_prediction, folder.to_owned())),
        };
        (study, problems)
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

#[cfg(test)]
mod tests;
