//! The folder that a study writes into: one in which nobody else's results are.

use std::path::{Path, PathBuf};

use anyhow::bail;
use serde_json::Value;
use swerve_core::{Digest, Hasher};
use swerve_drive::page::REPORT;
use swerve_report::files::{CELLS, folder_of, is_unchanged, owner_of, set_owner};
use swerve_report::page::data_of;
use swerve_text::{FILE_MAX, read_string};

use crate::grid::Study;

/// Files of a study's folder.
const FILES: [&str; 4] = [REPORT, "cells.csv", "commands.txt", "heatmap.svg"];

/// Where the results of a study go.
#[derive(clap::Args, Clone, Default, Debug)]
pub(crate) struct OutArgs {
    /// Output folder [default: one of its own, out/NAME-1 and so on, where a suite has the name suite; out/NAME leads to the
    /// newest]
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
    /// Replace the results of another study in the folder of --out; finished cells that are the same are kept
    #[arg(long, requires = "out")]
    pub(crate) overwrite: bool,
}

/// Way out of a refusal.
const EXPECTED: &str = "expected another --out, or --overwrite";

impl OutArgs {
    /// The folder that is asked for, in which an interrupted call of the same study continues; without one, a folder of
    /// its own beside those of other studies of the name.
    ///
    /// # Errors
    /// A run or another study has written there, or the folder holds other files.
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

/// Refuses a folder with results of another study, and with files that are of no study or were changed.
fn refuse_others(folder: &Path, study: &Study, identity: &str) -> anyhow::Result<()> {
    let shown = folder.display();
    let is_there = |name: &&&str| folder.join(name).symlink_metadata().is_ok();
    let written_by = written_by(folder);
    let is_kept = folder.join(CELLS).is_dir();
    for name in FILES.iter().filter(is_there) {
        match is_unchanged(&folder.join(name)) {
            Some(true) if is_kept => {}
            Some(false) => bail!("{shown}: {name} was changed since it was written: {EXPECTED}"),
            // A file system without attributes, or a copy: the page names its study.
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

/// What makes it this study and no other of its name: its axes, what its cells drive and what is measured there. How that
/// is drawn and summed up is none of it.
fn identity(study: &Study) -> Digest {
    let mut hasher = Hasher::new();
    let measured = (&study.axes, &study.budget, &study.curve, &study.timely);
    hasher.bytes(format!("{measured:?}").as_bytes());
    for cell in &study.cells {
        hasher.value(&(&cell.labels, study.command(cell)));
    }
    hasher.digest()
}

/// The name of the study whose page lies in a folder.
fn written_by(folder: &Path) -> Option<String> {
    let page = read_string(&folder.join(REPORT), FILE_MAX).ok()?;
    let page: Value = serde_json::from_str(data_of(&page)?).ok()?;
    let name = match page["kind"].as_str()? {
        "study" => page["name"].as_str()?.into(),
        // That of a study that draws over time has its command line alone.
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
    fn a_page_tells_whose_it_is() {
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
