//! State file in the folder of a data set, from which an interrupted call is continued.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use serde::{Deserialize, Serialize};
use swerve_report::files::write_whole;
use swerve_text::{FILE_MAX, read_string};

/// Folder of the samples.
pub(super) const SAMPLES: &str = "kitti";

/// Index file with one line per sample.
pub(crate) const INDEX: &str = "index.csv";

/// Name of the state file.
const FILE: &str = ".dataset.json";

/// Progress of a data set.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) struct State {
    /// Digest of program, configuration, scenarios, seeds and weathers.
    call: String,
    /// Number of finished drives, in the order of the call.
    pub(super) drives: usize,
    /// Number of samples of these drives.
    pub(super) samples: usize,
    /// True if all drives are finished.
    pub(super) is_complete: bool,
}

impl State {
    /// Reads the state that a call left in a folder; zero drives if the folder is empty or absent.
    ///
    /// # Errors
    /// If the folder holds other files, or the data set of another call.
    pub(super) fn open(out: &Path, call: &str) -> anyhow::Result<Self> {
        let path = file(out);
        if !path.exists() {
            let is_occupied = std::fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some());
            if is_occupied {
                bail!(
                    "{}: expected an empty folder, none, or an unfinished data set of this call",
                    out.display()
                );
            }
            let call = call.to_owned();
            return Ok(Self { call, drives: 0, samples: 0, is_complete: false });
        }
        let reading = || format!("reading {}", path.display());
        let text = read_string(&path, FILE_MAX).with_context(reading)?;
        let state: Self = serde_json::from_str(&text).with_context(reading)?;
        if state.call != call && state.samples == 0 && !out.join(SAMPLES).exists() {
            // Another call was interrupted before its first sample.
            return Ok(Self { call: call.to_owned(), ..state });
        }
        if state.call != call {
            bail!(
                "{}: holds a data set of other scenarios, seeds, weathers or settings, or of another version of the \
                 program: expected another --out",
                out.display()
            );
        }
        Ok(state)
    }

    /// Writes the state file.
    pub(super) fn write(&self, out: &Path) -> anyhow::Result<()> {
        write_whole(&file(out), (serde_json::to_string(self)? + "\n").as_bytes())
    }
}

/// True if a folder holds a complete data set.
pub(crate) fn is_complete(out: &Path) -> bool {
    // Data sets of earlier versions have no state; their index was written last.
    let state = read_string(&file(out), FILE_MAX).map(|text| serde_json::from_str::<State>(&text).ok());
    state.map_or_else(|_| out.join(INDEX).exists(), |state| state.is_some_and(|state| state.is_complete))
}

fn file(out: &Path) -> PathBuf {
    out.join(FILE)
}
