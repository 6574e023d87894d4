//! The planner in the closed loop.

use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require, require_not_negative, require_positive};
use swerve_msg::Plan;

use super::dubins::Piece;
use super::ground::{Ground, Outline};
use super::motions::{fan, scan};
use super::on_road::{Desk, OnRoad, PathSearch, Task, place_points};
use super::search::{Arrival, Lattice, Search};
use super::shorten::Shortener;
use crate::collision::CollisionMode;
use crate::posed::Preset;
use crate::request::{Budget, Planner, Request};
use crate::world::PathPoint;

/// Settings of Hybrid A* in the closed loop.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Which limits the planner has.
    pub preset: Preset,
    /// How predicted motion enters the collision check.
    pub collision: CollisionMode,
    /// `paper`: length of a motion, metres.
    pub step_m: f64,
    /// `paper`: step of the scan of arcs, radians as the original calls them.
    pub rad_step: f64,
    /// `paper`: the scan reaches this far to either side.
    pub rad_range: f64,
    /// `paper`: turning radius, metres. `best` turns as tightly as steering and lateral acceleration allow.
    pub radius_m: f64,
    /// `paper`: distance to the goal that counts as arrived, metres.
    pub completion_m: f64,
    /// `paper`: growth of the search box around start and goal, metres. `best` searches the road.
    pub lane_width_m: f64,
    /// `paper`: length of the car, metres. `best` takes the car as it is.
    pub car_length_m: f64,
    /// `paper`: width of the car, metres.
    pub car_width_m: f64,
    /// Expansions of one search at most; `best` may search again with other goals, three times in all, and then with
    /// a third of them while braking or nearer to what is in the way, five times in all.
    pub iterations_max: usize,
    /// Distance to keep from obstacles, metres.
    pub clearance_m: f64,
    /// Obstacles further away than this are not planned for, metres.
    pub obstacle_range_m: f64,
    /// The goal lies this far ahead on the route, metres.
    pub goal_ahead_m: f64,
    /// `best`: and at least so many seconds ahead at the present speed.
    pub goal_ahead_s: f64,
    /// Length of plans that follow the route, seconds.
    pub horizon_s: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self::fast(Preset::Best)
    }
}

impl Params {
    /// The paper's fast configuration; `best` has no steps to choose.
    pub fn fast(preset: Preset) -> Self {
        let paper = Self {
            preset,
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
            goal_ahead_s: 0.0,
            horizon_s: 5.0,
        };
        match preset {
            Preset::Paper => paper,
            Preset::Best => Self { iterations_max: 800, clearance_m: 0.3, goal_ahead_s: 3.0, ..paper },
        }
    }

    /// The paper's slow configuration.
    pub fn slow(preset: Preset) -> Self {
        Self { step_m: 3.0, rad_step: 0.25, ..Self::fast(preset) }
    }

    /// Checks all ranges.
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
        for (key, value) in [
            ("lane_width_m", self.lane_width_m),
            ("clearance_m", self.clearance_m),
            ("goal_ahead_s", self.goal_ahead_s),
        ] {
            require_not_negative(key, value)?;
        }
        let coarse = self.rad_step * 1000.0 >= self.rad_range;
        require("rad_step", self.rad_step, coarse, "at least a thousandth of rad_range")?;
        let n = self.iterations_max;
        require("iterations_max", n as f64, (1..=ITERATIONS_MAX).contains(&n), "1 to 100000")
    }
}

/// Most expansions that may be asked for: they bound the memory.
const ITERATIONS_MAX: usize = 100_000;

/// Hybrid A* as a motion planner.
#[derive(Clone, Debug)]
pub struct HybridAstar {
    params: Params,
    desk: Desk,
    lattice: LatticeSearch,
}

/// The two searches with their memory.
#[derive(Clone, Debug)]
struct LatticeSearch {
    params: Params,
    search: Search,
    shortener: Shortener,
    motions: Vec<Piece>,
    pieces: Vec<Piece>,
}

impl HybridAstar {
    /// With valid settings.
    pub fn new(params: Params) -> Result<Self, ParamError> {
        params.validate()?;
        let lattice = LatticeSearch {
            params,
            search: Search::default(),
            shortener: Shortener::default(),
            motions: Vec::new(),
            pieces: Vec::new(),
        };
        Ok(Self { params, desk: Desk::default(), lattice })
    }

    /// The settings.
    pub fn params(&self) -> &Params {
        &self.params
    }

    fn on_road(&self, request: &Request<'_>) -> OnRoad {
        let p = &self.params;
        OnRoad {
            goal_ahead_m: p.goal_ahead_m,
            goal_ahead_s: p.goal_ahead_s,
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
        }
    }
}

impl Planner for HybridAstar {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let settings = self.on_road(request);
        match self.params.preset {
            Preset::Paper => self.desk.plan_paper(&mut self.lattice, &settings, request, budget),
            Preset::Best => self.desk.plan_best(&mut self.lattice, &settings, request, budget),
        }
    }
}

impl PathSearch for LatticeSearch {
    fn paper(
        &mut self,
        ground: &Ground<'_>,
        task: &Task<'_>,
        budget: &mut dyn Budget,
        path: &mut Vec<PathPoint>,
    ) -> bool {
        let p = self.params;
        scan(p.radius_m, p.step_m, (p.rad_range, p.rad_range), p.rad_step, &mut self.motions);
        let lattice = Lattice {
            motions: &self.motions,
            arrival: Arrival::Within(p.completion_m, f64::INFINITY),
            radius_m: p.radius_m,
            cell_m: p.completion_m,
            cell_rad: p.rad_step,
            expansions_max: p.iterations_max,
            detours: false,
            good_enough: 1.0,
        };
        let ends = (task.start, task.goal, task.bounds);
        let found = self.search.run(ground, &lattice, ends, budget, &mut self.pieces);
        if found {
            place_points(task.start, &self.pieces, path);
        }
        found
    }

    fn best(
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
            // Narrow gaps need more places side by side; further attempts are there for them.
            cell_m: if task.thorough { 0.5 } else { 0.25 },
            cell_rad: step_m / task.radius_m,
            expansions_max: self.params.iterations_max / if task.thorough { 1 } else { 3 },
            detours: false,
            good_enough: 1.0,
        };
        let found = self.search.run(ground, &lattice, (task.start, task.goal, task.bounds), budget, pieces);
        if found {
            self.pieces.clear();
            self.pieces.extend_from_slice(pieces);
            self.shortener.shorten(ground, task.radius_m, task.start, pieces, step_m);
            // Shortcuts arrive earlier than the way they replace: what follows them may meet something.
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
    use crate::testing::{World, conformance, minds_walkers};
    use swerve_msg::PlanStatus;

    #[test]
    fn holds_what_every_planner_must() {
        conformance(&|| HybridAstar::new(Params::fast(Preset::Best)).unwrap(), true);
        conformance(&|| HybridAstar::new(Params::fast(Preset::Paper)).unwrap(), false);
        conformance(&|| HybridAstar::new(Params::slow(Preset::Paper)).unwrap(), false);
    }

    #[test]
    fn minds_walkers_who_may_stop() {
        minds_walkers(&|collision| HybridAstar::new(Params { collision, ..Params::default() }).unwrap());
    }

    #[test]
    fn swerves_around_a_person_and_back() {
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
    fn finds_the_gap_where_a_person_steps_out() {
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
    fn what_will_be_gone_is_no_reason_to_swerve() {
        // She crosses 30 m ahead and has left the lane before the ego is there.
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
    fn paper_plans_only_with_something_in_range() {
        let mut planner = HybridAstar::new(Params::slow(Preset::Paper)).unwrap();
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
        let bad = Params { rad_step: 0.0, ..Params::default() };
        assert_eq!(HybridAstar::new(bad).unwrap_err().key, "rad_step");
        let bad = Params { clearance_m: f64::NAN, ..Params::default() };
        assert_eq!(HybridAstar::new(bad).unwrap_err().key, "clearance_m");
    }
}
