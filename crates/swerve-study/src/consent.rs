//! Base configurations of a study, and consent to the programs that they name.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use swerve_drive::shipped::Kind;
use swerve_drive::trust::{self, CodeArgs};
use swerve_scenario::split_sets;
use swerve_stack::Setup;
use swerve_stack::config::programs::Layer;
use swerve_text::Document;

use crate::Bench;
use crate::grid::{Cell, Sets, Study};

/// Base configurations of a study.
pub(crate) struct Bases {
    /// Merged documents by their files.
    pub(crate) documents: BTreeMap<Vec<PathBuf>, Document>,
    /// Files of each configuration that name programs.
    layers: BTreeMap<Vec<PathBuf>, Vec<Layer>>,
}

impl Bases {
    /// Reads the base configurations; errors are appended to `unread`.
    pub(crate) fn read(study: &Study, unread: &mut Vec<String>) -> Self {
        let mut bases = Self { documents: BTreeMap::new(), layers: BTreeMap::new() };
        for files in study.configs() {
            let missing = files.iter().find_map(|path| Some((path, Kind::Config.text(path).err()?)));
            let read = match missing {
                Some((path, problem)) => Err(study.unread(path, problem)),
                None => Kind::Config.layers(&files),
            };
            match read {
                Ok((document, layers)) => {
                    bases.documents.insert(files.clone(), document);
                    bases.layers.insert(files, layers);
                }
                Err(problem) => unread.push(problem.to_string()),
            }
        }
        unread.dedup();
        bases
    }
}

/// Consent to run the programs of a study.
#[derive(Default)]
pub(crate) struct StudyConsent {
    /// Consent of the user to all of them.
    code: CodeArgs,
    /// Assignments from the command line, given by the user.
    given: Sets,
}

impl StudyConsent {
    /// Consent for a study with these command-line assignments.
    pub(crate) fn of(given: Sets) -> Self {
        Self { given, ..Self::default() }
    }

    /// Allows a cell's configuration to start the programs named in the user's own files and on the command line.
    fn apply(&self, config: &mut Setup, (study, sets): (&Study, &Sets), layers: Vec<Layer>) {
        let of_study: Sets = sets.iter().filter(|set| !self.given.contains(set)).cloned().collect();
        let mut layers = layers;
        layers.push(Layer::of_sets(&study.file, &of_study, study.doubt.clone()));
        layers.push(Layer::of_sets("--set", &self.given, None));
        config.trust(&layers);
        self.code.apply(config);
    }
}

impl Bench {
    /// Applies the user's consent, if given, to all programs that the study's files name.
    #[must_use]
    pub fn with_code(mut self, code: CodeArgs) -> Self {
        self.consent.code = code;
        self
    }

    pub(crate) fn trust(&self, config: &mut Setup, cell: &Cell) {
        if config.programs().next().is_some() {
            let layers = self.bases.layers.get(&cell.config).cloned().unwrap_or_default();
            self.consent.apply(config, (&self.study, &cell.sets), layers);
        }
    }

    /// Programs that cells start, one per line: those of the base configurations, with the study's assignments.
    pub fn programs(&self) -> BTreeSet<String> {
        let names = |sets: &Sets| sets.iter().any(|(key, _)| key.starts_with("process"));
        let steps = self.study.steps.iter().flatten().map(|step| &step.sets).filter(|sets| names(sets));
        let none = Sets::new();
        let all = std::iter::once(&none).chain(steps).map(|sets| [&self.study.base[..], sets].concat());
        let of = |sets: Sets, files: &Vec<PathBuf>, base: &Document| {
            let (_, sets) = split_sets(&sets);
            let Ok(mut config) = Setup::from_document_with(&self.registry, base, &sets) else {
                return Vec::new();
            };
            let layers = self.bases.layers.get(files).cloned().unwrap_or_default();
            self.consent.apply(&mut config, (&self.study, &sets), layers);
            trust::programs_with_doubts(&config)
        };
        let is_named = !self.bases.layers.values().all(Vec::is_empty);
        let all = all.filter(|sets| is_named || names(sets));
        let bases = &self.bases.documents;
        all.flat_map(|sets| bases.iter().flat_map(move |(files, base)| of(sets.clone(), files, base)))
            .collect()
    }

    /// Refuses a study with a program that the user has not consented to, before the first cell runs.
    ///
    /// # Errors
    /// If a cell is refused; the error lists the refusals of the first such cell.
    pub fn refuse_programs(&self) -> anyhow::Result<()> {
        let named = self.bases.layers.values().any(|layers| !layers.is_empty());
        let sets = |cell: &Cell| cell.sets.iter().any(|(key, _)| key.starts_with("process"));
        for cell in self.study.cells.iter().filter(|cell| named || sets(cell)) {
            let config = self.config(cell)?;
            trust::check(&config, config.process.keys())?;
        }
        Ok(())
    }
}
