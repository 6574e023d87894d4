//! Base configurations of a study, and consent to the programs that they name.

use std::collections::BTreeMap;
use std::path::PathBuf;

use swerve_drive::shipped::Kind;
use swerve_drive::trust::CodeArgs;
use swerve_stack::Setup;
use swerve_stack::config::programs::Layer;
use swerve_text::Document;

use crate::grid::{Sets, Study};

/// Base configurations of a study.
pub(crate) struct Bases {
    /// Merged documents by their files.
    pub(crate) documents: BTreeMap<Vec<PathBuf>, Document>,
    /// Files of each configuration that name programs.
    pub(crate) layers: BTreeMap<Vec<PathBuf>, Vec<Layer>>,
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
    pub(crate) code: CodeArgs,
    /// Assignments from the command line, given by the user.
    given: Sets,
}

impl StudyConsent {
    /// Consent for a study with these command-line assignments.
    pub(crate) fn of(given: Sets) -> Self {
        Self { given, ..Self::default() }
    }

    /// Allows a cell's configuration to start the programs named in the user's own files and on the command line.
    pub(crate) fn apply(&self, config: &mut Setup, (study, sets): (&Study, &Sets), layers: Vec<Layer>) {
        let of_study: Sets = sets.iter().filter(|set| !self.given.contains(set)).cloned().collect();
        let mut layers = layers;
        layers.push(Layer::of_sets(&study.file, &of_study, study.doubt.clone()));
        layers.push(Layer::of_sets("--set", &self.given, None));
        config.trust(&layers);
        self.code.apply(config);
    }
}
