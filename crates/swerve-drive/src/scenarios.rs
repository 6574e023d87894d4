//! `swerve scenarios`: lists scenarios.

use std::path::{Path, PathBuf};

use swerve_report::output::align;
use swerve_scenario::Scenario;

use crate::read_scenario;
use crate::shipped::Kind;

/// Default folder of scenarios.
const FOLDER: &str = "scenarios";

/// `swerve scenarios`.
#[derive(clap::Args, Debug)]
pub struct ScenariosArgs {
    /// Folder of scenario files [default: scenarios, if it exists]
    folder: Option<PathBuf>,
}

/// Lists the scenarios of a folder, then the built-in ones, each with its description.
pub fn run(args: &ScenariosArgs) -> anyhow::Result<()> {
    let folder = match &args.folder {
        Some(folder) => Some(folder.as_path()),
        None => Some(Path::new(FOLDER)).filter(|folder| folder.is_dir()),
    };
    let mut lines = Vec::new();
    if let Some(folder) = folder {
        for path in swerve_report::files::toml_files(folder)? {
            lines.push(line(path.display().to_string(), &read_scenario(&path)?));
        }
        anyhow::ensure!(!lines.is_empty(), "{}: no .toml file in this folder", folder.display());
    }
    for (name, file) in Kind::Scenario.all() {
        lines.push(line(name.to_owned(), &file.scenario()?));
    }
    swerve_report::output::print(&left(&lines))
}

/// Argument that selects a scenario, and its description.
fn line(typed: String, scenario: &Scenario) -> [String; 2] {
    [typed, scenario.description.lines().next().unwrap_or_default().to_owned()]
}

fn left(lines: &[[String; 2]]) -> String {
    // `align` right-aligns the last column; sentences read better left-aligned.
    let names: Vec<Vec<String>> = lines.iter().map(|[name, _]| vec![name.clone()]).collect();
    let width = align(&names).lines().map(|l| l.chars().count()).max().unwrap_or(0);
    lines.iter().map(|[name, about]| format!("{name:width$}  {about}\n")).collect()
}
