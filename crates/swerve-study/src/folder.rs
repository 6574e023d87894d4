//! The folder that a study writes into: one in which nobody else's results are.

use std::path::{Path, PathBuf};

use anyhow::bail;
use serde_json::Value;
use swerve_core::{Digest, Hasher};
use swerve_drive::page::REPORT;
use swerve_report::files::{CELLS, folder_of, is_unchanged};
use swerve_report::page::data_of;
use swerve_text::{FILE_MAX, read_string};

use crate::grid::Study;

/// Files of a study's folder.
const FILES: [&str; 4] = [REPORT, "cells.csv", "commands.txt", "heatmap.svg"];

/// The folder that is asked for, where what an earlier call of the study left, as it is now or was before an edit, is
/// gone on from; or else one of its own beside those of others of its name, which go on in theirs.
///
/// # Errors
/// A run or another study has written there.
pub(crate) fn of(study: &Study, asked: Option<&Path>) -> anyhow::Result<PathBuf> {
    let Some(folder) = asked.map(Path::to_path_buf) else {
        return folder_of(&identity(study).to_string(), &study.name);
    };
    let shown = folder.display();
    if folder.join("metrics.json").exists() {
        bail!("{shown}: the results of a run are there: expected another --out");
    }
    let is_there = |name: &&&str| folder.join(name).symlink_metadata().is_ok();
    let written_by = written_by(&folder);
    let is_kept = folder.join(CELLS).is_dir();
    for name in FILES.iter().filter(is_there) {
        match is_unchanged(&folder.join(name)) {
            Some(true) if is_kept => {}
            Some(false) => bail!("{shown}: {name} was changed since it was written: expected another --out"),
            // A file system without attributes, or a copy: the page names its study.
            None if is_kept && written_by.is_some() => {}
            _ => bail!("{shown}: {name} is there, and is of no study: expected another --out"),
        }
    }
    match written_by {
        Some(name) if name != study.name => {
            bail!("{shown}: the results of another study, `{name}`, are there: expected another --out")
        }
        _ => Ok(folder),
    }
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
