//! The folder that a study writes into: one in which nobody else's results are.

use std::path::{Path, PathBuf};

use anyhow::bail;
use serde_json::Value;
use swerve_drive::page::REPORT;
use swerve_report::page::data_of;

use crate::grid::Study;

/// The folder that is asked for, or else that of the study's name. What an earlier call of the study left in it, as it is
/// now or was before an edit, is gone on from.
///
/// # Errors
/// A run or another study has written there.
pub(crate) fn of(study: &Study, asked: Option<&Path>) -> anyhow::Result<PathBuf> {
    let folder = asked.map_or_else(|| Path::new("out").join(&study.name), Path::to_path_buf);
    let shown = folder.display();
    if folder.join("metrics.json").exists() {
        bail!("{shown}: the results of a run are there: expected another --out");
    }
    match written_by(&folder) {
        Some(name) if name != study.name => {
            bail!("{shown}: the results of another study, `{name}`, are there: expected another --out")
        }
        _ => Ok(folder),
    }
}

/// The name of the study whose page lies in a folder.
fn written_by(folder: &Path) -> Option<String> {
    let page = std::fs::read_to_string(folder.join(REPORT)).ok()?;
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
