//! Reading of configurations from text, and their check.

use std::path::Path;

use swerve_text::{Document, KeyProblem, Problem, Problems};

use super::Config;
use super::car::fill_in;
use super::old_names::with_present_name;
use super::process::with_whole_paths;
use crate::assembly::gather_named_sections;
use crate::kind::KeyProblems;
use crate::registry::Registry;
use crate::setup::Setup;

impl Config {
    /// The configuration of a log, without removed keys that never had an effect on results.
    pub fn logged(text: &str) -> Result<Document, Problems> {
        let mut document = Document::parse("configuration of the log", text)?;
        if let Some(render) = document.table.get_mut("render").and_then(toml::Value::as_table_mut) {
            render.remove("threads");
        }
        Ok(document)
    }

    /// Several files as one: later ones override earlier ones, key by key.
    pub fn layered(documents: impl IntoIterator<Item = Document>) -> Option<Document> {
        let whole = |mut document: Document| {
            document.table = with_whole_paths(core::mem::take(&mut document.table), document.folder());
            document
        };
        documents.into_iter().map(whole).reduce(|base, top| top.over(base))
    }
}

impl Setup {
    /// Reads a file (or takes the defaults) and applies assignments in order; checks everything.
    pub fn load(file: Option<&Path>, sets: &[(String, toml::Value)]) -> Result<Self, Problems> {
        Self::load_with(&Registry::standard(), file, sets)
    }

    /// As [`load`](Self::load), with a custom registry of operator kinds.
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

    /// As [`load`](Self::load), from a parsed document.
    pub fn from_document(document: &Document, sets: &[(String, toml::Value)]) -> Result<Self, Problems> {
        Self::from_document_with(&Registry::standard(), document, sets)
    }

    /// As [`from_document`](Self::from_document), with a custom registry of operator kinds.
    pub fn from_document_with(
        registry: &Registry,
        document: &Document,
        sets: &[(String, toml::Value)],
    ) -> Result<Self, Problems> {
        let plain = Self::of_file(registry, document)?;
        if sets.is_empty() { Ok(plain) } else { Self::with_sets(registry, document, sets) }
    }

    /// Reads a file as written; its problems have their lines. Problems found later are those of an assignment.
    fn of_file(registry: &Registry, document: &Document) -> Result<Self, Problems> {
        let mut table = with_whole_paths(document.table.clone(), document.folder());
        gather_named_sections(&mut table, registry);
        fill_in(&mut table);
        let problem = |key: &str, message| document.problem(&as_written(document, key), message);
        let misread = match swerve_text::read_meant::<Config>(&table) {
            Ok(config) => return Self::new(config, registry).checked(problem),
            Err(misread) => misread,
        };
        let (mut faults, guessed) = (misread.problems, misread.guessed);
        let of_form = faults.len();
        if let Some(meant) = misread.meant {
            Self::new(meant, registry).check(&mut faults);
        }
        let told = faults.into_iter().enumerate();
        let told = told.filter(|(i, (key, _))| *i < of_form || !guessed.holds(key)).map(|(_, fault)| fault);
        Err(in_order(told, problem))
    }

    /// Applies assignments to a document without problems; new problems are those of the assignments.
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

    /// As [`with_sets`](Self::with_sets), without checking values: only unknown keys and malformed
    /// values are problems.
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
        let config: Config = swerve_text::read(&table).map_err(|found| {
            let named = found.into_iter().map(with_present_name);
            named.map(|(key, message)| set_problem(&key, message)).collect::<Problems>()
        })?;
        Ok(Self::new(config, registry))
    }

    fn checked(self, problem: impl Fn(&str, String) -> Problem) -> Result<Self, Problems> {
        let mut faults = Vec::new();
        self.check(&mut faults);
        if faults.is_empty() { Ok(self) } else { Err(in_order(faults, problem)) }
    }

    /// Adds problems of the values and of the resulting pipeline to the `faults` already known.
    fn check(&self, faults: &mut KeyProblems) {
        faults.extend(self.problems_of_values());
        self.check_pipeline(faults);
    }
}

/// Problems ordered by line; those without a line may be consequences and come last.
fn in_order(
    faults: impl IntoIterator<Item = KeyProblem>,
    problem: impl Fn(&str, String) -> Problem,
) -> Problems {
    let mut problems: Vec<Problem> =
        faults.into_iter().map(with_present_name).map(|(key, message)| problem(&key, message)).collect();
    problems.sort_by_key(|problem| (problem.line.is_none(), problem.line));
    problems.into_iter().collect()
}

/// Key of an entry such as `[camera.front]` that is written as `[operator.front] kind = "camera"`.
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
