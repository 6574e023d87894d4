//! Reading of problem files and selection of a configuration.

use std::path::Path;

use anyhow::{bail, ensure};
use clap::ValueEnum as _;
use swerve_drive::problems_error;
use swerve_drive::shipped::Kind;
use swerve_planning::Planner;
use swerve_pylot::posed::{FotConfig, HybridAstarConfig, ProblemFile, RrtStarConfig};
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_stack::config::Fineness;
use swerve_text::{did_you_mean, from_json, list, parse_assignments};

use super::{PlanArgs, PosedPlanner, PresetName};

/// A planner with one of the file's configurations.
#[derive(Clone, Copy, Debug)]
pub enum Posed<'a> {
    /// Frenet optimal trajectory.
    Fot(&'a FotConfig),
    /// RRT*.
    RrtStar(&'a RrtStarConfig),
    /// Hybrid A*.
    HybridAstar(&'a HybridAstarConfig),
    /// Another planner of the registry.
    Named(Named<'a>),
}

/// A planner of the registry on road problems.
#[derive(Clone, Copy, Debug)]
pub struct Named<'a> {
    config: &'a Setup,
    /// Width of the road.
    pub(super) road: Option<&'a FotConfig>,
}

impl Named<'_> {
    /// Builds the planner; the configuration was checked.
    ///
    /// # Panics
    /// If its parameters are out of range.
    pub(super) fn planner(&self) -> Box<dyn Planner> {
        let (planning, registry) = (&self.config.planning, &self.config.registry);
        planning.planner(registry).expect("the configuration was checked")
    }
}

/// Configuration that names the planner of the command line, without a comfort layer.
pub(super) fn config(args: &PlanArgs, registry: &Registry) -> anyhow::Result<Setup> {
    let planners: Vec<&str> = registry.planners().collect();
    ensure!(
        planners.contains(&args.planner.as_str()),
        "--planner: expected one of {}, found \"{}\"{}",
        list(&planners),
        args.planner,
        did_you_mean(&args.planner, planners.iter().copied())
    );
    let fineness = [Fineness::Fast, Fineness::Slow].map(Fineness::as_str);
    let name = args.discretisation.as_str();
    ensure!(
        fineness.contains(&name),
        "--discretisation: expected one of {} for {}, found \"{name}\"{}",
        list(&fineness),
        args.planner,
        did_you_mean(name, fineness)
    );
    let preset = if args.preset == PresetName::Paper { "paper" } else { "best" };
    let key = |key: &str, value: &str| (format!("planning.{key}"), toml::Value::from(value));
    let mut sets = vec![
        ("planning.comfort.enabled".to_owned(), toml::Value::from(false)),
        key("planner", &args.planner),
        key("discretisation", name),
        key("preset", preset),
    ];
    sets.extend(parse_assignments(&args.set)?);
    Setup::load_with(registry, None, &sets).map_err(|problems| problems_error(&problems))
}

/// Selects the road problems of a file for a planner of the registry.
pub(super) fn on_road<'a>(
    file: &'a ProblemFile,
    config: &'a Setup,
    discretisation: &str,
) -> anyhow::Result<Named<'a>> {
    ensure!(!file.problems.fot.is_empty(), "problems.fot: no problem of a road, which this planner requires");
    Ok(Named { config, road: file.configs.fot.get(discretisation) })
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
