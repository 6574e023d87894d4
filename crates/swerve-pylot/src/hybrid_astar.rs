//! Hybrid A* as in the original: arcs of one radius, and a path that comes near the goal without regard to its heading.

use core::f64::consts::TAU;

use serde::{Deserialize, Serialize};
use swerve_core::param::ParamError;
use swerve_core::param::{require, require_not_negative, require_positive};
use swerve_msg::Plan;
use swerve_planning::hybrid_astar::search::{Arrival, Lattice, Search};
use swerve_planning::path::Ends;
use swerve_planning::path::ground::{Ground, Outline};
use swerve_planning::path::piece::Piece;
use swerve_planning::path::points::{PathPoint, place_points};
use swerve_planning::{Budget, CollisionMode, Planner, Request};

use crate::replanner::{PathSearch, Replanner, Settings, Task};

/// Settings of the original's Hybrid A* in the closed loop.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HybridAstarParams {
    /// How predicted motion enters the collision check.
    pub collision: CollisionMode,
    /// Length of a motion, metres. Source: the paper (6 fast, 3 slow).
    pub step_m: f64,
    /// Step of the scan of arcs, radians as the original calls them. Source: the paper (0.75 fast, 0.25 slow).
    pub rad_step: f64,
    /// The scan reaches this far to either side. Source: Pylot.
    pub rad_range: f64,
    /// Turning radius, metres. Source: Pylot.
    pub radius_m: f64,
    /// Distance to the goal that counts as arrived, metres. Source: Pylot.
    pub completion_m: f64,
    /// Growth of the search box around start and goal, metres. Source: Pylot.
    pub lane_width_m: f64,
    /// Length of the car, metres. Source: Pylot.
    pub car_length_m: f64,
    /// Width of the car, metres. Source: Pylot.
    pub car_width_m: f64,
    /// Expansions at most. Source: Pylot.
    pub iterations_max: usize,
    /// Distance to keep from obstacles, metres. Source: Pylot.
    pub clearance_m: f64,
    /// Obstacles further away than this are not planned for, metres. Source: Pylot.
    pub obstacle_range_m: f64,
    /// The goal lies this far ahead on the route, metres. Source: Pylot.
    pub goal_ahead_m: f64,
    /// Length of plans that follow the route, seconds. Source: ours.
    pub horizon_s: f64,
}

impl Default for HybridAstarParams {
    fn default() -> Self {
        Self::fast()
    }
}

impl HybridAstarParams {
    /// The paper's fast configuration.
    pub fn fast() -> Self {
        Self {
            collision: CollisionMode::TimeIndexed,
            step_m: 6.0,
            rad_step: 0.75,
            rad_range: 4.0,
            radius_m: 6.0,
            completion_m: 1.0,
            lane_width_m: 6.0,
            car_length_m: 4.8,
            car_width_m: 1.8,
            iterations_max: 500,
            clearance_m: 0.5,
            obstacle_range_m: 70.0,
            goal_ahead_m: 30.0,
            horizon_s: 5.0,
        }
    }

    /// The paper's slow configuration.
    pub fn slow() -> Self {
        Self { step_m: 3.0, rad_step: 0.25, ..Self::fast() }
    }

    /// Checks all ranges.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        for (key, value) in [
            ("step_m", self.step_m),
            ("rad_step", self.rad_step),
            ("rad_range", self.rad_range),
            ("radius_m", self.radius_m),
            ("completion_m", self.completion_m),
            ("car_length_m", self.car_length_m),
            ("car_width_m", self.car_width_m),
            ("obstacle_range_m", self.obstacle_range_m),
            ("goal_ahead_m", self.goal_ahead_m),
            ("horizon_s", self.horizon_s),
        ] {
            require_positive(key, value)?;
        }
        require_not_negative("lane_width_m", self.lane_width_m)?;
        require_not_negative("clearance_m", self.clearance_m)?;
        let coarse = self.rad_step * 1000.0 >= self.rad_range;
        require("rad_step", self.rad_step, coarse, "at least a thousandth of rad_range")?;
        let n = self.iterations_max;
        require("iterations_max", n as f64, (1..=ITERATIONS_MAX).contains(&n), "1 to 100000")
    }
}

/// Most expansions that may be asked for: they bound the memory.
const ITERATIONS_MAX: usize = 100_000;

/// The planner, with the storage it keeps from call to call; no call depends on an earlier one.
#[derive(Clone, Debug)]
pub struct HybridAstar {
    params: HybridAstarParams,
    replanner: Replanner,
    search: LatticeSearch,
}

/// The search with its memory.
#[derive(Clone, Debug)]
struct LatticeSearch {
    params: HybridAstarParams,
    search: Search,
    motions: Vec<Piece>,
    pieces: Vec<Piece>,
}

impl HybridAstar {
    /// With valid settings.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub fn new(params: HybridAstarParams) -> Result<Self, ParamError> {
        params.validate()?;
        let search =
            LatticeSearch { params, search: Search::default(), motions: Vec::new(), pieces: Vec::new() };
        Ok(Self { params, replanner: Replanner::default(), search })
    }
}

impl Planner for HybridAstar {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let p = &self.params;
        let settings = Settings {
            goal_ahead_m: p.goal_ahead_m,
            obstacle_range_m: p.obstacle_range_m,
            clearance_m: p.clearance_m,
            lane_width_m: p.lane_width_m,
            horizon_s: p.horizon_s,
            collision: p.collision,
            outline: Outline {
                half_length_m: 0.5 * p.car_length_m,
                half_width_m: 0.5 * p.car_width_m,
                center_ahead_m: request.shape.center_ahead_m(),
            },
        };
        self.replanner.plan(&mut self.search, &settings, request, budget)
    }
}

impl PathSearch for LatticeSearch {
    fn search(
        &mut self,
        ground: &Ground<'_>,
        task: &Task,
        budget: &mut dyn Budget,
        path: &mut Vec<PathPoint>,
    ) -> bool {
        let p = self.params;
        let scan = Scan {
            radius_m: p.radius_m,
            step_m: p.step_m,
            low: p.rad_range,
            high: p.rad_range,
            step: p.rad_step,
        };
        scan.motions(&mut self.motions);
        let lattice = Lattice {
            motions: &self.motions,
            arrival: Arrival::Within { distance_m: p.completion_m, angle_rad: f64::INFINITY },
            radius_m: p.radius_m,
            cell_m: p.completion_m,
            cell_rad: p.rad_step,
            expansions_max: p.iterations_max,
            detours: false,
            good_enough: 1.0,
        };
        let ends = Ends { start: task.start, goal: task.goal, bounds: task.bounds };
        let found = self.search.run(ground, &lattice, &ends, budget, &mut self.pieces);
        if found {
            place_points(task.start, &self.pieces, path);
        }
        found
    }
}

/// The original's motions: straight, and arcs of the one radius to either side whose angle is `step_m / r`, for `r`
/// from `-low` to `high` in steps of `step`.
///
/// The original scans around the absolute heading, so that what the car can do depends on where north is; here
/// the scan is around zero. Arcs beyond a full turn come to where they have been and are left out.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Scan {
    /// Turning radius, metres.
    pub(crate) radius_m: f64,
    /// Length of a motion, metres.
    pub(crate) step_m: f64,
    /// The scan begins at minus this, metres.
    pub(crate) low: f64,
    /// And ends here, metres.
    pub(crate) high: f64,
    /// Step of the scan, metres.
    pub(crate) step: f64,
}

impl Scan {
    /// Replaces the content of `motions`.
    pub(crate) fn motions(&self, motions: &mut Vec<Piece>) {
        let Self { radius_m, step_m, low, high, step } = *self;
        motions.clear();
        motions.push(Piece { curvature_1pm: 0.0, length_m: step_m });
        let steps = ((high + low) / step).floor().clamp(0.0, 1000.0) as usize;
        for k in 0..=steps {
            let r = -low + step * k as f64;
            let angle = (step_m / r).abs();
            if angle < TAU {
                for side in [1.0, -1.0] {
                    motions.push(Piece { curvature_1pm: side / radius_m, length_m: radius_m * angle });
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use swerve_msg::PlanStatus;
    use swerve_planning::Unlimited;
    use swerve_planning::testing::{World, conformance};

    use super::*;

    #[test]
    fn holds_what_every_planner_must() {
        conformance(&|| HybridAstar::new(HybridAstarParams::fast()).unwrap(), false);
        conformance(&|| HybridAstar::new(HybridAstarParams::slow()).unwrap(), false);
    }

    #[test]
    fn plans_only_with_something_in_range() {
        let mut planner = HybridAstar::new(HybridAstarParams::slow()).unwrap();
        let far = World::straight(16.0).with_person((75.0, 0.0), (0.0, 0.0));
        let plan = planner.plan(&far.request(), &mut Unlimited::default());
        assert_eq!((plan.status, plan.work), (PlanStatus::Route, 0));
        let near = World::straight(16.0).with_person((25.0, 0.0), (0.0, 0.0));
        let plan = planner.plan(&near.request(), &mut Unlimited::default());
        assert!(plan.work > 0);
        assert!(plan.points.iter().all(|p| p.speed_mps == 16.0));
    }

    #[test]
    fn settings_out_of_range_are_named() {
        let bad = HybridAstarParams { rad_step: 0.0, ..HybridAstarParams::default() };
        assert_eq!(HybridAstar::new(bad).unwrap_err().key, "rad_step");
        let bad = HybridAstarParams { clearance_m: f64::NAN, ..HybridAstarParams::default() };
        assert_eq!(HybridAstar::new(bad).unwrap_err().key, "clearance_m");
    }
}
