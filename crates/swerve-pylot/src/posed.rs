//! Posed planning problems: plain data on which planners of different origin are compared.
//!
//! The types mirror the JSON problem file; the caller reads files and times the calls. Everything is right-handed:
//! FOT's lateral samples range over `d` in `[-max_road_width_l, +max_road_width_r]` with `d` positive along heading +
//! 90 degrees.

pub mod fot;
pub mod hybrid_astar;
pub mod road;
pub mod rrt_star;

#[cfg(test)]
mod allocations;
mod drive;
mod pieces;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, Ranges, require};
use swerve_geom::Obb;

/// A problem file; other top-level entries (recorded results, notes) are ignored.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct ProblemFile {
    /// Named settings.
    pub configs: Configs,
    /// The problems.
    pub problems: Problems,
}

/// Named settings of each planner.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Configs {
    /// Settings of the Frenet planner.
    #[serde(default)]
    pub fot: BTreeMap<String, FotConfig>,
    /// Settings of RRT*.
    #[serde(default)]
    pub rrt_star: BTreeMap<String, RrtStarConfig>,
    /// Settings of Hybrid A*.
    #[serde(default)]
    pub hybrid_astar: BTreeMap<String, HybridAstarConfig>,
}

/// The problems of each planner.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Problems {
    /// Problems of the Frenet planner.
    #[serde(default)]
    pub fot: Vec<FotProblem>,
    /// Problems of RRT*.
    #[serde(default)]
    pub rrt_star: Vec<RrtStarProblem>,
    /// Problems of Hybrid A*.
    #[serde(default)]
    pub hybrid_astar: Vec<HybridAstarProblem>,
}

/// An axis-aligned box: x_min, y_min, x_max, y_max, metres.
pub type AxisBox = [f64; 4];

/// Reads boxes; rejects boxes with swapped corners.
fn boxes<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Vec<AxisBox>, D::Error> {
    let boxes = Vec::<AxisBox>::deserialize(deserializer)?;
    match boxes.iter().find(|b| b[0] > b[2] || b[1] > b[3]) {
        Some(b) => Err(serde::de::Error::custom(format!(
            "an obstacle is {b:?}, expected [x_min, y_min, x_max, y_max] with the least first"
        ))),
        None => Ok(boxes),
    }
}

/// The rectangle of an [`AxisBox`].
pub fn obb(b: &AxisBox) -> Obb {
    Obb::axis_aligned(b[0], b[1], b[2], b[3])
}

/// A problem for the Frenet planner.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FotProblem {
    /// Name.
    pub id: String,
    /// Family of problems.
    #[serde(default)]
    pub group: String,
    /// Reference line, metres.
    pub waypoints: Vec<[f64; 2]>,
    /// Obstacles.
    #[serde(deserialize_with = "boxes")]
    pub obstacles: Vec<AxisBox>,
    /// Position of the vehicle's centre, metres; optional with `frenet_ic`.
    #[serde(default)]
    pub pos: Option<[f64; 2]>,
    /// Velocity, m/s.
    #[serde(default)]
    pub vel: Option<[f64; 2]>,
    /// Arc length near which the start is searched, metres.
    #[serde(default)]
    pub ps: Option<f64>,
    /// Start state in the Frenet frame: s, ds/dt, d, dd/dt, d²d/dt².
    #[serde(default)]
    pub frenet_ic: Option<[f64; 5]>,
    /// Target speed, m/s.
    pub target_speed: f64,
    /// Remark.
    #[serde(default)]
    pub note: String,
}

/// Settings of the Frenet planner, names as in the original.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FotConfig {
    /// Largest speed along the line, m/s.
    pub max_speed: f64,
    /// Largest acceleration along the line, m/s².
    pub max_accel: f64,
    /// Largest curvature, 1/m.
    pub max_curvature: f64,
    /// Largest lateral sample to the right is `d = -max_road_width_l`, metres.
    pub max_road_width_l: f64,
    /// Largest lateral sample to the left is `d = +max_road_width_r`, metres.
    pub max_road_width_r: f64,
    /// Spacing of lateral samples, metres.
    pub d_road_w: f64,
    /// Spacing of time samples and end times, seconds.
    pub dt: f64,
    /// Latest end time, seconds.
    pub maxt: f64,
    /// Earliest end time, seconds.
    pub mint: f64,
    /// Spacing of end speeds, m/s.
    pub d_t_s: f64,
    /// Number of end speeds on either side of the target speed.
    pub n_s_sample: f64,
    /// Distance to keep from obstacles, metres.
    pub obstacle_clearance: f64,
    /// Weight of lateral offset and end speed deviation.
    pub kd: f64,
    /// Weight of lateral speed.
    pub kv: f64,
    /// Weight of acceleration.
    pub ka: f64,
    /// Weight of jerk.
    pub kj: f64,
    /// Weight of time.
    pub kt: f64,
    /// Weight of nearness to obstacles.
    pub ko: f64,
    /// Weight of the lateral part.
    pub klat: f64,
    /// Weight of the longitudinal part.
    pub klon: f64,
    /// Number of threads in the original; not used.
    #[serde(default)]
    pub num_threads: u32,
}

/// A problem for RRT*: a point among boxes.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RrtStarProblem {
    /// Name.
    pub id: String,
    /// Family of problems.
    #[serde(default)]
    pub group: String,
    /// Start, metres.
    pub start: [f64; 2],
    /// Goal, metres.
    pub goal: [f64; 2],
    /// Obstacles.
    #[serde(deserialize_with = "boxes")]
    pub obstacles: Vec<AxisBox>,
    /// Remark.
    #[serde(default)]
    pub note: String,
}

/// Settings of RRT*, names as in the original.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, Ranges)]
#[serde(deny_unknown_fields)]
pub struct RrtStarConfig {
    /// Length of an extension, metres.
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub step_size: f64,
    /// Largest number of iterations.
    pub max_iterations: u64,
    /// Distance to the goal that counts as arrived, metres.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub end_dist_threshold: f64,
    /// Growth of the boxes, metres.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub obstacle_clearance: f64,
    /// Growth of the search box around start and goal, metres.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub lane_width: f64,
}

/// A problem for Hybrid A*: a car among boxes.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HybridAstarProblem {
    /// Name.
    pub id: String,
    /// Family of problems.
    #[serde(default)]
    pub group: String,
    /// Start pose: x, y, heading.
    pub start: [f64; 3],
    /// Goal pose: x, y, heading.
    pub goal: [f64; 3],
    /// Obstacles.
    #[serde(deserialize_with = "boxes")]
    pub obstacles: Vec<AxisBox>,
    /// Remark.
    #[serde(default)]
    pub note: String,
    /// Ratio of length to straight distance of the shortest known path that ends in the exact goal pose.
    #[serde(default)]
    pub best_known_length_ratio_exact_heading: Option<f64>,
}

/// Settings of Hybrid A*, names as in the original.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, Ranges)]
#[serde(deny_unknown_fields)]
pub struct HybridAstarConfig {
    /// Length of a primitive, metres.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub step_size: f64,
    /// Largest number of expansions.
    pub max_iterations: u64,
    /// Distance to the goal that counts as arrived, metres.
    #[schemars(range(min = 1e-6, max = 1000.0))]
    pub completion_threshold: f64,
    /// Heading difference that counts as arrived, radians.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub angle_completion_threshold: f64,
    /// Step of the heading scan, radians.
    #[schemars(range(min = 0.001, max = 10.0))]
    pub rad_step: f64,
    /// Upper end of the heading scan, radians.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub rad_upper_range: f64,
    /// Lower end of the heading scan, radians.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub rad_lower_range: f64,
    /// Distance to keep from obstacles, metres.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub obstacle_clearance: f64,
    /// Growth of the search box around start and goal, metres.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub lane_width: f64,
    /// Turning radius, metres.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub radius: f64,
    /// Length of the car, metres.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub car_length: f64,
    /// Width of the car, metres.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub car_width: f64,
}

/// Result of one problem.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Solution {
    /// Name of the problem.
    pub id: String,
    /// True if a path was found.
    pub found: bool,
    /// Reason for a failure, in words; empty if a path was found.
    pub reason: String,
    /// True if the problem was rejected because one of its numbers or settings is out of range.
    pub invalid: bool,
    /// Run time of the call, milliseconds: set by the caller that measures it, otherwise zero.
    pub time_ms: f64,
    /// Units of work: candidates (FOT), iterations (RRT*), neighbours (Hybrid A*).
    pub work: u64,
    /// Length of the path, metres; zero without a path.
    pub length_m: f64,
    /// Cost by the original's formula, or the length if it has none; zero without a path.
    pub cost: f64,
    /// Smallest distance of the outline to an obstacle along the path, sampled every 0.1 m, metres; capped at
    /// [`CLEARANCE_CAP_M`] so that it is finite without obstacles; zero without a path.
    pub clearance_m: f64,
    /// Largest curvature, 1/m.
    pub curvature_max: f64,
    /// Path points: x and y in metres, heading in radians, seconds from the start.
    pub path: Vec<[f64; 4]>,
}

/// Largest clearance that is reported, metres.
pub const CLEARANCE_CAP_M: f64 = 1000.0;

impl Solution {
    /// Result without a path.
    pub fn not_found(id: &str, reason: &str, work: u64) -> Self {
        Self { id: id.to_owned(), reason: reason.to_owned(), work, ..Self::default() }
    }

    /// Result without a path: the error in the problem, if any, otherwise the outcome of the search.
    fn without(id: &str, (outcome, checked): (Outcome, Result<(), ParamError>), work: u64) -> Self {
        match checked {
            Err(wrong) => Self::invalid(id, &wrong.to_string()),
            Ok(()) => Self::not_found(id, outcome.reason(), work),
        }
    }

    /// Result without a path, for an error in the problem or its settings.
    fn invalid(id: &str, reason: &str) -> Self {
        Self { invalid: true, ..Self::not_found(id, reason, 0) }
    }
}

/// Length of a path of points, metres.
pub fn path_length_m(path: &[[f64; 4]]) -> f64 {
    path.windows(2).map(|p| swerve_geom::math::hypot(p[1][0] - p[0][0], p[1][1] - p[0][1])).sum()
}

/// Rejects coordinates of the problem that are implausibly large.
fn require_near(key: &'static str, values: &[f64]) -> Result<(), ParamError> {
    let far = values.iter().find(|v| !(v.is_finite() && v.abs() < REACH_M));
    far.map_or(Ok(()), |&far| require(key, far, false, "numbers below 10000000 in size"))
}

/// Largest coordinate, metres: UTM's northings end at 10,000 km.
const REACH_M: f64 = 1e7;

/// Outcome of a search.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Outcome {
    /// A path was found.
    Found,
    /// A number of the problem or of its settings is not finite or out of range.
    Invalid,
    /// The start collides or is outside the bounds.
    StartBlocked,
    /// The goal collides or is outside the bounds.
    GoalBlocked,
    /// The search ended without a path.
    NoPath,
}

impl Outcome {
    /// The reason in words; empty for [`Outcome::Found`].
    pub fn reason(self) -> &'static str {
        match self {
            Self::Found => "",
            Self::Invalid => "a number is not finite or out of range",
            Self::StartBlocked => "the start is not free",
            Self::GoalBlocked => "the goal is not free",
            Self::NoPath => "no path within the budget",
        }
    }
}
