//! From a planner's name, preset, discretisation and parameters to the planner.

use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_planning::Planner;
use swerve_planning::aeb::{self, Aeb};
use swerve_planning::fot::{self, Fot};
use swerve_planning::hybrid_astar::{self, HybridAstar};
use swerve_planning::rrt_star::{self, RrtStar};
use swerve_planning::waypoint::{self, Waypoint};

use super::{Fineness, PlannerName, PlanningConfig};

/// The planner that a configuration names, with its parameters.
pub(super) fn planner(planning: &PlanningConfig, params: &toml::Table) -> Result<Box<dyn Planner>, String> {
    let (preset, fineness) = (planning.preset, planning.config);
    Ok(match planning.planner {
        PlannerName::Fot => {
            let defaults = match fineness {
                Fineness::Fast => fot::Params::fast(preset),
                Fineness::Slow => fot::Params::slow(preset),
            };
            let defaults = fot::Params { collision: planning.collision, ..defaults };
            Box::new(Fot::new(overridden(&defaults, params)?).map_err(|e| e.to_string())?)
        }
        PlannerName::HybridAstar => {
            let defaults = match fineness {
                Fineness::Fast => hybrid_astar::Params::fast(preset),
                Fineness::Slow => hybrid_astar::Params::slow(preset),
            };
            let defaults = hybrid_astar::Params { collision: planning.collision, ..defaults };
            Box::new(HybridAstar::new(overridden(&defaults, params)?).map_err(|e| e.to_string())?)
        }
        PlannerName::RrtStar => {
            let defaults = match fineness {
                Fineness::Fast => rrt_star::Params::fast(preset),
                Fineness::Slow => rrt_star::Params::slow(preset),
            };
            let defaults = rrt_star::Params { collision: planning.collision, ..defaults };
            Box::new(RrtStar::new(overridden(&defaults, params)?).map_err(|e| e.to_string())?)
        }
        PlannerName::Waypoint => {
            let params = overridden(&waypoint::Params::of(planning.preset), params)?;
            Box::new(Waypoint::new(params).map_err(|e| e.to_string())?)
        }
        PlannerName::Aeb => {
            let defaults = aeb::Params { collision: planning.collision, ..aeb::Params::default() };
            Box::new(Aeb::new(overridden(&defaults, params)?).map_err(|e| e.to_string())?)
        }
    })
}

/// Parameters with what the configuration says otherwise; all that is wrong with it in one line.
pub(super) fn overridden<T: Serialize + DeserializeOwned>(
    defaults: &T,
    changes: &toml::Table,
) -> Result<T, String> {
    swerve_text::overridden(defaults, changes).map_err(|problems| swerve_text::in_one_line(&problems))
}
