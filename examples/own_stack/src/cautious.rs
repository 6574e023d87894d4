//! A motion planner: along the route at a share of the target speed.

use serde::{Deserialize, Serialize};
use swerve_core::{ParamError, Ranges};
use swerve_msg::{Plan, PlanStatus};
use swerve_planning::path::route::follow_route;
use swerve_planning::path::speed::SpeedProfile;
use swerve_planning::{Budget, Planner, Request};
use swerve_stack::{NamedPlanner, PlannerDefaults};

/// Horizon of a plan, s.
const HORIZON_S: f64 = 5.0;

/// Parameters, in `planning.params`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Share of the target speed.
    #[schemars(range(min = 0.1, max = 1.0))]
    share: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self { share: 0.8 }
    }
}

/// Drives slower than it may.
pub struct Cautious(Params);

impl Planner for Cautious {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        budget.spend(1);
        let target_speed_mps = self.0.share * request.target_speed_mps;
        let slower = Request { target_speed_mps, ..*request };
        let plan = follow_route(&slower, SpeedProfile::Limited, HORIZON_S, PlanStatus::Route);
        Plan { work: 1, ..plan }
    }
}

impl NamedPlanner for Cautious {
    const NAME: &'static str = "cautious";
    type Params = Params;

    fn defaults(_: PlannerDefaults) -> Params {
        Params::default()
    }

    fn with_params(params: Params) -> Result<Self, ParamError> {
        params.check_ranges()?;
        Ok(Self(params))
    }
}

#[test]
fn conforms() {
    swerve_planning::testing::conformance(&|| Cautious(Params::default()), false);
}
