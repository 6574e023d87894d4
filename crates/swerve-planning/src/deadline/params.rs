//! Parameters of the policy.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use swerve_core::param::{ParamError, require, require_not_negative, require_positive};

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
        for (key, value) in [
            ("detector_min_s", self.detector_min_s),
            ("planner_min_s", self.planner_min_s),
            ("brake_mps2", self.brake_mps2),
            ("count_within_m", self.count_within_m),
        ] {
            require_positive(key, value)?;
        }
        for (key, value) in [
            ("margin_m", self.margin_m),
            ("clearance_m", self.clearance_m),
            ("reach_m", self.reach_m),
            ("planner_share_empty", self.planner_share_empty),
        ] {
            require_not_negative(key, value)?;
        }
        let day_s = 86_400.0;
        let most = |key, least: f64, most: f64| {
            require(
                key,
                most,
                (least..=day_s).contains(&most),
                "a number not below the least, nor above a day",
            )
        };
        most("detector_max_s", self.detector_min_s, self.detector_max_s)?;
        most("planner_max_s", self.planner_min_s, self.planner_max_s)?;
        let full = self.planner_share_full;
        let share = (self.planner_share_empty..=1.0).contains(&full);
        require("planner_share_full", full, share, "planner_share_empty to 1")?;
        require("full_at", self.full_at, self.full_at > 0, "at least 1")
    }
}
