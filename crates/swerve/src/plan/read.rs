//! A problem file, and what is asked of it.

use std::path::Path;

use anyhow::{Context as _, anyhow, bail};
use swerve_pylot::posed::{FotConfig, HybridAstarConfig, ProblemFile, RrtStarConfig};
use swerve_text::{nearest, with_nearest_name};

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

/// Reads a problem file.
///
/// # Errors
/// When it cannot be read, or is no problem file: file, line, and what was expected.
pub fn read(path: &Path) -> anyhow::Result<ProblemFile> {
    let file = path.display();
    let text = std::fs::read_to_string(path).with_context(|| format!("{file}: cannot be read"))?;
    serde_json::from_str(&text).map_err(|error| {
        let message = error.to_string();
        let place = format!(" at line {} column {}", error.line(), error.column());
        let message = message.strip_suffix(&place).unwrap_or(&message);
        anyhow!("{file}:{}: {}", error.line().max(1), with_nearest_name(message))
    })
}

/// The configuration of this name.
pub(super) fn select<'a>(
    file: &'a ProblemFile,
    planner: PosedPlanner,
    name: &str,
) -> anyhow::Result<Posed<'a>> {
    let (configs, problems) = (&file.configs, &file.problems);
    let (posed, names, count): (_, Vec<&str>, _) = match planner {
        PosedPlanner::Fot => (
            configs.fot.get(name).map(Posed::Fot),
            configs.fot.keys().map(String::as_str).collect(),
            problems.fot.len(),
        ),
        PosedPlanner::RrtStar => (
            configs.rrt_star.get(name).map(Posed::RrtStar),
            configs.rrt_star.keys().map(String::as_str).collect(),
            problems.rrt_star.len(),
        ),
        PosedPlanner::HybridAstar => (
            configs.hybrid_astar.get(name).map(Posed::HybridAstar),
            configs.hybrid_astar.keys().map(String::as_str).collect(),
            problems.hybrid_astar.len(),
        ),
    };
    let planner = planner.name();
    let Some(posed) = posed else {
        let near = nearest(name, names.iter().copied());
        let hint = near.map_or_else(String::new, |near| format!(" (did you mean `{near}`?)"));
        bail!("configs.{planner}: no entry `{name}`, there are {}{hint}", names.join(", "));
    };
    if count == 0 {
        bail!("problems.{planner}: no problem for this planner");
    }
    Ok(posed)
}
