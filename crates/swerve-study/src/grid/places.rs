//! Where the file of a study says what.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use swerve_drive::shipped::Kind;
use swerve_text::{Document, Problem};

use super::{StudyFile, flatten, named};

/// The lines of the file that set configuration keys, by key.
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

/// The places of the file that name other files, by these as they are looked for.
pub(super) fn files(document: &Document, file: &StudyFile, folder: &Path) -> BTreeMap<PathBuf, Problem> {
    let mut all = vec![("base.scenario".to_owned(), Kind::Scenario, Some(&file.base.scenario))];
    all.push(("base.config".to_owned(), Kind::Config, file.base.config.as_ref()));
    for (i, axis) in file.axis.iter().enumerate() {
        for (j, setting) in axis.settings.iter().enumerate() {
            let key = format!("axis[{i}].settings[{j}].scenario");
            all.push((key, Kind::Scenario, setting.scenario.as_ref()));
        }
    }
    // Of several places the first counts.
    let place = |(key, kind, path): (String, Kind, Option<&PathBuf>)| {
        Some((named(kind, folder, path?), document.problem(&key, "")))
    };
    all.into_iter().rev().filter_map(place).collect()
}
