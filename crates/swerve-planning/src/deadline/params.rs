//! Parameters of the deadline policy.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use swerve_core::param::{ParamError, Ranges, require};

/// Parameters of the deadline policy.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Smallest budget of the detector, seconds. Source: D3's shortest budget.
    #[schemars(range(min = 0.001, max = 86_400.0))]
    pub detector_min_s: f64,
    /// Largest budget of the detector, seconds. Source: D3's longest budget.
    #[schemars(range(min = 0.001, max = 86_400.0))]
    pub detector_max_s: f64,
    /// Smallest budget of the planner, seconds. Source: D3's shortest budget.
    #[schemars(range(min = 0.001, max = 86_400.0))]
    pub planner_min_s: f64,
    /// Largest budget of the planner, seconds. Source: D3's longest budget.
    #[schemars(range(min = 0.001, max = 86_400.0))]
    pub planner_max_s: f64,
    /// Assumed braking deceleration, m/s². Source: 0.774 g, the competent driver of UN R157 (from memory).
    #[schemars(range(min = 0.1, max = 20.0))]
    pub brake_mps2: f64,
    /// Distance to keep from a hazard ahead, metres. Source: ours.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub margin_m: f64,
    /// Margin on either side of the strip that the ego sweeps, metres. Source: ours.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub clearance_m: f64,
    /// Objects up to this far beside the strip may hide a person who steps out, metres; 0 disables this. Source: ours:
    /// about the distance a person walks in the second that a response and the braking take.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub reach_m: f64,
    /// Objects within this distance count as nearby, metres. Source: FOT's `obstacle_range_m`.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub count_within_m: f64,
    /// Planner's share of the response time without nearby objects. Source: ours.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub planner_share_empty: f64,
    /// Planner's share of the response time with `full_at` nearby objects. Source: ours: that of D3's longest budgets.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub planner_share_full: f64,
    /// Number of nearby objects at which the planner's share is largest. Source: ours.
    #[schemars(range(min = 1, max = 10_000))]
    pub full_at: u32,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            detector_min_s: 0.020,
            detector_max_s: 0.270,
            planner_min_s: 0.030,
            planner_max_s: 0.309,
            brake_mps2: 7.6,
            margin_m: 1.0,
            clearance_m: 0.3,
            reach_m: 3.0,
            count_within_m: 50.0,
            planner_share_empty: 0.35,
            planner_share_full: 0.55,
            full_at: 10,
        }
    }
}

impl Params {
    /// Checks all ranges.
    pub fn validate(&self) -> Result<(), ParamError> {
        self.check_ranges()?;
        for (key, high, low_key, low) in [
            ("detector_max_s", self.detector_max_s, "detector_min_s", self.detector_min_s),
            ("planner_max_s", self.planner_max_s, "planner_min_s", self.planner_min_s),
            ("planner_share_full", self.planner_share_full, "planner_share_empty", self.planner_share_empty),
        ] {
            require(key, high, high >= low, format!("at least {low_key}, which is {low}"))?;
        }
        Ok(())
    }
}
