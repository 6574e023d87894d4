//! Axes over keys without an effect: every cell along them is the same.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use swerve_scenario::split_sets;
use swerve_stack::{Registry, Setup};
use swerve_text::{Document, KeyProblem, Problem, Problems};

use super::grid::{Step, Study};
use super::joint::located;

/// Maximum number of cells in which a key is looked at; of larger studies, a sample.
const CELLS_MAX: usize = 512;

/// Keys of axes that have no effect in any cell, since no running operator reads them.
pub(super) fn problems(
    study: &Study,
    bases: &BTreeMap<Vec<PathBuf>, Document>,
    registry: &Registry,
) -> Problems {
    // Nothing is driven: the operators of the pipeline do not matter.
    if study.timely.is_some() {
        return Problems::new();
    }
    let mut found = Problems::new();
    for (axis, steps) in study.steps.iter().enumerate() {
        let of_config = steps.iter().flat_map(|step| split_sets(&step.sets).1);
        let keys: BTreeSet<String> = of_config.map(|(key, _)| key).collect();
        for key in keys {
            if let Some((idle, message)) = idle(study, (axis, &key), bases, registry) {
                let message = message.replacen("has no effect", "has no effect in any cell of the study", 1);
                let problem = Problem { file: "--set".into(), line: None, key: idle, message };
                found.push(located(study, problem));
            }
        }
    }
    found
}

/// The problem of a key of an axis if the key has no effect in any cell that sets it.
fn idle(
    study: &Study,
    (axis, key): (usize, &str),
    bases: &BTreeMap<Vec<PathBuf>, Document>,
    registry: &Registry,
) -> Option<KeyProblem> {
    let has = |step: &&Step| step.sets.iter().any(|(set, _)| set == key);
    let with_key: Vec<&Step> = study.steps[axis].iter().filter(has).collect();
    let mut idle = None;
    for (k, cell) in sample(study.steps.iter().map(Vec::len).product()).enumerate() {
        let mut rest = cell;
        let mut steps: Vec<&Step> = Vec::new();
        for (other, all) in study.steps.iter().enumerate().rev() {
            let step = &all[rest % all.len()];
            rest /= all.len();
            let keeps = other != axis || has(&step);
            steps.push(if keeps { step } else { with_key[k % with_key.len()] });
        }
        steps.reverse();
        let files: Vec<PathBuf> =
            study.config.iter().chain(steps.iter().flat_map(|step| &step.config)).cloned().collect();
        let sets: Vec<_> =
            study.base.iter().chain(steps.iter().flat_map(|step| &step.sets)).cloned().collect();
        let (_, of_config) = split_sets(&sets);
        let value = of_config.iter().rev().find(|(set, _)| set == key).map(|(_, value)| value.clone())?;
        let mut given = toml::Table::new();
        swerve_text::set(&mut given, key, value).ok()?;
        let setup = Setup::formed(registry, bases.get(&files)?, &of_config).ok()?;
        idle = Some(setup.idle(&given).into_iter().next()?);
    }
    idle
}

/// Indices of cells: all of them, or a sample that is not periodic.
fn sample(cells: usize) -> impl Iterator<Item = usize> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let place = move |k: usize| ((k as f64 * GOLDEN).fract() * cells as f64) as usize;
    (0..cells.min(CELLS_MAX)).map(move |k| if cells <= CELLS_MAX { k } else { place(k).min(cells - 1) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(text: &str) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("s.toml");
        std::fs::write(&file, text).unwrap();
        let bases = BTreeMap::from([(Vec::new(), Document::parse("defaults", String::new()).unwrap())]);
        let study = Study::read(&file, &[]).unwrap();
        problems(&study, &bases, &Registry::standard()).iter().map(Problem::to_string).collect()
    }

    #[test]
    fn axis_over_an_operator_that_runs_in_no_cell_is_refused() {
        let axis = "base = { scenario = \"a.toml\" }\n[[axis]]\nkey = \"operator.detector.delay_ms\"\nvalues = [1, 2]\n\
                    [[axis]]\nkey = \"seed\"\nvalues = [1, 2]\n";
        let found = told(axis);
        let expected = "s.toml:4: operator.detector.delay_ms: has no effect in any cell of the study: operator \
                        `detector` does not run; it runs with `perception.detector = \"NAME\"`";
        assert!(found.len() == 1 && found[0].ends_with(expected), "{found:?}");
        let other = "[[axis]]\nkey = \"perception.detector\"\nvalues = [\"truth\", \"custom\"]\n";
        assert_eq!(told(&format!("{axis}{other}")), Vec::<String>::new());
    }

    #[test]
    fn sample_of_many_cells_has_no_period() {
        let cells: Vec<usize> = sample(1 << 20).collect();
        let odd = cells.iter().filter(|cell| *cell % 2 == 1).count();
        assert!(cells.len() == CELLS_MAX && (200..312).contains(&odd), "{odd}");
        assert_eq!(sample(3).collect::<Vec<_>>(), [0, 1, 2]);
    }
}
