//! Checks the configurations of a study's cells without checking every cell.
//!
//! The validity of a value depends on few other keys: that of a planner's key on the choice of planner, that of a
//! resource's name on the resources. Independent axes are checked one after the other; only dependent ones are checked
//! in all combinations.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use swerve_report::progress::Progress;
use swerve_scenario::{Scenario, is_scenario_key, split_sets};
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_text::{Document, Problem, Problems, is_within};

use super::grid::{Step, Study};

/// Keys whose values are checked together; `*` matches any one name. All cross-key checks of [`Config`] must be listed
/// here.
const JOINT: [&[&str]; 5] = [
    &[
        "planning.planner",
        "planning.discretisation",
        "planning.preset",
        "planning.collision",
        "planning.params",
    ],
    &["execution", "perception", "planning", "operator.*.deadline", "operator.*.runtime"],
    &["sim.vehicle"],
    &["resource", "operator.*.uses"],
    &["fault", "log.sensors", "camera", "radar", "lidar", "perception"],
];

/// Problems of all cells, each once, with the first cell that has it, in the order of these cells.
pub(super) fn problems(
    study: &Study,
    bases: &BTreeMap<Vec<PathBuf>, Document>,
    scenarios: &Scenarios,
    registry: &Registry,
) -> Problems {
    // Problems of the files themselves are reported with their lines; the rest are problems of the cells' values.
    let own = bases.values().find_map(|base| Setup::from_document_with(registry, base, &[]).err());
    if let Some(problems) = own {
        return problems;
    }
    let classes = classes(&study.steps);
    let mut found = Found { study, bases, scenarios, first: BTreeMap::new() };
    // A malformed value is wrong in every combination: once reported, it is not combined further.
    let mut good: Vec<Vec<usize>> = study.steps.iter().map(|steps| (0..steps.len()).collect()).collect();
    for &axis in classes.iter().filter(|class| class.len() > 1).flatten() {
        good[axis].retain(|&step| {
            found.look(&[(axis, step)], |document, sets| Setup::formed(registry, document, sets))
        });
    }
    let size = |class: &[usize]| class.iter().map(|&axis| good[axis].len()).product::<usize>();
    let progress = Progress::checks(classes.iter().map(|class| size(class)).sum());
    for class in &classes {
        for place in 0..size(class) {
            found.look(&chosen(&good, class, place), |document, sets| {
                Setup::with_sets(registry, document, sets)
            });
            progress.one_done();
        }
    }
    progress.finish();
    let mut found: Vec<(Problem, usize)> = found.first.into_iter().collect();
    found.sort_by_key(|(_, cell)| *cell);
    found.into_iter().map(|(problem, cell)| in_cell(study, problem, cell)).collect()
}

/// Problems found so far, each with the first cell that has it.
struct Found<'a> {
    study: &'a Study,
    bases: &'a BTreeMap<Vec<PathBuf>, Document>,
    scenarios: &'a Scenarios,
    first: BTreeMap<Problem, usize>,
}

impl Found<'_> {
    /// Configuration files of the first cell with these steps.
    fn files(&self, chosen: &[(usize, usize)]) -> Vec<PathBuf> {
        let step_of = |axis| chosen.iter().find(|(a, _)| *a == axis).map_or(0, |(_, step)| *step);
        let steps = self.study.steps.iter().enumerate();
        let over = steps.flat_map(|(axis, steps)| steps[step_of(axis)].config.iter());
        self.study.config.iter().chain(over).cloned().collect()
    }

    /// Checks one combination of axes and steps. Returns true if it has no problems.
    fn look(
        &mut self,
        chosen: &[(usize, usize)],
        read: impl Fn(&Document, &[(String, toml::Value)]) -> Result<Setup, Problems>,
    ) -> bool {
        let mut sets = self.study.base.clone();
        sets.extend(
            chosen.iter().flat_map(|&(axis, step)| self.study.steps[axis][step].sets.iter().cloned()),
        );
        let (of_scenario, of_config) = split_sets(&sets);
        // An unreadable file is reported where it is read.
        let base = self.bases.get(&self.files(chosen));
        let mut problems = base.and_then(|base| read(base, &of_config).err()).unwrap_or_default();
        let mut named =
            chosen.iter().filter_map(|&(axis, step)| self.study.steps[axis][step].scenario.as_deref());
        let file = named.next_back().unwrap_or(&self.study.scenario);
        if let Some(scenario) = self.scenarios.changed(file, &of_scenario) {
            problems.extend(scenario.err().into_iter().flatten());
        }
        if problems.is_empty() {
            return true;
        }
        let cell = index_of(self.study, chosen);
        for problem in problems {
            let first = self.first.entry(located(self.study, problem)).or_insert(cell);
            *first = cell.min(*first);
        }
        false
    }
}

/// Scenarios of a study by file, with the last variant of each: most cells have the same assignments.
#[derive(Default)]
pub(super) struct Scenarios(BTreeMap<PathBuf, (Arc<Scenario>, Mutex<Option<Variant>>)>);

/// Assignments, and the scenario with these.
type Variant = (Vec<(String, toml::Value)>, Arc<Scenario>);

impl Scenarios {
    /// Adds the scenario of a file.
    pub(super) fn insert(&mut self, file: &Path, scenario: Scenario) {
        self.0.insert(file.to_owned(), (Arc::new(scenario), Mutex::default()));
    }

    /// The scenario of a file with the assignments applied; `None` for other files.
    pub(super) fn changed(
        &self,
        file: &Path,
        sets: &[(String, toml::Value)],
    ) -> Option<Result<Arc<Scenario>, Problems>> {
        let (scenario, last) = self.0.get(file)?;
        if sets.is_empty() {
            return Some(Ok(Arc::clone(scenario)));
        }
        let last = || last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, variant)) = last().as_ref().filter(|(known, _)| known == sets) {
            return Some(Ok(Arc::clone(variant)));
        }
        let variant = scenario.changed(&file.display().to_string(), sets).map(Arc::new);
        if let Ok(variant) = &variant {
            *last() = Some((sets.to_vec(), Arc::clone(variant)));
        }
        Some(variant)
    }
}

/// Groups of axes that depend on each other.
fn classes(steps: &[Vec<Step>]) -> Vec<Vec<usize>> {
    let mut classes: Vec<Vec<usize>> = Vec::new();
    for axis in 0..steps.len() {
        let is_joined =
            |class: &Vec<usize>| class.iter().any(|&other| are_joint(&steps[axis], &steps[other]));
        let (joined, apart): (Vec<_>, Vec<_>) = classes.into_iter().partition(is_joined);
        let mut class = joined.concat();
        class.push(axis);
        class.sort_unstable();
        classes = apart;
        classes.push(class);
    }
    classes
}

fn keys(steps: &[Step]) -> Vec<&str> {
    let mut keys: Vec<&str> = steps.iter().flat_map(|s| s.sets.iter().map(|(key, _)| key.as_str())).collect();
    keys.sort_unstable();
    keys.dedup();
    keys
}

fn are_joint(a: &[Step], b: &[Step]) -> bool {
    let is_of_scenario =
        |step: &Step| step.scenario.is_some() || step.sets.iter().any(|(key, _)| is_scenario_key(key));
    if a.iter().any(is_of_scenario) && b.iter().any(is_of_scenario) {
        return true;
    }
    let has_files = |steps: &[Step]| steps.iter().any(|step| !step.config.is_empty());
    let (a_files, b_files) = (has_files(a), has_files(b));
    let (a, b) = (keys(a), keys(b));
    let related = |a: &str, b: &str| is_within(a, b) || is_within(b, a);
    let touches = |keys: &[&str], group: &[&str]| {
        keys.iter().any(|key| group.iter().any(|pattern| is_on_the_way(key, pattern)))
    };
    // Files may set any key, so they depend on all axes whose values depend on other keys.
    let depends = |keys: &[&str]| JOINT.iter().any(|group| touches(keys, group));
    (a_files && (b_files || depends(&b)))
        || (b_files && depends(&a))
        || a.iter().any(|a| b.iter().any(|b| related(a, b)))
        || JOINT.iter().any(|group| touches(&a, group) && touches(&b, group))
}

/// True if a key equals the pattern, is within it, or contains it.
fn is_on_the_way(key: &str, pattern: &str) -> bool {
    key.split('.').zip(pattern.split('.')).all(|(name, wanted)| wanted == "*" || name == wanted)
}

/// Combination number `place` of a class: axis and one of its `steps`, the last axis fastest.
fn chosen(steps: &[Vec<usize>], class: &[usize], mut place: usize) -> Vec<(usize, usize)> {
    let mut chosen: Vec<(usize, usize)> = class
        .iter()
        .rev()
        .map(|&axis| {
            let n = steps[axis].len();
            let step = steps[axis][place % n];
            place /= n;
            (axis, step)
        })
        .collect();
    chosen.reverse();
    chosen
}

/// Index of the first cell with these steps: the other axes have their first step.
fn index_of(study: &Study, chosen: &[(usize, usize)]) -> usize {
    let step_of = |axis| chosen.iter().find(|(a, _)| *a == axis).map_or(0, |(_, step)| *step);
    (0..study.steps.len()).fold(0, |index, axis| index * study.steps[axis].len() + step_of(axis))
}

/// Moves a problem of an assignment in the study to the line that sets it.
pub(super) fn located(study: &Study, mut problem: Problem) -> Problem {
    let sets = study.lines.iter().filter(|(key, _)| is_within(&problem.key, key));
    if let Some((_, line)) = sets.max_by_key(|(key, _)| key.len()).filter(|_| problem.file == "--set") {
        problem.file.clone_from(&study.file);
        problem.line = Some(*line);
    }
    problem
}

/// Adds the first cell concerned to a problem.
fn in_cell(study: &Study, problem: Problem, mut cell: usize) -> Problem {
    let mut labels: Vec<&str> = Vec::new();
    for steps in study.steps.iter().rev() {
        labels.push(&steps[cell % steps.len()].label);
        cell /= steps.len();
    }
    labels.reverse();
    let message = format!("{}, in the cell [{}]", problem.message, labels.join(" "));
    Problem { message, ..problem }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Problems of single values, of two values together, and values that are valid only together.
    const STUDY: &str = r#"
        base = { scenario = "a.toml", set = { "operator.tracker.uses" = "gpu" , "resource.gpu.slots" = 1 } }
        [[axis]]
        key = "planning.planner"
        values = ["fot", "rrt_star", "fott"]
        [[axis]]
        key = "seed"
        values = [1, 2, -3]
        [[axis]]
        name = "params"
        [[axis.settings]]
        name = "none"
        set = { sim.dt_ms = 5 }
        [[axis.settings]]
        name = "rrt"
        set = { planning.params.goal_share = 0.2, control.period_ms = 0 }
        [[axis]]
        key = "operator.planner.uses"
        values = ["gpu", "tpu", "npu"]
        [[axis]]
        name = "tpu"
        [[axis.settings]]
        name = "without"
        set = {}
        [[axis.settings]]
        name = "with"
        set = { resource.tpu.slots = 1 }
        [[axis]]
        name = "vehicle"
        key = "sim.vehicle.limits.steering_max_rad"
        values = [0.5, 9.0]
    "#;

    fn study() -> (Study, BTreeMap<Vec<PathBuf>, Document>) {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("s.toml");
        std::fs::write(&file, STUDY).unwrap();
        let defaults = Document::parse("defaults", String::new()).unwrap();
        (Study::read(&file, &[]).unwrap(), BTreeMap::from([(Vec::new(), defaults)]))
    }

    #[test]
    fn joint_checks_find_as_much_as_checking_every_cell() {
        let (study, bases) = study();
        let by_class = problems(&study, &bases, &Scenarios::default(), &Registry::standard());
        let expanded = study.clone().expand();
        assert_eq!(expanded.cells.len(), 216);
        let mut by_cell: Vec<Problem> = Vec::new();
        for cell in &expanded.cells {
            let problems = Setup::with_sets(&Registry::standard(), &bases[&cell.config], &cell.sets)
                .err()
                .unwrap_or_default();
            by_cell.extend(problems.into_iter().map(|p| located(&study, p)));
        }
        let bare = |p: &Problem| (p.key.clone(), p.message.split(", in the cell").next().unwrap().to_owned());
        let mut by_cell: Vec<_> = by_cell.iter().map(bare).collect();
        by_cell.sort();
        by_cell.dedup();
        let mut found: Vec<_> = by_class.iter().map(bare).collect();
        found.sort();
        assert_eq!(found, by_cell);
        assert!(found.len() >= 7, "{found:#?}");
    }

    #[test]
    fn only_dependent_axes_are_combined() {
        let (study, _) = study();
        assert_eq!(classes(&study.steps), [vec![1], vec![0, 2], vec![3, 4], vec![5]]);
    }

    #[test]
    fn files_are_combined_with_axes_that_depend_on_other_keys() {
        let step = |config: &[&str], key: Option<&str>| Step {
            config: config.iter().map(PathBuf::from).collect(),
            sets: key.map(|key| (key.to_owned(), 1.into())).into_iter().collect(),
            ..Step::default()
        };
        let axes = [
            vec![step(&[], None), step(&["localizer"], None)],
            vec![step(&[], Some("seed"))],
            vec![step(&[], Some("fault.silent.stream"))],
            vec![step(&[], Some("scenario.ego.d_m"))],
        ];
        assert_eq!(classes(&axes), [vec![1], vec![0, 2], vec![3]]);
    }

    #[test]
    fn first_cell_with_a_problem_is_named() {
        let (study, bases) = study();
        let said: Vec<String> = problems(&study, &bases, &Scenarios::default(), &Registry::standard())
            .iter()
            .map(Problem::to_string)
            .collect();
        let of =
            |key: &str| said.iter().find(|s| s.contains(key)).unwrap_or_else(|| panic!("{key}: {said:#?}"));
        assert!(of("sim.vehicle.limits").ends_with("in the cell [fot 1 none gpu without 9.0]"), "{said:#?}");
        assert!(of("`tpu`").ends_with("in the cell [fot 1 none tpu without 0.5]"), "{said:#?}");
        assert!(
            of("seed").contains("s.toml:8: seed: expected a whole number that is not negative, found -3")
        );
    }
}
