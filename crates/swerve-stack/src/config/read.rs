//! From text to a configuration that is checked.

use std::path::Path;

use swerve_text::{Document, Problem, Problems};

use super::Config;
use super::car::fill_in;
use super::process::with_whole_paths;
use crate::assembly::gather_named_sections;
use crate::registry::Registry;

impl Config {
    /// Reads a file (or takes the defaults) and applies assignments in order; everything is checked.
    pub fn load(file: Option<&Path>, sets: &[(String, toml::Value)]) -> Result<Self, Problems> {
        Self::load_with(&Registry::standard(), file, sets)
    }

    /// As [`load`](Self::load), with other kinds of operators than Swerve's own.
    pub fn load_with(
        registry: &Registry,
        file: Option<&Path>,
        sets: &[(String, toml::Value)],
    ) -> Result<Self, Problems> {
        let document = match file {
            Some(path) => Document::read(path)?,
            None => Document::parse("defaults", String::new())?,
        };
        Self::from_document_with(registry, &document, sets)
    }

    /// As [`load`](Self::load), from text that is already at hand.
    pub fn from_document(document: &Document, sets: &[(String, toml::Value)]) -> Result<Self, Problems> {
        Self::from_document_with(&Registry::standard(), document, sets)
    }

    /// As [`from_document`](Self::from_document), with other kinds of operators than Swerve's own.
    pub fn from_document_with(
        registry: &Registry,
        document: &Document,
        sets: &[(String, toml::Value)],
    ) -> Result<Self, Problems> {
        let plain = Self::formed_of_file(registry, document)?;
        // The file's own problems are told with their lines; what is left is one of an assignment.
        let plain = plain.checked(|key, message| document.problem(&as_written(document, key), message))?;
        if sets.is_empty() { Ok(plain) } else { Self::with_sets(registry, document, sets) }
    }

    /// A file as it is written.
    fn formed_of_file(registry: &Registry, document: &Document) -> Result<Self, Problems> {
        let mut table = with_whole_paths(document.table.clone(), document.folder());
        gather_named_sections(&mut table, registry);
        fill_in(&mut table);
        let mut config: Self = match table == document.table {
            true => document.to()?,
            false => document.with_table(table).to()?,
        };
        config.registry = registry.clone();
        Ok(config)
    }

    /// A document that has no problems of its own, with assignments; the problems are theirs.
    pub fn with_sets(
        registry: &Registry,
        document: &Document,
        sets: &[(String, toml::Value)],
    ) -> Result<Self, Problems> {
        Self::formed(registry, document, sets)?.checked(|key, message| {
            let set = sets.iter().rev().find(|(k, _)| key.starts_with(k.as_str()) || k.starts_with(key));
            match set {
                Some((k, _)) => set_problem(k, message),
                None => document.problem(key, message),
            }
        })
    }

    /// As [`with_sets`](Self::with_sets), with no look at the values: the faults are those of their form.
    pub fn formed(
        registry: &Registry,
        document: &Document,
        sets: &[(String, toml::Value)],
    ) -> Result<Self, Problems> {
        let mut table = with_whole_paths(document.table.clone(), document.folder());
        for (key, value) in sets {
            swerve_text::set(&mut table, key, value.clone())
                .map_err(|(key, message)| set_problem(&key, message))?;
        }
        let mut table = with_whole_paths(table, Path::new(""));
        gather_named_sections(&mut table, registry);
        fill_in(&mut table);
        let config: Self = swerve_text::read(&table).map_err(|found| {
            found.into_iter().map(|(key, message)| set_problem(&key, message)).collect::<Problems>()
        })?;
        Ok(Self { registry: registry.clone(), ..config })
    }

    fn checked(self, problem: impl Fn(&str, String) -> Problem) -> Result<Self, Problems> {
        let mut faults = self.problems_of_values();
        self.check_pipeline(&mut faults);
        if faults.is_empty() {
            return Ok(self);
        }
        let mut problems: Vec<Problem> =
            faults.into_iter().map(|(key, message)| problem(&key, message)).collect();
        // In the order of the lines; what has none may follow from them.
        problems.sort_by_key(|problem| (problem.line.is_none(), problem.line));
        Err(problems.into_iter().collect())
    }
}

/// The key of an entry such as `[camera.front]` where it is written as `[operator.front] kind = "camera"`.
fn as_written(document: &Document, key: &str) -> String {
    let mut parts = key.splitn(3, '.');
    let (section, name) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    let has = |table: &str| document.table.get(table).and_then(|table| table.get(name)).is_some();
    let is_moved = section != "operator" && !name.is_empty() && !has(section) && has("operator");
    match is_moved {
        true => format!("operator{}", &key[section.len()..]),
        false => key.to_owned(),
    }
}

fn set_problem(key: &str, message: impl Into<String>) -> Problem {
    Problem { file: "--set".into(), line: None, key: key.to_owned(), message: message.into() }
}
