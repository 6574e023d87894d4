//! Hybrid A* as a closed-loop planner.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{ParamError, Ranges};
use swerve_msg::Plan;

use super::motions::fan;
use super::search::{Arrival, Lattice, Search};
use crate::collision::CollisionMode;
use crate::path::Ends;
use crate::path::ground::Ground;
use crate::path::piece::Piece;
use crate::path::replanner::{PathSearch, Replanner, Settings, Task};
use crate::path::shorten::Shortener;
use crate::request::{Budget, Planner, Request};

/// Parameters of Hybrid A* in the closed loop. Turns are as tight as steering and lateral acceleration allow; there is
/// no discretisation to choose. Source of all defaults: ours; range and distance of the goal are Pylot's.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Treatment of predicted motion in the collision check.
    pub collision: CollisionMode,
    /// Largest number of expansions of one search; up to three searches for different goals are made, and up to five in
    /// all with a third of the expansions while braking or with less clearance.
    #[schemars(range(min = 1, max = 100_000))]
    pub iterations_max: usize,
    /// Distance to keep from obstacles, metres.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub clearance_m: f64,
    /// Obstacles further away than this are ignored, metres.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub obstacle_range_m: f64,
    /// Smallest distance of the goal ahead on the route, metres.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub goal_ahead_m: f64,
    /// Smallest distance of the goal ahead on the route as a travel time at the current speed, seconds.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub goal_ahead_s: f64,
    /// Length of plans that follow the route, seconds.
    #[schemars(range(min = 0.1, max = 60.0))]
    pub horizon_s: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            collision: CollisionMode::TimeIndexed,
            iterations_max: 800,
            clearance_m: 0.3,
            obstacle_range_m: 70.0,
            goal_ahead_m: 30.0,
            goal_ahead_s: 3.0,
            horizon_s: 5.0,
        }
    }
}

/// Hybrid A* as a motion planner.
#[derive(Clone, Debug)]
pub struct HybridAstar {
    params: Params,
    replanner: Replanner,
    lattice: LatticeSearch,
}

/// The search with its reusable storage.
#[derive(Clone, Debug)]
struct LatticeSearch {
    params: Params,
    search: Search,
    shortener: Shortener,
    pieces: Vec<Piece>,
}

impl HybridAstar {
    /// Creates the planner from valid parameters.
    pub fn new(params: Params) -> Result<Self, ParamError> {
        params.check_ranges()?;
        let lattice = LatticeSearch {
            params,
            search: Search::default(),
            shortener: Shortener::default(),
            pieces: Vec::new(),
        };
        Ok(Self { params, replanner: Replanner::default(), lattice })
    }

    /// The parameters.
    pub fn params(&self) -> &Params {
        &self.params
    }

    fn settings(&self) -> Settings {
        let p = &self.params;
        Settings {
            goal_ahead_m: p.goal_ahead_m,
            goal_ahead_s: p.goal_ahead_s,
            obstacle_range_m: p.obstacle_range_m,
            clearance_m: p.clearance_m,
            horizon_s: p.horizon_s,
            collision: p.collision,
        }
    }
}

impl Planner for HybridAstar {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let settings = self.settings();
        self.replanner.plan(&mut self.lattice, &settings, request, budget)
    }
}

impl PathSearch for LatticeSearch {
    fn search(
        &mut self,
        ground: &Ground<'_>,
        task: &Task<'_>,
        budget: &mut dyn Budget,
        pieces: &mut Vec<Piece>,
    ) -> bool {
        let step_m = (0.1 * task.radius_m).clamp(1.0, 4.0);
        let motions = fan(task.radius_m, step_m);
        let lattice = Lattice {
            motions: &motions,
            arrival: Arrival::Exact,
            radius_m: task.radius_m,
            // Narrow gaps need more places side by side; later attempts provide them.
            cell_m: if task.thorough { 0.5 } else { 0.25 },
            cell_rad: step_m / task.radius_m,
            expansions_max: self.params.iterations_max / if task.thorough { 1 } else { 3 },
            detours: false,
            good_enough: 1.0,
        };
        let ends = Ends { start: task.start, goal: task.goal, bounds: task.bounds };
        let found = self.search.run(ground, &lattice, &ends, budget, pieces);
        if found {
            self.pieces.clear();
            self.pieces.extend_from_slice(pieces);
            self.shortener.shorten(ground, task.radius_m, task.start, pieces, step_m);
            // Shortcuts arrive earlier than the path they replace: the part after them may now collide.
            if !ground.free_exactly(task.start, pieces) {
                pieces.clear();
                pieces.extend_from_slice(&self.pieces);
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::Unlimited;
    use crate::testing::{World, conformance, keeps_its_lane, yields_to_pedestrians};
    use swerve_msg::PlanStatus;

    #[test]
    fn hybrid_astar_conforms() {
        conformance(&|| HybridAstar::new(Params::default()).unwrap(), true);
    }

    #[test]
    fn hybrid_astar_yields_to_pedestrians_that_may_stop() {
        yields_to_pedestrians(&|collision| {
            HybridAstar::new(Params { collision, ..Params::default() }).unwrap()
        });
    }

    #[test]
    fn hybrid_astar_keeps_its_lane_before_oncoming_traffic() {
        keeps_its_lane(&|| HybridAstar::new(Params::default()).unwrap());
    }

    #[test]
    fn hybrid_astar_swerves_around_a_person_and_back() {
        for speed_mps in [16.0, 18.0, 20.0, 22.0] {
            for ahead_m in [24.0, 30.0, 40.0] {
                let world = World::straight(speed_mps).with_person((ahead_m, 0.0), (0.0, 0.0));
                let mut planner = HybridAstar::new(Params::default()).unwrap();
                let plan = planner.plan(&world.request(), &mut Unlimited::default());
                assert_eq!(plan.status, PlanStatus::Found, "{speed_mps} {ahead_m}");
                assert!(world.clearance_m(&plan, CollisionMode::TimeIndexed) > 0.2);
                let last = plan.points[plan.points.len() - 1];
                assert!(last.pose.y_m.abs() < 1e-6 && last.pose.heading_rad.abs() < 1e-6, "{last:?}");
                assert!(last.pose.x_m >= 3.0 * speed_mps - 1e-6 && last.pose.x_m > ahead_m);
                assert!(plan.points.iter().all(|p| p.speed_mps == speed_mps));
            }
        }
    }

    #[test]
    fn hybrid_astar_finds_the_gap_when_a_person_steps_out() {
        for speed_mps in [16.0, 18.0, 20.0, 22.0] {
            for late_s in [0.0, 0.05, 0.1, 0.2] {
                let world = World::person_stepping_out(speed_mps, late_s);
                let mut planner = HybridAstar::new(Params::default()).unwrap();
                let plan = planner.plan(&world.request(), &mut Unlimited::default());
                assert_eq!(plan.status, PlanStatus::Found, "{speed_mps} {late_s}");
                assert!(world.clearance_m(&plan, CollisionMode::TimeIndexed) > 0.06, "{speed_mps} {late_s}");
                assert!(world.margin_m(&plan) > -0.02, "{speed_mps} {late_s}");
            }
        }
    }

    #[test]
    fn person_gone_before_arrival_causes_no_swerve() {
        // She crosses 30 m ahead and has left the lane before the ego arrives.
        let world = World::straight(16.0).with_person((30.0, 0.5), (0.0, -3.0));
        let plan = |collision| {
            let params = Params { collision, ..Params::default() };
            HybridAstar::new(params).unwrap().plan(&world.request(), &mut Unlimited::default())
        };
        let timed = plan(CollisionMode::TimeIndexed);
        assert!(timed.status == PlanStatus::Found && timed.points.iter().all(|p| p.pose.y_m.abs() < 1e-9));
        let swept = plan(CollisionMode::SweptStatic);
        assert!(swept.points.iter().any(|p| p.pose.y_m.abs() > 0.5) || swept.status.is_fallback());
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let bad = Params { iterations_max: 0, ..Params::default() };
        assert_eq!(HybridAstar::new(bad).unwrap_err().key, "iterations_max");
        let bad = Params { clearance_m: f64::NAN, ..Params::default() };
        assert_eq!(HybridAstar::new(bad).unwrap_err().key, "clearance_m");
    }
}
