//! Reading of configurations from text, and their check.

use std::path::Path;

use swerve_text::{Document, Guessed, KeyProblem, Misread, Problem, Problems};

use crate::assembly::settings::give_sections;
use crate::config::Config;
use crate::config::car::fill_in;
use crate::config::near_keys::with_near_keys;
use crate::config::old_names::with_present_name;
use crate::config::process::with_whole_paths;
use crate::problems::KeyProblems;
use crate::registry::Registry;
use crate::sections::SECTIONS;
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
        fill_in(&mut table);
        let problem = |key: &str, message| document.problem(&as_written(&document.table, key), message);
        let (config, mut faults, mut guessed) = match swerve_text::read_meant::<Config>(&table) {
            Ok(config) => (Some(config), Vec::new(), Guessed::default()),
            Err(Misread { problems, meant, guessed }) => (meant, problems, guessed),
        };
        let mut setup = config.map(|config| Self::new(config, registry));
        faults.extend(setup.iter_mut().flat_map(|setup| give_sections(setup, &mut guessed)));
        let of_form = faults.len();
        if let Some(setup) = &setup {
            setup.check(&mut faults);
        }
        if let Some(setup) = setup.filter(|_| faults.is_empty()) {
            return Ok(setup);
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
            let set = |key: &str| {
                sets.iter().rev().find(|(k, _)| key.starts_with(k.as_str()) || k.starts_with(key))
            };
            match under_operator(key).and_then(|other| set(&other)).or_else(|| set(key)) {
                Some((k, _)) => set_problem(k, message),
                None => document.problem(&as_written(&document.table, key), message),
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
        fill_in(&mut table);
        let problems = |found: KeyProblems| {
            let named = found.into_iter().map(with_present_name).map(with_near_keys);
            named.map(|(key, message)| set_problem(&key, message)).collect::<Problems>()
        };
        let mut setup = Self::new(swerve_text::read(&table).map_err(problems)?, registry);
        let found = give_sections(&mut setup, &mut Guessed::default());
        if found.is_empty() { Ok(setup) } else { Err(problems(found)) }
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
    let mut problems: Vec<Problem> = faults
        .into_iter()
        .map(with_present_name)
        .map(with_near_keys)
        .map(|(key, message)| problem(&key, message))
        .collect();
    problems.sort_by_key(|problem| (problem.line.is_none(), problem.line));
    problems.into_iter().collect()
}

/// Key under `[operator.NAME]` of a key of a table for one operator, such as `[camera.NAME]`.
fn under_operator(key: &str) -> Option<String> {
    let (section, rest) = key.split_once('.')?;
    let is_of_each = SECTIONS.iter().any(|of| of.table() == Some(section) && of.is_of_each());
    is_of_each.then(|| format!("operator.{rest}"))
}

/// Key as written: `[camera.front]` may be `[operator.front] kind = "camera"`.
fn as_written(table: &toml::Table, key: &str) -> String {
    let has = |key: &str, depth: usize| {
        let parts: Vec<&str> = key.split(['.', '[']).take(depth).collect();
        let first = table.get(parts[0]);
        let found = first.and_then(|first| parts[1..].iter().try_fold(first, |at, part| at.get(part)));
        parts.len() == depth && found.is_some()
    };
    let Some(other) = under_operator(key) else { return key.to_owned() };
    // The operator's value overrides that of the table.
    let moved = has(&other, 3) || !has(key, 3) && !has(key, 2) && has(&other, 2);
    if moved { other } else { key.to_owned() }
}

fn set_problem(key: &str, message: impl Into<String>) -> Problem {
    Problem { file: "--set".into(), line: None, key: key.to_owned(), message: message.into() }
}
