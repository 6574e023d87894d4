//! Motion planners that a configuration can name: built-in ones, and those of other crates.

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use swerve_core::ParamError;
use swerve_planning::aeb::{self, Aeb};
use swerve_planning::comfort::Manner;
use swerve_planning::fot::{self, Fot};
use swerve_planning::hybrid_astar::{self, HybridAstar};
use swerve_planning::rrt_star::{self, RrtStar};
use swerve_planning::waypoint::{self, Waypoint};
use swerve_planning::{CollisionMode, Planner};
use swerve_pylot::Preset;
use swerve_text::{KeyProblem, overridden};

use crate::named::Of;
use crate::problems::outside;

/// A planner's discretisation.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fineness {
    /// Coarse.
    Fast,
    /// Fine.
    Slow,
}

impl Fineness {
    /// Name in files and tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Slow => "slow",
        }
    }
}

/// Settings of `[planning]` on which default parameters may depend.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PlannerDefaults {
    /// `planning.discretisation`.
    pub discretisation: Fineness,
    /// `planning.collision`.
    pub collision: CollisionMode,
    /// `planning.preset`.
    pub preset: Preset,
}

/// A motion planner that `planning.planner` can name.
///
/// [`Registry::with_planner`](crate::Registry::with_planner) adds one. It then has everything that built-in planners have:
/// the comfort layer, the predicted start, run times, deadlines, studies and `swerve plan`.
pub trait NamedPlanner: Planner + Sized + 'static {
    /// Name in `planning.planner`.
    const NAME: &'static str;

    /// True if the preset `best` places a comfort layer above it.
    const COMFORT: bool = true;

    /// Parameters: the keys of `planning.params`.
    type Params: Serialize + DeserializeOwned;

    /// Default parameters.
    fn defaults(of: PlannerDefaults) -> Self::Params;

    /// Creates the planner.
    ///
    /// # Errors
    /// A parameter out of its range.
    fn with_params(params: Self::Params) -> Result<Self, ParamError>;

    /// Manner of the comfort layer above it.
    fn manner(_: &Self::Params) -> Manner {
        Manner::GoesRound
    }
}

/// A planner's type, erased.
pub(crate) trait AnyPlanner: Send + Sync {
    fn has_comfort(&self) -> bool;

    /// True in place of the named one, also of the original's of that name.
    fn is_foreign(&self) -> bool {
        false
    }

    /// The planner and the manner of its comfort layer, from parameters that differ from the defaults.
    fn build(&self, of: PlannerDefaults, params: &toml::Table) -> Result<Built, Vec<KeyProblem>>;
}

/// A planner and the manner of its comfort layer.
pub(crate) type Built = (Box<dyn Planner>, Manner);

impl<P: NamedPlanner> AnyPlanner for Of<P> {
    fn has_comfort(&self) -> bool {
        P::COMFORT
    }

    fn build(&self, of: PlannerDefaults, params: &toml::Table) -> Result<Built, Vec<KeyProblem>> {
        let params = overridden(&P::defaults(of), params)?;
        let manner = P::manner(&params);
        Ok((Box::new(P::with_params(params).map_err(outside)?), manner))
    }
}

impl NamedPlanner for Fot {
    const NAME: &'static str = "fot";
    type Params = fot::Params;

    fn defaults(PlannerDefaults { discretisation, collision, .. }: PlannerDefaults) -> fot::Params {
        let defaults = match discretisation {
            Fineness::Fast => fot::Params::fast(),
            Fineness::Slow => fot::Params::slow(),
        };
        fot::Params { collision, ..defaults }
    }

    fn with_params(params: fot::Params) -> Result<Self, ParamError> {
        Self::new(params)
    }

    fn manner(&fot::Params { weight_obstacle, time_step_s, .. }: &fot::Params) -> Manner {
        Manner::KeepsAway { weight_obstacle, time_step_s }
    }
}

impl NamedPlanner for RrtStar {
    const NAME: &'static str = "rrt_star";
    type Params = rrt_star::Params;

    fn defaults(of: PlannerDefaults) -> rrt_star::Params {
        rrt_star::Params { collision: of.collision, ..rrt_star::Params::default() }
    }

    fn with_params(params: rrt_star::Params) -> Result<Self, ParamError> {
        Self::new(params)
    }
}

impl NamedPlanner for HybridAstar {
    const NAME: &'static str = "hybrid_astar";
    type Params = hybrid_astar::Params;

    fn defaults(of: PlannerDefaults) -> hybrid_astar::Params {
        hybrid_astar::Params { collision: of.collision, ..hybrid_astar::Params::default() }
    }

    fn with_params(params: hybrid_astar::Params) -> Result<Self, ParamError> {
        Self::new(params)
    }
}

impl NamedPlanner for Waypoint {
    const NAME: &'static str = "waypoint";
    type Params = waypoint::Params;

    fn defaults(of: PlannerDefaults) -> waypoint::Params {
        of.preset.waypoint()
    }

    fn with_params(params: waypoint::Params) -> Result<Self, ParamError> {
        Self::new(params)
    }

    fn manner(_: &waypoint::Params) -> Manner {
        Manner::Waits
    }
}

impl NamedPlanner for Aeb {
    const NAME: &'static str = "aeb";
    const COMFORT: bool = false;
    type Params = aeb::Params;

    fn defaults(of: PlannerDefaults) -> aeb::Params {
        aeb::Params { collision: of.collision, ..aeb::Params::default() }
    }

    fn with_params(params: aeb::Params) -> Result<Self, ParamError> {
        Self::new(params)
    }

    fn manner(_: &aeb::Params) -> Manner {
        Manner::Waits
    }
}
