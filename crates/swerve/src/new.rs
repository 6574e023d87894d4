//! `swerve new`: a folder to begin in.

use std::path::PathBuf;

use anyhow::Context as _;
use swerve_drive::shipped::{Shipped, shipped};

/// `swerve new`.
#[derive(clap::Args, Debug)]
pub(crate) struct NewArgs {
    /// The folder: one that is not there yet, or is empty
    folder: PathBuf,
}

/// What a new folder holds: every file of `template/`.
static TEMPLATE: &[Shipped] = shipped! { "../template":
    "README.md"
    "config.toml"
    "scenario.toml"
};

/// Makes the folder.
///
/// # Errors
/// There is something in it already, or it cannot be written.
pub(crate) fn run(args: &NewArgs) -> anyhow::Result<()> {
    let folder = &args.folder;
    let making = || format!("making {}", folder.display());
    std::fs::create_dir_all(folder).with_context(making)?;
    let first = std::fs::read_dir(folder).with_context(making)?.next();
    anyhow::ensure!(
        first.is_none(),
        "{}: expected a folder that is empty, or not there yet",
        folder.display()
    );
    for file in TEMPLATE {
        let path = folder.join(file.path);
        let inside = path.parent().unwrap_or(folder);
        std::fs::create_dir_all(inside).with_context(making)?;
        swerve_report::files::write_whole(&path, file.text.as_bytes())?;
    }
    let names: Vec<&str> = TEMPLATE.iter().map(|file| file.path).collect();
    let shown = folder.display();
    swerve_report::output::print(&format!(
        "{shown}: {}\n\n  cd {shown}\n  swerve run scenario.toml -c config.toml\n",
        names.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn every_file_of_the_template_is_in_the_program() {
        fn files(folder: &Path, found: &mut Vec<PathBuf>) {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() { files(&path, found) } else { found.push(path) }
            }
        }
        let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/template"));
        let mut there = Vec::new();
        files(root, &mut there);
        there.sort();
        let listed: Vec<PathBuf> = TEMPLATE.iter().map(|file| root.join(file.path)).collect();
        assert_eq!(listed, there, "the list in new.rs is not that of the folder");
    }
}
