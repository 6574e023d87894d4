//! Programs that the cells of a study start.

use std::collections::BTreeSet;
use std::path::PathBuf;

use swerve_drive::trust::{self, CodeArgs};
use swerve_scenario::split_sets;
use swerve_stack::Setup;
use swerve_text::Document;

use crate::Bench;
use crate::grid::{Cell, Sets};

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
