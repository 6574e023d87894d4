//! Construction of a planner from its name, preset, discretisation and parameters.

use swerve_core::{ParamError, Ranges};
use swerve_planning::comfort::{self, Comfort};
use swerve_planning::fot::{self, Fot};
use swerve_planning::{Ahead, CollisionMode, Planner};
use swerve_pylot::{HybridAstarParams, Original, Preset, RrtStarParams, Rules};
use swerve_text::{KeyProblem, overridden};

use super::{Fineness, PlanningConfig};
use crate::planners::{NamedPlanner as _, PlannerDefaults};
use crate::registry::Registry;

/// Planner that a configuration names, with its parameters, including its comfortable layer.
pub(super) fn planner(
    planning: &PlanningConfig,
    registry: &Registry,
    params: &toml::Table,
) -> Result<Box<dyn Planner>, Vec<KeyProblem>> {
    let Some(named) = registry.planners.get(planning.planner.as_str()) else { return Err(Vec::new()) };
    let collision = planning.collision();
    let of = PlannerDefaults { discretisation: planning.discretisation, collision, preset: planning.preset };
    let is_original = planning.preset == Preset::Paper && !named.is_foreign();
    let original = if is_original { original(planning, params)? } else { None };
    if !planning.has_comfort(registry) {
        let planner = match original {
            Some(planner) => planner,
            None => named.build(of, params)?.0,
        };
        return Ok(if planning.preset == Preset::Best { Box::new(Ahead(planner)) } else { planner });
    }
    let (planner, manner) = match original {
        // The paper's planners have other parameters than Swerve's of the same name.
        Some(planner) => {
            let built = named.build(of, params).or_else(|_| named.build(of, &toml::Table::new()));
            (planner, built?.1)
        }
        None => named.build(of, params)?,
    };
    // Problems of the limits are reported by their own keys.
    let limits = planning.comfort.limits;
    let limits = limits.validate().map_or_else(|_| comfort::Params::default(), |()| limits);
    let layered = Comfort::new(limits, collision, manner, planner);
    Ok(Box::new(layered.map_err(outside)?))
}

/// The paper's own planner, if it has one of this name.
fn original(
    planning: &PlanningConfig,
    params: &toml::Table,
) -> Result<Option<Box<dyn Planner>>, Vec<KeyProblem>> {
    // Problems of the rules are reported by their own keys.
    let rules = planning.rules().unwrap_or_else(|_| planning.rules_of_era());
    let (config, collision) = (planning.discretisation, planning.collision());
    let obstacle_range_m = planning.era.unwrap_or_default().range_m(planning.planner.original());
    Ok(Some(match planning.planner.original() {
        Original::Fot => {
            let of = PlannerDefaults { discretisation: config, collision, preset: planning.preset };
            let defaults = fot::Params { obstacle_range_m, ..Fot::defaults(of) };
            let params = overridden(&defaults, params)?;
            Box::new(swerve_pylot::Fot::new(params, rules).map_err(outside)?)
        }
        Original::HybridAstar => {
            let defaults = match config {
                Fineness::Fast => HybridAstarParams::fast(),
                Fineness::Slow => HybridAstarParams::slow(),
            };
            let defaults = HybridAstarParams { collision, obstacle_range_m, ..defaults };
            let params = overridden(&defaults, params)?;
            Box::new(swerve_pylot::HybridAstar::new(params, rules).map_err(outside)?)
        }
        Original::RrtStar => {
            let defaults = match config {
                Fineness::Fast => RrtStarParams::fast(),
                Fineness::Slow => RrtStarParams::slow(),
            };
            let params = overridden(&RrtStarParams { collision, obstacle_range_m, ..defaults }, params)?;
            Box::new(swerve_pylot::RrtStar::new(params, rules).map_err(outside)?)
        }
        Original::Other => return Ok(None),
    }))
}

/// Rules that a configuration names, or their problems, each by its key in `planning`.
pub(super) fn rules(planning: &PlanningConfig) -> Result<Rules, Vec<KeyProblem>> {
    let rules: Rules =
        overridden(&planning.rules_of_era(), &planning.rules).map_err(|found| within("rules", found))?;
    if planning.preset != Preset::Paper {
        let only = "only the preset `paper` has one";
        let era = planning.era.map(|_| ("era".to_owned(), only.to_owned()));
        let rule = planning.rules.keys().next().map(|rule| (format!("rules.{rule}"), only.to_owned()));
        let wrong: Vec<_> = era.into_iter().chain(rule).collect();
        return if wrong.is_empty() { Ok(rules) } else { Err(wrong) };
    }
    let ours = matches!(planning.collision(), CollisionMode::MayStop | CollisionMode::Risk);
    if ours && planning.planner.is_paper() {
        let message = "the paper's planners know `swept_static` and `time_indexed`".to_owned();
        return Err(vec![("collision".into(), message)]);
    }
    rules.validate(planning.planner.original()).map_err(|error| within("rules", outside(error)))?;
    Ok(rules)
}

/// Problems of all numbers out of their ranges.
pub(crate) fn problems_of_ranges(settings: &impl Ranges) -> Vec<KeyProblem> {
    settings.out_of_range().into_iter().map(problem).collect()
}

/// Problem of a parameter out of its range.
pub(crate) fn problem(error: ParamError) -> KeyProblem {
    let message = format!("expected {}, found {}", error.expected, error.value);
    (error.key.into_owned(), message)
}

/// The same as a list.
pub(crate) fn outside(error: ParamError) -> Vec<KeyProblem> {
    vec![problem(error)]
}

/// Problems of the table at dotted `key`, which is empty for the whole configuration.
pub(crate) fn within(key: &str, problems: Vec<KeyProblem>) -> Vec<KeyProblem> {
    let whole = |inner: String| match (key.is_empty(), inner.is_empty()) {
        (true, _) => inner,
        (_, true) => key.to_owned(),
        _ => format!("{key}.{inner}"),
    };
    problems.into_iter().map(|(inner, message)| (whole(inner), message)).collect()
}
