//! Parameters of the policy.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use swerve_core::param::{ParamError, require, require_all_within};

/// Parameters of the policy.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// The detector gets at least this, seconds. Source: D3's shortest budget.
    pub detector_min_s: f64,
    /// And at most this, seconds. Source: D3's longest budget.
    pub detector_max_s: f64,
    /// The planner gets at least this, seconds. Source: D3's shortest budget.
    pub planner_min_s: f64,
    /// And at most this, seconds. Source: D3's longest budget.
    pub planner_max_s: f64,
    /// Deceleration that is counted on, m/s². Source: 0.774 g, the competent driver of UN R157 (as remembered).
    pub brake_mps2: f64,
    /// Distance to be kept ahead, metres. Source: ours.
    pub margin_m: f64,
    /// The strip that the ego sweeps is wider than the ego by this on either side, metres. Source: ours.
    pub clearance_m: f64,
    /// A thing no further beside the strip may hide a person who steps out, metres; 0 for nothing. Source: ours: about what a
    /// person goes in the second that a response and the braking take.
    pub reach_m: f64,
    /// Things no further than this are counted, metres. Source: FOT's `obstacle_range_m`.
    pub count_within_m: f64,
    /// The planner's share with nothing near by. Source: ours.
    pub planner_share_empty: f64,
    /// The planner's share with `full_at` things near by. Source: ours: that of D3's longest budgets.
    pub planner_share_full: f64,
    /// So many things are a full scene. Source: ours.
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
        // A day.
        let budget = [0.001, 86_400.0];
        require_all_within(&[
            ("detector_min_s", self.detector_min_s, budget),
            ("detector_max_s", self.detector_max_s, budget),
            ("planner_min_s", self.planner_min_s, budget),
            ("planner_max_s", self.planner_max_s, budget),
            ("brake_mps2", self.brake_mps2, [0.1, 20.0]),
            ("margin_m", self.margin_m, [0.0, 100.0]),
            ("clearance_m", self.clearance_m, [0.0, 10.0]),
            ("reach_m", self.reach_m, [0.0, 100.0]),
            ("count_within_m", self.count_within_m, [0.1, 1000.0]),
            ("planner_share_empty", self.planner_share_empty, [0.0, 1.0]),
            ("planner_share_full", self.planner_share_full, [0.0, 1.0]),
            ("full_at", f64::from(self.full_at), [1.0, 10_000.0]),
        ])?;
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
