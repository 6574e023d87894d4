//! From a planner's name, preset, discretisation and parameters to the planner.

use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_planning::Planner;
use swerve_planning::aeb::{self, Aeb};
use swerve_planning::fot::{self, Fot};
use swerve_planning::hybrid_astar::{self, HybridAstar};
use swerve_planning::rrt_star::{self, RrtStar};
use swerve_planning::waypoint::Waypoint;
use swerve_pylot::{HybridAstarParams, Preset, RrtStarParams};

use super::{Fineness, PlannerName, PlanningConfig};

/// The planner that a configuration names, with its parameters.
pub(super) fn planner(planning: &PlanningConfig, params: &toml::Table) -> Result<Box<dyn Planner>, String> {
    let (preset, fineness) = (planning.preset, planning.config);
    let collision = planning.collision;
    Ok(match planning.planner {
        PlannerName::Fot => {
            let defaults = match fineness {
                Fineness::Fast => fot::Params::fast(),
                Fineness::Slow => fot::Params::slow(),
            };
            let params = overridden(&fot::Params { collision, ..defaults }, params)?;
            match preset {
                Preset::Paper => Box::new(swerve_pylot::Fot::new(params).map_err(|e| e.to_string())?),
                Preset::Best => Box::new(Fot::new(params).map_err(|e| e.to_string())?),
            }
        }
        PlannerName::HybridAstar if preset == Preset::Paper => {
            let defaults = match fineness {
                Fineness::Fast => HybridAstarParams::fast(),
                Fineness::Slow => HybridAstarParams::slow(),
            };
            let params = overridden(&HybridAstarParams { collision, ..defaults }, params)?;
            Box::new(swerve_pylot::HybridAstar::new(params).map_err(|e| e.to_string())?)
        }
        PlannerName::HybridAstar => {
            let defaults = hybrid_astar::Params { collision, ..hybrid_astar::Params::default() };
            Box::new(HybridAstar::new(overridden(&defaults, params)?).map_err(|e| e.to_string())?)
        }
        PlannerName::RrtStar if preset == Preset::Paper => {
            let defaults = match fineness {
                Fineness::Fast => RrtStarParams::fast(),
                Fineness::Slow => RrtStarParams::slow(),
            };
            let params = overridden(&RrtStarParams { collision, ..defaults }, params)?;
            Box::new(swerve_pylot::RrtStar::new(params).map_err(|e| e.to_string())?)
        }
        PlannerName::RrtStar => {
            let defaults = rrt_star::Params { collision, ..rrt_star::Params::default() };
            Box::new(RrtStar::new(overridden(&defaults, params)?).map_err(|e| e.to_string())?)
        }
        PlannerName::Waypoint => {
            let params = overridden(&preset.waypoint(), params)?;
            Box::new(Waypoint::new(params).map_err(|e| e.to_string())?)
        }
        PlannerName::Aeb => {
            let defaults = aeb::Params { collision, ..aeb::Params::default() };
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
