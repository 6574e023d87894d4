//! Construction of a planner from its name, preset, discretisation and parameters.

use swerve_planning::comfort::{self, Comfort};
use swerve_planning::fot::{self, Fot};
use swerve_planning::{Ahead, Planner};
use swerve_pylot::{HybridAstarParams, Original, Preset, RrtStarParams};
use swerve_text::{KeyProblem, overridden};

use crate::config::{Fineness, PlannerName, PlanningConfig};
use crate::planners::{AnyPlanner, NamedPlanner as _, PlannerDefaults};
use crate::problems::outside;
use crate::registry::Registry;

impl PlanningConfig {
    /// Planner of this configuration, with its parameters.
    ///
    /// # Errors
    /// Problems of the parameters, each by its key in `planning.params`.
    pub fn planner(&self, registry: &Registry) -> Result<Box<dyn Planner>, Vec<KeyProblem>> {
        self.planner_with(registry, &self.params)
    }

    /// As `planner`, with other parameters.
    ///
    /// # Errors
    /// Problems of the parameters, each by its key.
    pub fn planner_with(
        &self,
        registry: &Registry,
        params: &toml::Table,
    ) -> Result<Box<dyn Planner>, Vec<KeyProblem>> {
        planner(self, registry, params)
    }

    /// Returns true if the planner has a comfortable layer.
    pub fn has_comfort(&self, registry: &Registry) -> bool {
        let by_default = || registry.planners.get(self.planner.as_str()).is_some_and(AnyPlanner::has_comfort);
        self.comfort.enabled.unwrap_or_else(|| self.preset == Preset::Best && by_default())
    }

    /// Problems of planners' names, each by its key in `planning`.
    pub(crate) fn problems_of_names(&self, registry: &Registry) -> Vec<KeyProblem> {
        let named = self.cost.keys().map(|name| (format!("cost.{}", name.as_str()), name));
        let named = core::iter::once(("planner".to_owned(), &self.planner)).chain(named);
        let problem =
            |(key, name): (String, &PlannerName)| Some((key, registry.planners.problem(name.as_str())?));
        named.filter_map(problem).collect()
    }
}

/// Planner that a configuration names, with its parameters, including its comfortable layer.
fn planner(
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
    Ok(Box::new(layered.map_err(outside)?.with_occlusion(planning.occlusion())))
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
