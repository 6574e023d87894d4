//! Parameters of the Frenet planner.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, Ranges, require};

use crate::collision::CollisionMode;

/// Largest number of candidates of a lattice.
const CANDIDATES_MAX: f64 = 5e6;

/// Largest weight of a cost term.
pub(crate) const WEIGHT_MAX: f64 = 1e6;

/// Parameters of the Frenet planner; the defaults are those of the paper's person-avoidance experiment (Pylot,
/// `person_avoidance_frenet_*`), with left and right in our right-handed frame.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Treatment of predicted motion in the collision check. Source: ours; Pylot's is `swept_static`.
    pub collision: CollisionMode,
    /// Obstacles that never come within this distance of the start are ignored, metres. Source: Pylot (50).
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub obstacle_range_m: f64,
    /// Largest speed along the line, m/s. Source: Pylot (35).
    #[schemars(range(min = 0.1, max = 150.0))]
    pub max_speed_mps: f64,
    /// Largest acceleration and deceleration along the line, m/s²; the vehicle's limits apply as well. Source: Pylot
    /// (10).
    #[schemars(range(min = 0.1, max = 100.0))]
    pub max_accel_mps2: f64,
    /// Largest curvature, 1/m; the vehicle's limit applies as well. Source: Pylot (4).
    #[schemars(range(min = 0.001, max = 100.0))]
    pub max_curvature_1pm: f64,
    /// Largest lateral sample to the left, metres. Source: Pylot (6).
    #[schemars(range(min = -100.0, max = 100.0))]
    pub left_m: f64,
    /// Largest lateral sample to the right, metres. Source: Pylot (1).
    #[schemars(range(min = -100.0, max = 100.0))]
    pub right_m: f64,
    /// Spacing of lateral samples, metres. Source: the paper (0.5 fast, 0.1 slow).
    #[schemars(range(min = 0.01, max = 100.0))]
    pub lateral_step_m: f64,
    /// Spacing of time samples and end times, seconds. Source: the paper (0.3 fast, 0.1 slow).
    #[schemars(range(min = 0.02, max = 10.0))]
    pub time_step_s: f64,
    /// Earliest end time, seconds. Source: Pylot (2).
    #[schemars(range(min = 0.1, max = 60.0))]
    pub horizon_min_s: f64,
    /// Latest end time, seconds. Source: Pylot (5).
    #[schemars(range(min = 0.1, max = 60.0))]
    pub horizon_max_s: f64,
    /// Spacing of end speeds, m/s. Source: Pylot (0.25).
    #[schemars(range(min = 0.01, max = 50.0))]
    pub speed_step_mps: f64,
    /// Number of end speeds on either side of the target speed. Source: Pylot (2).
    #[schemars(range(min = 0, max = 1000))]
    pub speed_steps: u32,
    /// Number of end speeds from standstill up that are also tried if no candidate is valid. Source: ours: braking and
    /// swerving at once.
    #[schemars(range(min = 0, max = 1000))]
    pub slower_speeds: u32,
    /// If no candidate at about the target speed is valid, the ego stops or follows at this distance behind the
    /// obstacle in its way, metres; 0 disables this. Source: ours; stopping and following are Werling 2010, section V.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub follow_gap_m: f64,
    /// Time gap to the obstacle followed, added to `follow_gap_m`, seconds. Source: ours.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub follow_time_s: f64,
    /// Distance to keep from obstacles, metres. Source: Pylot (0.3).
    #[schemars(range(min = 0.0, max = 10.0))]
    pub clearance_m: f64,
    /// Distance to keep from the edge of the drivable ground, metres. Source: ours.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub road_margin_m: f64,
    /// The plan continues along the line for this long after its end time and is checked there as well, seconds.
    /// Source: ours: the next plan may be late or missing.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub tail_s: f64,
    /// Weight of lateral offset and of end speed deviation (`kd`). Source: Pylot (1).
    #[schemars(range(min = 0.0, max = WEIGHT_MAX))]
    pub weight_offset: f64,
    /// Weight of lateral speed (`kv`). Source: Pylot (0.1).
    #[schemars(range(min = 0.0, max = WEIGHT_MAX))]
    pub weight_lateral_speed: f64,
    /// Weight of acceleration (`ka`). Source: Pylot (0.1).
    #[schemars(range(min = 0.0, max = WEIGHT_MAX))]
    pub weight_accel: f64,
    /// Weight of jerk (`kj`). Source: Pylot (0.01).
    #[schemars(range(min = 0.0, max = WEIGHT_MAX))]
    pub weight_jerk: f64,
    /// Weight of the end time (`kt`). Source: Pylot (0.01).
    #[schemars(range(min = 0.0, max = WEIGHT_MAX))]
    pub weight_time: f64,
    /// Weight of nearness to obstacles (`ko`). Source: Pylot (100).
    #[schemars(range(min = 0.0, max = WEIGHT_MAX))]
    pub weight_obstacle: f64,
    /// Weight of the lateral part (`klat`). Source: Pylot (1).
    #[schemars(range(min = 0.0, max = WEIGHT_MAX))]
    pub weight_lateral: f64,
    /// Weight of the longitudinal part (`klon`). Source: Pylot (1).
    #[schemars(range(min = 0.0, max = WEIGHT_MAX))]
    pub weight_longitudinal: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self::fast()
    }
}

impl Params {
    /// The paper's fast configuration: 0.3 s, 0.5 m, 825 candidates.
    pub fn fast() -> Self {
        Self {
            collision: CollisionMode::TimeIndexed,
            obstacle_range_m: 50.0,
            max_speed_mps: 35.0,
            max_accel_mps2: 10.0,
            max_curvature_1pm: 4.0,
            left_m: 6.0,
            right_m: 1.0,
            lateral_step_m: 0.5,
            time_step_s: 0.3,
            horizon_min_s: 2.0,
            horizon_max_s: 5.0,
            speed_step_mps: 0.25,
            speed_steps: 2,
            slower_speeds: 6,
            follow_gap_m: 2.0,
            follow_time_s: 1.0,
            clearance_m: 0.3,
            road_margin_m: 0.05,
            tail_s: 1.0,
            weight_offset: 1.0,
            weight_lateral_speed: 0.1,
            weight_accel: 0.1,
            weight_jerk: 0.01,
            weight_time: 0.01,
            weight_obstacle: 100.0,
            weight_lateral: 1.0,
            weight_longitudinal: 1.0,
        }
    }

    /// The paper's slow configuration: 0.1 s, 0.1 m, 11,005 candidates.
    pub fn slow() -> Self {
        Self { lateral_step_m: 0.1, time_step_s: 0.1, ..Self::fast() }
    }

    /// Number of candidates of the lattice, computed by division.
    fn candidates(&self) -> f64 {
        let lateral = ((self.left_m + self.right_m) / self.lateral_step_m).floor() + 1.0;
        let times = ((self.horizon_max_s - self.horizon_min_s) / self.time_step_s).floor() + 1.0;
        let speeds = (2.0 * f64::from(self.speed_steps) + 1.0).max(f64::from(self.slower_speeds));
        // Following uses every sample as an end time, with one target place each, and adds the start's offset.
        let follows = (lateral + 1.0) * (self.horizon_max_s / self.time_step_s);
        (lateral * times * speeds).max(follows)
    }

    /// Checks all ranges.
    pub fn validate(&self) -> Result<(), ParamError> {
        self.check_ranges()?;
        let (low, high) = (self.horizon_min_s, self.horizon_max_s);
        require("horizon_max_s", high, high >= low, "at least horizon_min_s")?;
        require("left_m", self.left_m, self.left_m >= -self.right_m, "a place to the left of -right_m")?;
        let n = self.candidates();
        let step = format!("{} (a lattice of {n} candidates)", self.lateral_step_m);
        require("lateral_step_m", step, n <= CANDIDATES_MAX, "a lattice of at most 5 million candidates")
    }
}
