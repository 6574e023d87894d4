//! Locations in a study file, for error messages.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use swerve_drive::shipped::Kind;
use swerve_text::{Document, Problem, is_within};

use super::file::{SCENARIO, Step, StudyFile, beside, flatten};

/// Lines of the file that set configuration keys, by key.
pub(super) fn lines(document: &Document, file: &StudyFile) -> BTreeMap<String, usize> {
    let mut lines = BTreeMap::new();
    let mut at = |place: &str, key: &str| {
        lines.extend(document.problem(place, "").line.map(|line| (key.to_owned(), line)));
    };
    let mut all_of = |place: &str, table: &toml::Table| {
        let mut sets = Vec::new();
        flatten("", table, &mut sets);
        for (key, _) in &sets {
            at(&format!("{place}.{key}"), key);
        }
    };
    all_of("base.set", &file.base.set);
    for (i, axis) in file.axis.iter().enumerate() {
        for (j, setting) in axis.settings.iter().enumerate() {
            all_of(&format!("axis[{i}].settings[{j}].set"), &setting.set);
        }
    }
    for (i, axis) in file.axis.iter().enumerate() {
        if let Some(key) = &axis.key {
            at(&format!("axis[{i}].values"), key);
        }
    }
    lines
}

/// Places in the file that name other files, by the resolved paths of these.
pub(super) fn files(document: &Document, file: &StudyFile, folder: &Path) -> BTreeMap<PathBuf, Problem> {
    let mut of_values: Vec<(String, PathBuf)> = Vec::new();
    let mut named = vec![("base.scenario".to_owned(), Some(&file.base.scenario), Kind::Scenario)];
    named.extend(file.base.config.0.iter().map(|path| ("base.config".to_owned(), Some(path), Kind::Config)));
    for (i, axis) in file.axis.iter().enumerate() {
        for (j, setting) in axis.settings.iter().enumerate() {
            let key = format!("axis[{i}].settings[{j}].scenario");
            named.push((key, setting.scenario.as_ref(), Kind::Scenario));
            let key = format!("axis[{i}].settings[{j}].config");
            named.extend(setting.config.0.iter().map(|path| (key.clone(), Some(path), Kind::Config)));
        }
        if axis.key.as_deref() == Some(SCENARIO) {
            let key = format!("axis[{i}].values");
            of_values
                .extend(axis.values.0.iter().filter_map(|file| Some((key.clone(), file.as_str()?.into()))));
        }
    }
    named.extend(of_values.iter().map(|(key, path)| (key.clone(), Some(path), Kind::Scenario)));
    // If a file is named several times, the first place is kept.
    let place = |(key, path, kind): (String, Option<&PathBuf>, Kind)| {
        Some((beside(folder, path?, kind), document.problem(&key, "")))
    };
    named.into_iter().rev().filter_map(place).collect()
}

/// Problem of an assignment from outside to a key that the axis sets in every cell, or to a key within it.
pub(crate) fn overridden(sets: &[(String, toml::Value)], steps: &[Step], axis: &str) -> Option<Problem> {
    let varied = |key: &str| steps.iter().any(|step| step.sets.iter().any(|(k, _)| is_within(key, k)));
    let (key, _) = sets.iter().find(|(key, _)| varied(key))?;
    Some(Problem {
        file: "--set".to_owned(),
        line: None,
        key: key.clone(),
        message: format!("the axis `{axis}` of the study varies it"),
    })
}
