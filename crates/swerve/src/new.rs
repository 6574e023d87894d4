//! `swerve new`: creates a project folder.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use swerve_drive::shipped::{Shipped, shipped};
use swerve_reference::editor::write_for_editors;
use swerve_report::output::quoted;
use swerve_stack::Registry;

/// `swerve new`.
#[derive(clap::Args, Debug)]
pub(crate) struct NewArgs {
    /// Folder to create; must be empty or absent
    folder: PathBuf,
}

/// Contents of a new folder: all files of `template/`.
static TEMPLATE: &[Shipped] = shipped! { "../template":
    "README.md"
    "config.toml"
    "own.toml"
    "package.toml"
    "rust-toolchain.toml"
    "scenario.toml"
    "src/main.rs"
    "src/slow_down.rs"
};

/// Creates the folder.
///
/// # Errors
/// If the folder is not empty or cannot be written.
pub(crate) fn run(args: &NewArgs, registry: &Registry) -> anyhow::Result<()> {
    let folder = &args.folder;
    let making = || format!("making {}", folder.display());
    std::fs::create_dir_all(folder).with_context(making)?;
    let first = std::fs::read_dir(folder).with_context(making)?.next();
    anyhow::ensure!(
        first.is_none(),
        "{}: expected a folder that is empty, or not there yet",
        folder.display()
    );
    let checkout =
        Path::new(env!("CARGO_MANIFEST_DIR")).parent().filter(|crates| crates.join("swerve").is_dir());
    for file in TEMPLATE {
        let path = folder.join(name(file));
        let inside = path.parent().unwrap_or(folder);
        std::fs::create_dir_all(inside).with_context(making)?;
        let text = file.text.replace("# SWERVE\n", &dependencies(checkout));
        swerve_report::files::write_whole(&path, text.as_bytes())?;
    }
    write_for_editors(folder, registry)?;
    let names: Vec<&str> = TEMPLATE.iter().map(name).collect();
    let shown = folder.display();
    swerve_report::output::print(&format!(
        "{shown}: {}\n\n  cd {}\n  swerve run scenario.toml -c config.toml\n  cargo run --release -- run scenario.toml -c own.toml\n",
        names.join(", "),
        quoted(&shown.to_string())
    ))
}

/// Name of a template file in a new folder. A manifest named `Cargo.toml` in the template would be taken for a package.
fn name(file: &Shipped) -> &'static str {
    if file.path == "package.toml" { "Cargo.toml" } else { file.path }
}

/// Dependency lines for the template's operator: paths into the checkout that this program was built from, if it still
/// exists.
fn dependencies(checkout: Option<&Path>) -> String {
    const CRATES: [&str; 6] =
        ["swerve", "swerve-core", "swerve-flow", "swerve-msg", "swerve-planning", "swerve-stack"];
    let from = |name: &str| match checkout {
        Some(crates) => format!("path = {}", toml::Value::from(crates.join(name).display().to_string())),
        None => format!("git = \"{}\"", env!("CARGO_PKG_REPOSITORY")),
    };
    let lines = CRATES.map(|name| format!("{name} = {{ {} }}\n", from(name)));
    let comment = match checkout {
        Some(_) => "",
        None => {
            "# Where Swerve is: `path = \"CHECKOUT/crates/NAME\"` in the place of `git` builds against a checkout of yours.\n"
        }
    };
    format!("{comment}{}", lines.concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn package_dependencies_point_to_a_checkout_or_state_what_to_set() {
        let read = |text: String| text.parse::<toml::Table>().unwrap();
        let here = read(dependencies(Some(Path::new("/a b/crates"))));
        assert_eq!(here["swerve-flow"]["path"].as_str(), Some("/a b/crates/swerve-flow"));
        let elsewhere = dependencies(None);
        assert!(elsewhere.starts_with("# Where Swerve is"), "{elsewhere}");
        assert!(read(elsewhere)["swerve"]["git"].as_str().unwrap().starts_with("https://"));
    }

    #[test]
    fn new_folder_builds_with_the_compiler_of_swerve() {
        let channel = |text: &str| text.parse::<toml::Table>().unwrap()["toolchain"]["channel"].to_string();
        let ours = channel(include_str!("../../../rust-toolchain.toml"));
        assert_eq!(channel(include_str!("../template/rust-toolchain.toml")), ours);
    }

    #[test]
    fn every_template_file_is_built_in() {
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
