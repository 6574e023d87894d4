//! Output folder of a study, checked against overwriting other results.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use anyhow::bail;
use serde_json::Value;
use swerve_core::{Digest, Hasher};
use swerve_drive::page::REPORT;
use swerve_report::files::{CELLS, folder_of, is_unchanged, owner_of, set_owner};
use swerve_report::page::data_of;
use swerve_text::{FILE_MAX, read_string};

use crate::grid::Study;

/// Files in a study's folder.
const FILES: [&str; 4] = [REPORT, "cells.csv", "commands.txt", "heatmap.svg"];

/// Destination of a study's results.
#[derive(clap::Args, Clone, Default, Debug)]
pub(crate) struct OutArgs {
    /// Output folder [default: a new one, out/NAME-1 and so on (out/suite-1 for a suite); out/NAME links to the newest]
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
    /// Replace the results of another study in the folder of --out; identical finished cells are kept
    #[arg(long, requires = "out")]
    pub(crate) overwrite: bool,
}

/// Hint at the end of a refusal.
const EXPECTED: &str = "expected another --out, or --overwrite";

impl OutArgs {
    /// The requested folder, in which an interrupted call of the same study continues; by default a numbered folder
    /// beside those of other studies of the same name.
    ///
    /// # Errors
    /// If a run or another study has written to the folder, or it holds other files.
    pub(crate) fn folder(&self, study: &Study) -> anyhow::Result<PathBuf> {
        let identity = identity(study).to_string();
        let Some(folder) = &self.out else { return folder_of(&identity, &study.name) };
        if folder.join("metrics.json").exists() {
            bail!("{}: the results of a run are there: expected another --out", folder.display());
        }
        if !self.overwrite {
            refuse_others(folder, study, &identity)?;
        }
        if owner_of(folder).as_deref() != Some(&identity) {
            set_owner(folder, &identity)?;
        }
        Ok(folder.clone())
    }
}

/// Claims a folder until the result is dropped, so that two studies do not drive the same cells; shards share it. A file
/// system without locks claims nothing.
///
/// # Errors
/// If another process has claimed the folder.
pub(crate) fn claim(folder: &Path, is_shard: bool) -> anyhow::Result<Option<File>> {
    let Ok(claim) = File::open(folder) else { return Ok(None) };
    match if is_shard { claim.try_lock_shared() } else { claim.try_lock() } {
        Ok(()) => Ok(Some(claim)),
        Err(TryLockError::Error(_)) => Ok(None),
        Err(TryLockError::WouldBlock) => bail!(
            "{}: another `swerve study` is driving its cells into this folder: wait for its end, or expected another --out",
            folder.display()
        ),
    }
}

/// Refuses a folder with results of another study, or with files that are not a study's or were modified.
fn refuse_others(folder: &Path, study: &Study, identity: &str) -> anyhow::Result<()> {
    let shown = folder.display();
    let is_there = |name: &&&str| folder.join(name).symlink_metadata().is_ok();
    let written_by = written_by(folder);
    let is_kept = folder.join(CELLS).is_dir();
    for name in FILES.iter().filter(is_there) {
        match is_unchanged(&folder.join(name)) {
            Some(true) if is_kept => {}
            Some(false) => bail!("{shown}: {name} was changed since it was written: {EXPECTED}"),
            // Without attributes, as on some file systems or in a copy, the page identifies its study.
            None if is_kept && written_by.is_some() => {}
            _ => bail!("{shown}: {name} is there, and is of no study: {EXPECTED}"),
        }
    }
    if let Some(name) = written_by.filter(|name| *name != study.name) {
        bail!("{shown}: the results of another study, `{name}`, are there: {EXPECTED}");
    }
    if is_kept && owner_of(folder).is_some_and(|owner| owner != identity) {
        let name = &study.name;
        bail!(
            "{shown}: the results of another study `{name}` are there, with other axes, another base or another --set: \
             {EXPECTED}"
        );
    }
    Ok(())
}

/// Digest that distinguishes studies of the same name: axes, cells and measurements, but not how these are drawn and
/// summarised.
fn identity(study: &Study) -> Digest {
    let mut hasher = Hasher::new();
    let measured = (&study.axes, &study.budget, &study.curve, &study.timely);
    hasher.bytes(format!("{measured:?}").as_bytes());
    for cell in &study.cells {
        hasher.value(&(&cell.labels, study.command(cell)));
    }
    hasher.digest()
}

/// Name of the study whose page is in a folder.
fn written_by(folder: &Path) -> Option<String> {
    let page = read_string(&folder.join(REPORT), FILE_MAX).ok()?;
    let page: Value = serde_json::from_str(data_of(&page)?).ok()?;
    let name = match page["kind"].as_str()? {
        "study" => page["name"].as_str()?.into(),
        // The page of a study with time curves has only its command line.
        _ => {
            let file = page["command"].as_str()?.strip_prefix("swerve study ")?.trim_matches('\'');
            Path::new(file).file_stem()?.to_string_lossy()
        }
    };
    Some(name.into_owned())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn folder_is_claimed_by_one_study_or_by_shards() {
        let folder = tempfile::tempdir().unwrap();
        let claim = |is_shard| claim(folder.path(), is_shard);
        let first = claim(false).unwrap();
        assert!(claim(false).unwrap_err().to_string().contains("another `swerve study` is driving"));
        assert!(claim(true).is_err());
        drop(first);
        let _shards = (claim(true).unwrap(), claim(true).unwrap());
        assert!(claim(false).is_err());
    }

    #[test]
    fn page_identifies_its_study() {
        let folder = tempfile::tempdir().unwrap();
        let by = |page: &Value| {
            let html = swerve_report::page::page("t", page);
            std::fs::write(folder.path().join(REPORT), html).unwrap();
            written_by(folder.path())
        };
        assert_eq!(by(&json!({ "kind": "study", "name": "planners" })).as_deref(), Some("planners"));
        for command in ["swerve study timely_speed", "swerve study 'my studies/timely_speed.toml'"] {
            let page = json!({ "kind": "figures", "command": command });
            assert_eq!(by(&page).as_deref(), Some("timely_speed"), "{command}");
        }
        assert_eq!(by(&json!({ "kind": "run", "command": "swerve run lane" })), None);
        std::fs::write(folder.path().join(REPORT), "<p>a page</p>").unwrap();
        assert_eq!(written_by(folder.path()), None);
    }
}
