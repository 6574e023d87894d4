//! Hybrid A* as in the original: arcs of one radius, and a path that ends near the goal regardless of its heading.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{ParamError, Ranges};
use swerve_geom::Pose2;
use swerve_msg::Plan;
use swerve_planning::path::piece::{Piece, advance};
use swerve_planning::{Budget, CollisionMode, Planner, Request};

use crate::boxes::Sight;
use crate::closed_loop::{PathSearch, Replanner, Settings, Task};
use crate::lattice::{Aim, Lattice, Search};
use crate::{Original, Rules};

/// Spacing of the points of a path, metres, and their largest number. Source: `hybrid_astar_planner`
/// `HybridAStarWrapper.cpp`.
const POINT_M: f64 = 1.0;
const POINTS_MAX: usize = 99;

/// Parameters of the original's Hybrid A* in the closed loop.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct HybridAstarParams {
    /// Treatment of predicted motion in the collision check.
    pub collision: CollisionMode,
    /// Length of a motion, metres. Source: the paper (6 fast, 3 slow).
    #[schemars(range(min = 0.1, max = 100.0))]
    pub step_m: f64,
    /// Step of the scan of arcs, in the original's radians. Source: the paper (0.75 fast, 0.25 slow).
    // With `rad_range`: at most a thousand arcs per scan.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub rad_step: f64,
    /// Range of the scan to either side. Source: Pylot.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub rad_range: f64,
    /// Turning radius, metres. Source: Pylot.
    #[schemars(range(min = 0.5, max = 100.0))]
    pub radius_m: f64,
    /// Distance to the goal that counts as arrived, metres. Source: Pylot.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub completion_m: f64,
    /// Growth of the search box around start and goal, metres. Source: Pylot.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub lane_width_m: f64,
    /// Length of the car, metres. Source: Pylot.
    #[schemars(range(min = 0.1, max = 30.0))]
    pub car_length_m: f64,
    /// Width of the car, metres. Source: Pylot.
    #[schemars(range(min = 0.1, max = 10.0))]
    pub car_width_m: f64,
    /// Largest number of expansions. Source: Pylot.
    #[schemars(range(min = 1, max = 100_000))]
    pub iterations_max: usize,
    /// Distance to keep from obstacles, metres. Source: Pylot.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub clearance_m: f64,
    /// Obstacles further away than this are ignored, metres. Source: Pylot.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub obstacle_range_m: f64,
    /// Distance of the goal ahead on the route, metres. Source: Pylot.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub goal_ahead_m: f64,
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
            collision: CollisionMode::SweptStatic,
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
            obstacle_range_m: 10.0,
            goal_ahead_m: 20.0,
        }
    }

    /// The paper's slow configuration.
    pub fn slow() -> Self {
        Self { step_m: 3.0, rad_step: 0.25, ..Self::fast() }
    }
}

/// The planner, with storage that is reused between calls.
#[derive(Clone, Debug)]
pub struct HybridAstar {
    params: HybridAstarParams,
    rules: Rules,
    replanner: Replanner,
    search: LatticeSearch,
}

/// The search with its reusable storage.
#[derive(Clone, Debug)]
struct LatticeSearch {
    lattice: Lattice,
    search: Search,
    pieces: Vec<Piece>,
}

impl HybridAstar {
    /// Creates the planner from valid parameters and rules.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub fn new(params: HybridAstarParams, rules: Rules) -> Result<Self, ParamError> {
        params.check_ranges()?;
        rules.validate(Original::HybridAstar)?;
        let lattice = Lattice {
            radius_m: params.radius_m,
            step_m: params.step_m,
            low: params.rad_range,
            high: params.rad_range,
            step: params.rad_step,
            heading_of_road_rad: rules.heading_of_road_rad,
            completion_m: params.completion_m,
            nearest_free: rules.nearest_free,
            expansions_max: params.iterations_max,
            car_length_m: params.car_length_m,
            car_width_m: params.car_width_m,
            speed_mps: f64::INFINITY,
        };
        let search = LatticeSearch { lattice, search: Search::default(), pieces: Vec::new() };
        Ok(Self { params, rules, replanner: Replanner::default(), search })
    }
}

impl Planner for HybridAstar {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let p = &self.params;
        let sight = Sight {
            collision: p.collision,
            range_m: p.obstacle_range_m,
            per_place: self.rules.range_per_place,
            person_half_m: self.rules.person_half_m,
        };
        let settings = Settings {
            rules: self.rules,
            sight,
            goal_ahead_m: p.goal_ahead_m,
            clearance_m: p.clearance_m,
            lane_width_m: p.lane_width_m,
        };
        self.replanner.plan(&mut self.search, &settings, request, budget)
    }
}

impl PathSearch for LatticeSearch {
    fn search(&mut self, task: &Task<'_>, budget: &mut dyn Budget, path: &mut Vec<Pose2>) -> bool {
        // The goal gets the ego's heading. Source: `pylot` be7bf9c,
        // `planning/hybrid_astar/hybrid_astar_planner.py:87-91`.
        let goal = Pose2::new(task.goal.x_m, task.goal.y_m, task.start.heading_rad);
        let aim = Aim { start: task.start, goal, bounds: task.bounds };
        let lattice = Lattice { speed_mps: task.speed_mps, ..self.lattice };
        let found = self.search.run(task.boxes, (&lattice, &aim), budget, &mut self.pieces);
        place(task.start, &self.pieces, path);
        found
    }
}

/// Poses a metre apart along each piece from its beginning, and the end of each: a pose between two pieces is
/// duplicated and counts twice towards the number of points. Source: `hybrid_astar_planner` `Dubins.cpp:37-101`,
/// `HybridAStar.cpp:45-62`.
fn place(start: Pose2, pieces: &[Piece], path: &mut Vec<Pose2>) {
    path.clear();
    let mut from = start;
    for &Piece { curvature_1pm, length_m } in pieces {
        let n = (length_m / POINT_M).ceil() as usize;
        path.extend((0..n).map(|k| advance(from, curvature_1pm, POINT_M * k as f64)));
        from = advance(from, curvature_1pm, length_m);
        path.push(from);
    }
    path.truncate(POINTS_MAX);
}

#[cfg(test)]
mod tests {
    use swerve_msg::PlanStatus;
    use swerve_planning::Unlimited;
    use swerve_planning::testing::{World, conformance};

    use super::*;
    use crate::Era;

    fn planner(params: HybridAstarParams) -> HybridAstar {
        HybridAstar::new(params, Rules::of(Era::November2020, Original::HybridAstar)).unwrap()
    }

    #[test]
    fn original_hybrid_astar_conforms() {
        conformance(
            &|| planner(HybridAstarParams { obstacle_range_m: 70.0, ..HybridAstarParams::fast() }),
            false,
        );
        conformance(&|| planner(HybridAstarParams::slow()), false);
    }

    #[test]
    fn hybrid_astar_searches_only_with_obstacles_in_range() {
        let params = HybridAstarParams { obstacle_range_m: 30.0, ..HybridAstarParams::slow() };
        let far = World::straight(16.0).with_person((75.0, 0.0), (0.0, 0.0));
        let plan = planner(params).plan(&far.request(), &mut Unlimited::default());
        assert_eq!((plan.status, plan.work), (PlanStatus::Route, 0));
        let near = World::straight(16.0).with_person((25.0, 0.0), (0.0, 0.0));
        let plan = planner(params).plan(&near.request(), &mut Unlimited::default());
        assert!(plan.work > 0 && plan.points.len() <= POINTS_MAX);
        assert_eq!(plan.status, PlanStatus::Found);
        assert!(plan.points.iter().all(|p| p.speed_mps == 16.0));
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let rules = Rules::of(Era::May2020, Original::HybridAstar);
        let bad = HybridAstarParams { rad_step: 0.0, ..HybridAstarParams::default() };
        assert_eq!(HybridAstar::new(bad, rules).unwrap_err().key, "rad_step");
        let bad = HybridAstarParams { clearance_m: f64::NAN, ..HybridAstarParams::default() };
        assert_eq!(HybridAstar::new(bad, rules).unwrap_err().key, "clearance_m");
    }
}
