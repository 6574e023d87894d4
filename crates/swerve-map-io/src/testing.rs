//! Files for tests of readers: a sound file that is changed, published files.

use std::path::{Path, PathBuf};

use proptest::prelude::ProptestConfig;
use proptest::test_runner::RngSeed;

use crate::Problems;

/// Rows of a text of the file, its replacement, and a part of the problems.
pub(crate) type Changes = [(&'static str, &'static str, &'static str)];

/// A sound file and its reader, which returns the defects of a file that it reads.
pub(crate) struct Sound {
    pub(crate) text: &'static str,
    pub(crate) read: fn(&str) -> Result<Problems, Problems>,
}

impl Sound {
    /// Faults and defects after one change; those of a file that is read begin with `read`.
    pub(crate) fn problems(&self, from: &str, to: &str) -> String {
        assert!(self.text.contains(from), "{from}");
        match (self.read)(&self.text.replacen(from, to, 1)) {
            Ok(defects) => format!("read\n{defects}"),
            Err(problems) => problems.to_string(),
        }
    }

    /// Each change makes the file one that is not read.
    pub(crate) fn assert_faults(&self, changes: &Changes) {
        self.assert(changes, false);
    }

    /// The file is read after each change, with a defect.
    pub(crate) fn assert_defects(&self, changes: &Changes) {
        self.assert(changes, true);
    }

    fn assert(&self, changes: &Changes, is_read: bool) {
        let wrong = changes.iter().filter_map(|(from, to, expected)| {
            let found = self.problems(from, to);
            let holds = found.starts_with("read\n") == is_read && found.contains(expected);
            (!holds).then(|| format!("{from} -> {to}:\n{found}\nexpected {expected}\n"))
        });
        let wrong: Vec<String> = wrong.collect();
        assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    }
}

/// The text with the value of its `at`-th attribute replaced; `None` without attributes.
pub(crate) fn with_value(text: &str, at: usize, value: &str) -> Option<String> {
    let quotes: Vec<usize> = text.match_indices('"').map(|(k, _)| k).collect();
    let k = at.checked_rem(quotes.len() / 2)?;
    Some(format!("{}{value}{}", &text[..=quotes[2 * k]], &text[quotes[2 * k + 1]..]))
}

/// 400 cases that are the same in each run.
pub(crate) fn cases() -> ProptestConfig {
    ProptestConfig { rng_seed: RngSeed::Fixed(1), cases: 400, ..ProptestConfig::default() }
}

/// Folder of the maps of scenarios.
pub(crate) fn scenario_maps() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/maps")
}

/// All OpenDRIVE files below a folder, in order.
pub(crate) fn networks(folder: &Path) -> Vec<PathBuf> {
    below(folder, &[".xodr"])
}

/// All files below a folder whose names end in one of `endings`, in order.
pub(crate) fn below(folder: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(below(&path, endings));
        } else if endings.iter().any(|ending| path.to_string_lossy().ends_with(ending)) {
            found.push(path);
        }
    }
    found.sort();
    found
}
