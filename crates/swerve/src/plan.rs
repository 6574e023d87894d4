//! `swerve plan`: runs planners on posed problems, without a simulated world.
//!
//! A problem file is JSON: `configs` with named settings per planner, `problems` per planner (see
//! [`swerve_pylot::posed`]); other keys are ignored. Every problem is solved with one of the configurations. Planners
//! without an entry in the file's format solve the road problems, those of `fot`, with the settings of a drive. The
//! output is a table or JSON, and a picture of each problem.

mod picture;
mod read;
mod solve;
#[cfg(test)]
mod tests;

use std::path::PathBuf;

use anyhow::{Context as _, bail, ensure};
use clap::ValueEnum;
use swerve_drive::overwrite::OverwriteArgs;
use swerve_drive::pictures::PictureArgs;
use swerve_pylot::Preset;
use swerve_pylot::posed::{CLEARANCE_CAP_M, ProblemFile, Solution};
use swerve_report::files::write_whole;
use swerve_report::output::{self, align, quoted};
use swerve_report::page::{Figures, Page};
use swerve_stack::Registry;

pub use read::{Named, Posed, read};
pub use solve::{REPEATS, solve_all};

/// Planner with problems of its format.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum PosedPlanner {
    /// Frenet optimal trajectory
    Fot,
    /// RRT*
    RrtStar,
    /// Hybrid A*
    HybridAstar,
}

impl PosedPlanner {
    /// Planner of this name.
    fn named(name: &str) -> Option<Self> {
        Self::value_variants().iter().copied().find(|planner| planner.name() == name)
    }

    /// Name in problem files and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fot => "fot",
            Self::RrtStar => "rrt_star",
            Self::HybridAstar => "hybrid_astar",
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
#[value(rename_all = "snake_case")]
enum PresetName {
    Paper,
    Best,
}

/// `swerve plan`.
#[derive(clap::Args, Debug)]
pub struct PlanArgs {
    /// Problem file (JSON), or the name of a built-in one: detour
    file: PathBuf,
    /// Planner: fot, rrt_star, hybrid_astar with problems of their formats; any other that planning.planner can name
    /// solves the problems of fot
    #[arg(long, value_name = "NAME")]
    planner: String,
    /// Entry of the file's `configs` for that planner, as in planning.discretisation: fast, slow
    #[arg(long, value_name = "NAME")]
    discretisation: String,
    /// Set a key of the configuration, for planners without `configs` (planning.params.KEY=VALUE)
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Limits and behaviour: paper (the original's) or best (Swerve's)
    #[arg(long, value_enum, default_value = "best")]
    preset: PresetName,
    /// Print one JSON array and nothing else
    #[arg(long)]
    json: bool,
    /// Write a picture of each problem into this folder
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    #[command(flatten)]
    how: PictureArgs,
    /// Write an HTML page with the table and all pictures to this file
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteArgs,
}

/// Runs `swerve plan`.
///
/// # Errors
/// If the file cannot be read or is not a problem file (with file and line), if it has no such configuration (with the
/// nearest name) or no problem for the planner, if a number of a problem or of its settings is out of range (reported
/// after the other problems are solved and printed), or if a picture cannot be written.
pub fn run(args: &PlanArgs, registry: &Registry) -> anyhow::Result<()> {
    let preset = match args.preset {
        PresetName::Paper => Preset::Paper,
        PresetName::Best => Preset::Best,
    };
    let file = read(&args.file)?;
    let config;
    let posed = match PosedPlanner::named(&args.planner) {
        Some(planner) => {
            ensure!(
                args.set.is_empty(),
                "--set: {} takes its settings from the file's `configs`",
                args.planner
            );
            read::select(&file, planner, &args.discretisation)
        }
        None => {
            config = read::config(args, registry)?;
            read::on_road(&file, &config, &args.discretisation).map(Posed::Named)
        }
    };
    let posed = posed.with_context(|| args.file.display().to_string())?;
    args.overwrite.check(args.report.as_deref())?;
    let solutions = solve_all(&file, &posed, preset);
    if let Some(folder) = &args.pictures {
        std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
        for (k, solution) in solutions.iter().enumerate() {
            let picture = picture::draw(&file, &posed, k, solution);
            let file = folder.join(args.how.name(&picture_name(k, &solution.id)));
            args.overwrite.check([file.as_path()])?;
            args.how.write_in(folder, &picture_name(k, &solution.id), &picture)?;
        }
    }
    if let Some(path) = &args.report {
        write_whole(path, page(args, (&file, &posed), &solutions).html().as_bytes())?;
    }
    let text =
        if args.json { serde_json::to_string_pretty(&solutions)? + "\n" } else { table(args, &solutions) };
    output::print(&text)?;
    let invalid: Vec<&Solution> = solutions.iter().filter(|solution| solution.invalid).collect();
    match invalid.first() {
        None => Ok(()),
        Some(first) => bail!(
            "{}: {} of {} problems have a number that is out of range, the first is `{}`: {}",
            args.file.display(),
            invalid.len(),
            solutions.len(),
            first.id,
            first.reason
        ),
    }
}

/// File name of a problem's picture; characters unsafe in file names are replaced.
fn picture_name(k: usize, id: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    format!("{k:03}_{}", id.chars().map(plain).collect::<String>())
}

fn page(args: &PlanArgs, (file, posed): (&ProblemFile, &Posed<'_>), solutions: &[Solution]) -> Page<Figures> {
    let (planner, config, path) = (&args.planner, &args.discretisation, args.file.display().to_string());
    let preset = if args.preset == PresetName::Paper { " --preset paper" } else { "" };
    let sets: String = args.set.iter().map(|set| format!(" --set {}", quoted(set))).collect();
    let picture = |(k, s): (usize, &Solution)| (s.id.clone(), picture::draw(file, posed, k, s).svg());
    let figures = Figures {
        command: format!(
            "swerve plan {} --planner {} --discretisation {}{preset}{sets}",
            quoted(&path),
            quoted(planner),
            quoted(config)
        ),
        columns: COLUMNS.map(str::to_owned).to_vec(),
        rows: solutions.iter().map(row).collect(),
        pictures: solutions.iter().enumerate().map(picture).collect(),
    };
    Page::new("figures", format!("{planner} {config}: {path}"), figures)
}

const COLUMNS: [&str; 8] = ["problem", "ms", "work", "length m", "cost", "clearance m", "curvature 1/m", ""];

fn row(s: &Solution) -> Vec<String> {
    let number = |x: f64, digits: usize| if s.found { format!("{x:.digits$}") } else { "-".into() };
    vec![
        s.id.clone(),
        format!("{:.3}", s.time_ms),
        s.work.to_string(),
        number(s.length_m, 2),
        number(s.cost, 2),
        if s.clearance_m < CLEARANCE_CAP_M { number(s.clearance_m, 2) } else { "-".into() },
        number(s.curvature_max, 3),
        s.reason.clone(),
    ]
}

fn table(args: &PlanArgs, solutions: &[Solution]) -> String {
    let mut lines = vec![COLUMNS.map(str::to_owned).to_vec()];
    lines.extend(solutions.iter().map(row));
    let mut times: Vec<f64> = solutions.iter().map(|s| s.time_ms).collect();
    times.sort_by(f64::total_cmp);
    // Nearest-rank percentile.
    let at = |share: f64| times[((times.len() as f64 * share).ceil() as usize).max(1) - 1];
    let found = solutions.iter().filter(|s| s.found).count();
    format!(
        "{}{} {}: {found} of {} solved, p50 {:.3} ms, p99 {:.3} ms (each call: the best of {REPEATS})\n",
        align(&lines),
        args.planner,
        args.discretisation,
        solutions.len(),
        at(0.5),
        at(0.99),
    )
}
