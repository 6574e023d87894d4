//! Reading of problem files and selection of a configuration.

use std::path::Path;

use anyhow::bail;
use clap::ValueEnum as _;
use swerve_drive::shipped::Kind;
use swerve_pylot::posed::{FotConfig, HybridAstarConfig, ProblemFile, RrtStarConfig};
use swerve_text::{did_you_mean, from_json, list};

use super::PosedPlanner;

/// A planner with one of the file's configurations.
#[derive(Clone, Copy, Debug)]
pub enum Posed<'a> {
    /// Frenet optimal trajectory.
    Fot(&'a FotConfig),
    /// RRT*.
    RrtStar(&'a RrtStarConfig),
    /// Hybrid A*.
    HybridAstar(&'a HybridAstarConfig),
}

/// Reads a problem file by its path, or by the name of a built-in one.
///
/// # Errors
/// If it cannot be read or is not a problem file, with file, line and what was expected.
pub fn read(path: &Path) -> anyhow::Result<ProblemFile> {
    Ok(from_json(&path.display().to_string(), &Kind::Problems.text(path)?)?)
}

/// Selects the planner's configuration of this name.
pub(super) fn select<'a>(
    file: &'a ProblemFile,
    planner: PosedPlanner,
    name: &str,
) -> anyhow::Result<Posed<'a>> {
    use PosedPlanner::{Fot, HybridAstar, RrtStar};
    let (configs, problems) = (&file.configs, &file.problems);
    let posed = match planner {
        Fot => configs.fot.get(name).map(Posed::Fot),
        RrtStar => configs.rrt_star.get(name).map(Posed::RrtStar),
        HybridAstar => configs.hybrid_astar.get(name).map(Posed::HybridAstar),
    };
    let names = |planner| -> Vec<&str> {
        match planner {
            Fot => configs.fot.keys().map(String::as_str).collect(),
            RrtStar => configs.rrt_star.keys().map(String::as_str).collect(),
            HybridAstar => configs.hybrid_astar.keys().map(String::as_str).collect(),
        }
    };
    let count = |planner| match planner {
        Fot => problems.fot.len(),
        RrtStar => problems.rrt_star.len(),
        HybridAstar => problems.hybrid_astar.len(),
    };
    let own = planner.name();
    let Some(posed) = posed else {
        let known = names(planner);
        let found = match known.is_empty() {
            true => others(|planner| !names(planner).is_empty()),
            false => format!("expected one of {}{}", list(&known), did_you_mean(name, known.iter().copied())),
        };
        bail!("configs.{own}: no entry `{name}`: {found}");
    };
    if count(planner) == 0 {
        bail!("problems.{own}: no problem for this planner: {}", others(|planner| count(planner) > 0));
    }
    Ok(posed)
}

/// Lists the other planners for which the file has the missing entry.
fn others(has: impl Fn(PosedPlanner) -> bool) -> String {
    let all = PosedPlanner::value_variants().iter().copied();
    let names: Vec<&str> = all.filter(|planner| has(*planner)).map(PosedPlanner::name).collect();
    match names.is_empty() {
        true => "the file has none for any planner".to_owned(),
        false => format!("the file has some for {}", list(&names)),
    }
}
