//! Files with which editors check configuration files while they are edited.

use std::path::Path;

use anyhow::Context as _;
use swerve_report::files::write_whole;
use swerve_stack::Registry;

use crate::FileKind;

/// Taplo configuration that assigns a kind to each file; editors find it in the opened folder.
const EDITOR: &str = r#"# Editors with Taplo (`Even Better TOML` in VS Code) check the text and describe each key. The schemas are those
# of `swerve keys --schema config` and the like: made anew by it after an update.
[[rule]]
include = ["scenario*.toml", "scenarios/*.toml"]
schema = { path = ".schemas/scenario.json", enabled = true }

[[rule]]
include = ["config*.toml", "own.toml", "configs/*.toml"]
schema = { path = ".schemas/config.json", enabled = true }

[[rule]]
include = ["study*.toml", "studies/*.toml"]
schema = { path = ".schemas/study.json", enabled = true }

[[rule]]
include = ["timing*.toml", "timing/*.toml"]
schema = { path = ".schemas/timing.json", enabled = true }
"#;

/// Writes the editor files into a folder: the kinds of its files, and their schemas with the names of the registry.
///
/// # Errors
/// If they cannot be written.
pub fn write_for_editors(folder: &Path, registry: &Registry) -> anyhow::Result<()> {
    let schemas = folder.join(".schemas");
    std::fs::create_dir_all(&schemas).with_context(|| format!("making {}", schemas.display()))?;
    for kind in FileKind::ALL {
        let text = serde_json::to_string_pretty(&kind.schema(registry))? + "\n";
        write_whole(&schemas.join(format!("{}.json", kind.name())), text.as_bytes())?;
    }
    write_whole(&folder.join(".taplo.toml"), EDITOR.as_bytes())
}
