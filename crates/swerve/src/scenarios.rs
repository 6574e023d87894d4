//! `swerve scenarios`: what there is to drive.

use std::path::PathBuf;

use crate::output::align;

/// `swerve scenarios`.
#[derive(clap::Args, Debug)]
pub struct ScenariosArgs {
    /// Folder of scenario files
    #[arg(default_value = "scenarios")]
    folder: PathBuf,
}

/// Lists the scenarios of a folder with what they are about.
pub fn run(args: &ScenariosArgs) -> anyhow::Result<()> {
    let mut lines = Vec::new();
    for path in crate::files::toml_files(&args.folder)? {
        let scenario = crate::run::read_scenario(&path)?;
        let about = scenario.description.lines().next().unwrap_or_default().to_owned();
        lines.push(vec![path.display().to_string(), format!("  {about}")]);
    }
    anyhow::ensure!(!lines.is_empty(), "{}: no .toml file in this folder", args.folder.display());
    crate::output::print(&left(&lines))
}

fn left(lines: &[Vec<String>]) -> String {
    // `align` pads the last column to the left; sentences read better as they are.
    let names: Vec<Vec<String>> = lines.iter().map(|l| vec![l[0].clone()]).collect();
    let width = align(&names).lines().map(|l| l.chars().count()).max().unwrap_or(0);
    lines.iter().map(|l| format!("{:width$}{}\n", l[0], l[1])).collect()
}
