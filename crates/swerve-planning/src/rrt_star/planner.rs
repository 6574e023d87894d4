//! RRT* as a closed-loop planner.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{ParamError, Ranges, Rng};
use swerve_geom::{FrenetPoint, Pose2};
use swerve_msg::Plan;

use super::space::RoadSpace;
use super::tree::{Aim, Growth, Tree, Until, gamma_m2};
use crate::collision::CollisionMode;
use crate::path::dubins::Dubins;
use crate::path::ground::Ground;
use crate::path::piece::{Piece, join};
use crate::path::replanner::{PathSearch, Replanner, Settings, Task};
use crate::path::shorten::Shortener;
use crate::request::{Budget, Planner, Request};

/// Parameters of RRT* in the closed loop. There is no discretisation to choose. Source of all defaults: ours; range and
/// distance of the goal are Pylot's.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Treatment of predicted motion in the collision check.
    pub collision: CollisionMode,
    /// Fraction of the iterations that sample the goal.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub goal_share: f64,
    /// Largest number of iterations of one search; up to three searches for different goals are made, and up to five in
    /// all with a third of the iterations while braking or with less clearance.
    #[schemars(range(min = 1, max = 20_000))]
    pub iterations_max: u64,
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
            goal_share: 0.1,
            iterations_max: 300,
            clearance_m: 0.3,
            obstacle_range_m: 70.0,
            goal_ahead_m: 30.0,
            goal_ahead_s: 3.0,
            horizon_s: 5.0,
        }
    }
}

/// RRT* as a motion planner.
#[derive(Clone, Debug)]
pub struct RrtStar {
    params: Params,
    replanner: Replanner,
    trees: TreeSearch,
}

/// The search with its reusable storage.
#[derive(Clone, Debug)]
struct TreeSearch {
    params: Params,
    tree: Tree,
    shortener: Shortener,
    guides: Vec<Pose2>,
    poses: Vec<Pose2>,
    pieces: Vec<Piece>,
}

impl RrtStar {
    /// Creates the planner from valid parameters.
    pub fn new(params: Params) -> Result<Self, ParamError> {
        params.check_ranges()?;
        let trees = TreeSearch {
            params,
            tree: Tree::default(),
            shortener: Shortener::default(),
            guides: Vec::new(),
            poses: Vec::new(),
            pieces: Vec::new(),
        };
        Ok(Self { params, replanner: Replanner::default(), trees })
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

impl Planner for RrtStar {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let settings = self.settings();
        self.replanner.plan(&mut self.trees, &settings, request, budget)
    }
}

impl PathSearch for TreeSearch {
    fn search(
        &mut self,
        ground: &Ground<'_>,
        task: &Task<'_>,
        budget: &mut dyn Budget,
        pieces: &mut Vec<Piece>,
    ) -> bool {
        let p = self.params;
        let space = RoadSpace {
            ground,
            route: task.request.route,
            radius_m: task.radius_m,
            from_s_m: task.request.place().s_m,
            to_s_m: task
                .request
                .place_of(task.goal.point(), 2.0 * task.start.point().distance(task.goal.point()))
                .s_m,
            half_width_m: ground.outline.half_width_m,
        };
        let growth = Growth {
            step_m: 0.5 * task.radius_m,
            iterations_max: if task.thorough { p.iterations_max } else { p.iterations_max.div_ceil(3) },
            goal_share: p.goal_share,
            guide_share: 0.3,
            gamma_m2: gamma_m2(task.bounds),
            radius_max_m: 0.5 * task.radius_m,
            until: Until::Spent,
        };
        self.place_guides(&space, ground, task);
        let mut rng = Rng::keyed(task.request.seed, "rrt_star", &[]);
        let aim = Aim { start: task.start, goal: task.goal, bounds: task.bounds, guides: &self.guides };
        self.tree.grow(&space, &growth, &aim, &mut rng, budget);
        // Rewiring makes arrivals earlier, so a path that was free piece by piece may no longer be: take the best free
        // one.
        while self.tree.take_best(&mut self.poses).is_some() {
            self.poses.push(task.goal);
            pieces.clear();
            for pair in self.poses.windows(2) {
                pieces.extend(Dubins::shortest(pair[0], pair[1], task.radius_m).pieces);
            }
            join(pieces);
            if !ground.free_exactly(task.start, pieces) {
                continue;
            }
            self.pieces.clear();
            self.pieces.extend_from_slice(pieces);
            self.shortener.shorten(ground, task.radius_m, task.start, pieces, 0.1 * task.radius_m);
            if !ground.free_exactly(task.start, pieces) {
                pieces.clear();
                pieces.extend_from_slice(&self.pieces);
            }
            return true;
        }
        false
    }
}

impl TreeSearch {
    /// Places guide poses on either side of where each obstacle will be while the ego passes, parallel to the road and
    /// turned to that side: obstacles that move across are cleared at the worse of the ego's front and rear.
    fn place_guides(&mut self, space: &RoadSpace<'_>, ground: &Ground<'_>, task: &Task<'_>) {
        self.guides.clear();
        let around_m = |point| task.request.place_of(point, space.to_s_m - space.from_s_m);
        let outline = &ground.outline;
        let beside_m = outline.half_width_m + ground.clearance_m + GUIDE_SPARE_M;
        for prediction in task.request.predictions {
            let half_m = 0.5 * prediction.extent.length_m.max(prediction.extent.width_m);
            let passing_m = outline.half_length_m + half_m;
            let (mut s_m, mut d_m) = (space.from_s_m, [0.0; 2]);
            // Two iterations suffice: the obstacle's current place gives the ego's arrival time, which gives the
            // obstacle's place at that time.
            let mut at = around_m(prediction.path[0].pose.point());
            for _ in 0..2 {
                s_m = at.s_m - outline.center_ahead_m;
                let then = |further_m: f64| {
                    let travelled_m = (s_m + further_m - space.from_s_m).max(0.0);
                    around_m(prediction.pose_at(ground.clock.at(travelled_m)).point())
                };
                at = then(0.0);
                d_m = [then(-passing_m).d_m, then(passing_m).d_m];
            }
            if s_m <= space.from_s_m || s_m >= space.to_s_m {
                continue;
            }
            for (side, worst_m) in [(1.0, d_m[0].max(d_m[1])), (-1.0, d_m[0].min(d_m[1]))] {
                let d_m = worst_m + side * (half_m + beside_m);
                if task.request.route.borders().room_m(FrenetPoint { s_m, d_m }) > 0.0 {
                    self.guides.extend(GUIDE_OFF_RAD.map(|off_rad| space.beside(s_m, d_m, side * off_rad)));
                }
            }
        }
    }
}

/// Additional distance of guides from obstacles beyond the clearance, metres.
const GUIDE_SPARE_M: f64 = 0.1;

/// Directions of guides relative to the road, towards their side, radians.
const GUIDE_OFF_RAD: [f64; 3] = [0.0, 0.1, 0.2];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::Unlimited;
    use crate::testing::{World, conformance, keeps_its_lane, yields_to_pedestrians};
    use swerve_msg::PlanStatus;

    #[test]
    fn rrt_star_conforms() {
        conformance(&|| RrtStar::new(Params::default()).unwrap(), true);
    }

    #[test]
    fn rrt_star_yields_to_pedestrians_that_may_stop() {
        yields_to_pedestrians(&|collision| RrtStar::new(Params { collision, ..Params::default() }).unwrap());
    }

    #[test]
    fn rrt_star_keeps_its_lane_before_oncoming_traffic() {
        keeps_its_lane(&|| RrtStar::new(Params::default()).unwrap());
    }

    #[test]
    fn rrt_star_swerves_around_a_person_and_back() {
        for speed_mps in [16.0, 18.0, 20.0, 22.0] {
            for ahead_m in [24.0, 30.0, 40.0] {
                for seed in 0..5 {
                    let world = World::straight(speed_mps).with_person((ahead_m, 0.0), (0.0, 0.0));
                    let mut planner = RrtStar::new(Params::default()).unwrap();
                    let request = Request { seed, ..world.request() };
                    let plan = planner.plan(&request, &mut Unlimited::default());
                    assert_eq!(plan.status, PlanStatus::Found, "{speed_mps} {ahead_m} {seed}");
                    assert!(world.clearance_m(&plan, CollisionMode::TimeIndexed) > 0.2);
                    let last = plan.points[plan.points.len() - 1];
                    assert!(last.pose.y_m.abs() < 1e-6 && last.pose.heading_rad.abs() < 1e-6, "{last:?}");
                }
            }
        }
    }

    #[test]
    fn rrt_star_finds_the_gap_when_a_person_steps_out() {
        let mut found = 0;
        for speed_mps in [16.0, 18.0, 20.0, 22.0] {
            for seed in 0..6 {
                let world = World::person_stepping_out(speed_mps, 0.05);
                let mut planner = RrtStar::new(Params::default()).unwrap();
                let plan = planner.plan(&Request { seed, ..world.request() }, &mut Unlimited::default());
                if plan.status == PlanStatus::Found {
                    found += 1;
                    let clearance_m = world.clearance_m(&plan, CollisionMode::TimeIndexed);
                    assert!(clearance_m > 0.06, "{speed_mps} {seed}: {clearance_m}");
                    assert!(world.margin_m(&plan) > -0.02, "{speed_mps} {seed}");
                }
            }
        }
        // Random trees may miss a gap of a few decimetres, but rarely.
        assert!(found >= 22, "{found} of 24");
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let bad = Params { goal_share: 1.5, ..Params::default() };
        assert_eq!(RrtStar::new(bad).unwrap_err().key, "goal_share");
    }
}
