//! RRT* as in the original: a point among grown boxes, and the first path that comes near the goal.

use serde::{Deserialize, Serialize};
use swerve_core::Rng;
use swerve_core::param::ParamError;
use swerve_core::param::{require, require_not_negative, require_positive};
use swerve_geom::{Pose2, Vector2};
use swerve_msg::Plan;
use swerve_planning::path::ground::{Ground, Outline};
use swerve_planning::path::piece::Piece;
use swerve_planning::path::points::{PathPoint, with_curvature};
use swerve_planning::rrt_star::tree::{Aim, Growth, Space, Tree, Until, gamma_m2};
use swerve_planning::{Budget, CollisionMode, Planner, Request};

use crate::replanner::{PathSearch, Replanner, Settings, Task};

/// Settings of the original's RRT* in the closed loop.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RrtStarParams {
    /// How predicted motion enters the collision check.
    pub collision: CollisionMode,
    /// Length of an extension, metres. Source: the paper (0.5 fast, 0.1 slow).
    pub step_m: f64,
    /// Distance to the goal that counts as arrived, metres. Source: Pylot.
    pub arrival_m: f64,
    /// Growth of the search box around start and goal, metres. Source: Pylot.
    pub lane_width_m: f64,
    /// Share of the iterations that aim at the goal. Source: Pylot.
    pub goal_share: f64,
    /// Iterations at most. Source: Pylot.
    pub iterations_max: u64,
    /// Distance to keep from obstacles, metres: it holds the car's width too. Source: Pylot.
    pub clearance_m: f64,
    /// Obstacles further away than this are not planned for, metres. Source: Pylot.
    pub obstacle_range_m: f64,
    /// The goal lies this far ahead on the route, metres. Source: Pylot.
    pub goal_ahead_m: f64,
    /// Length of plans that follow the route, seconds. Source: ours.
    pub horizon_s: f64,
}

impl Default for RrtStarParams {
    fn default() -> Self {
        Self::fast()
    }
}

impl RrtStarParams {
    /// The paper's fast configuration.
    pub fn fast() -> Self {
        Self {
            collision: CollisionMode::TimeIndexed,
            step_m: 0.5,
            arrival_m: 2.0,
            lane_width_m: 5.0,
            goal_share: 0.01,
            iterations_max: 2000,
            clearance_m: 1.5,
            obstacle_range_m: 70.0,
            goal_ahead_m: 30.0,
            horizon_s: 5.0,
        }
    }

    /// The paper's slow configuration.
    pub fn slow() -> Self {
        Self { step_m: 0.1, ..Self::fast() }
    }

    /// Checks all ranges.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        for (key, value) in [
            ("step_m", self.step_m),
            ("obstacle_range_m", self.obstacle_range_m),
            ("goal_ahead_m", self.goal_ahead_m),
            ("horizon_s", self.horizon_s),
        ] {
            require_positive(key, value)?;
        }
        for (key, value) in [
            ("arrival_m", self.arrival_m),
            ("lane_width_m", self.lane_width_m),
            ("clearance_m", self.clearance_m),
        ] {
            require_not_negative(key, value)?;
        }
        let share = self.goal_share;
        require("goal_share", share, (0.0..=1.0).contains(&share), "0 to 1")?;
        let n = self.iterations_max;
        require("iterations_max", n as f64, (1..=ITERATIONS_MAX).contains(&n), "1 to 100000")
    }
}

/// Most iterations that may be asked for: they bound the memory.
const ITERATIONS_MAX: u64 = 100_000;

/// The planner, with the storage it keeps from call to call; no call depends on an earlier one.
#[derive(Clone, Debug)]
pub struct RrtStar {
    params: RrtStarParams,
    replanner: Replanner,
    search: TreeSearch,
}

/// The search with its memory.
#[derive(Clone, Debug)]
struct TreeSearch {
    params: RrtStarParams,
    tree: Tree,
    poses: Vec<Pose2>,
}

impl RrtStar {
    /// With valid settings.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub fn new(params: RrtStarParams) -> Result<Self, ParamError> {
        params.validate()?;
        let search = TreeSearch { params, tree: Tree::default(), poses: Vec::new() };
        Ok(Self { params, replanner: Replanner::default(), search })
    }
}

impl Planner for RrtStar {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let p = &self.params;
        let settings = Settings {
            goal_ahead_m: p.goal_ahead_m,
            obstacle_range_m: p.obstacle_range_m,
            clearance_m: p.clearance_m,
            lane_width_m: p.lane_width_m,
            horizon_s: p.horizon_s,
            collision: p.collision,
            outline: Outline::POINT,
        };
        self.replanner.plan(&mut self.search, &settings, request, budget)
    }
}

impl PathSearch for TreeSearch {
    fn search(
        &mut self,
        ground: &Ground<'_>,
        task: &Task,
        budget: &mut dyn Budget,
        path: &mut Vec<PathPoint>,
    ) -> bool {
        let p = self.params;
        let growth = Growth {
            step_m: p.step_m,
            iterations_max: p.iterations_max,
            goal_share: p.goal_share,
            guide_share: 0.0,
            gamma_m2: gamma_m2(task.bounds),
            radius_max_m: p.step_m,
            until: Until::Arrival(p.arrival_m),
        };
        let space = PointSpace { ground, bounds: task.bounds };
        let mut rng = Rng::keyed(task.seed, "rrt_star", &[]);
        let aim = Aim { start: task.start, goal: task.goal, bounds: task.bounds, guides: &[] };
        let found = self.tree.grow(&space, &growth, &aim, &mut rng, budget);
        if !found || self.tree.take_best(&mut self.poses).is_none() {
            return false;
        }
        turn_along(&mut self.poses);
        path.extend(with_curvature(&self.poses));
        true
    }
}

/// A point drawn evenly from x_min, y_min, x_max, y_max, metres.
pub(crate) fn draw_within(bounds: &[f64; 4], rng: &mut Rng) -> Pose2 {
    Pose2::new(rng.uniform(bounds[0], bounds[2]), rng.uniform(bounds[1], bounds[3]), 0.0)
}

/// `to`, or the point `step_m` towards it where it is farther off.
pub(crate) fn step_toward(from: Pose2, to: Pose2, step_m: f64) -> Pose2 {
    let way = to.point() - from.point();
    let length_m = way.norm();
    if length_m <= step_m {
        return to;
    }
    let point = from.point() + way * (step_m / length_m);
    Pose2::new(point.x_m, point.y_m, 0.0)
}

/// A point that turns on the spot: the original's idea of a car.
struct PointSpace<'a> {
    ground: &'a Ground<'a>,
    bounds: [f64; 4],
}

impl Space for PointSpace<'_> {
    fn draw(&self, rng: &mut Rng) -> Pose2 {
        draw_within(&self.bounds, rng)
    }

    fn length_m(&self, from: Pose2, to: Pose2) -> f64 {
        from.point().distance(to.point())
    }

    fn toward(&self, from: Pose2, to: Pose2, step_m: f64) -> Pose2 {
        step_toward(from, to, step_m)
    }

    fn free(&self, from: Pose2, to: Pose2, travelled_m: f64) -> bool {
        let way = to.point() - from.point();
        let piece = Piece { curvature_1pm: 0.0, length_m: way.norm() };
        let from = Pose2::new(from.x_m, from.y_m, way.heading());
        self.ground.piece_free(from, piece, travelled_m)
    }
}

/// Sets headings along the straight lines between the poses.
pub(crate) fn turn_along(poses: &mut [Pose2]) {
    for i in 0..poses.len() {
        let (a, b) = (poses[i.saturating_sub(1)], poses[(i + 1).min(poses.len() - 1)]);
        let way: Vector2 = if i == 0 { b.point() - poses[0].point() } else { b.point() - a.point() };
        poses[i] = Pose2::new(poses[i].x_m, poses[i].y_m, way.heading());
    }
}

#[cfg(test)]
mod tests {
    use swerve_geom::{Obb, Point2};
    use swerve_msg::PlanStatus;
    use swerve_planning::testing::{World, conformance};
    use swerve_planning::{Obstacles, Unlimited};

    use super::*;

    #[test]
    fn holds_what_every_planner_must() {
        conformance(&|| RrtStar::new(RrtStarParams::fast()).unwrap(), false);
        conformance(&|| RrtStar::new(RrtStarParams::slow()).unwrap(), false);
    }

    #[test]
    fn the_seed_decides() {
        let world = World::straight(16.0).with_person((25.0, 0.0), (0.0, 0.0));
        let plan = |seed| {
            let request = Request { seed, ..world.request() };
            RrtStar::new(RrtStarParams::fast()).unwrap().plan(&request, &mut Unlimited::default())
        };
        assert_eq!(plan(1), plan(1));
        assert_ne!(plan(1), plan(2));
    }

    #[test]
    fn the_car_is_taken_for_a_point() {
        let world = World::straight(16.0).with_person((25.0, 0.0), (0.0, 0.0));
        let mut planner = RrtStar::new(RrtStarParams::fast()).unwrap();
        let plan = planner.plan(&world.request(), &mut Unlimited::default());
        assert_eq!(plan.status, PlanStatus::Found);
        let boxes = Obstacles::new(&world.predictions, CollisionMode::TimeIndexed);
        for p in &plan.points {
            let point = Obb::new(p.pose, 0.0, 0.0);
            assert!(boxes.clearance_m(&point, p.at) >= 1.5 - 1e-9, "{p:?}");
        }
        let last = plan.points[plan.points.len() - 1];
        assert!(last.pose.point().distance(Point2::new(30.0, 0.0)) < 2.0);
        let far = World::straight(16.0).with_person((75.0, 0.0), (0.0, 0.0));
        let plan = planner.plan(&far.request(), &mut Unlimited::default());
        assert_eq!((plan.status, plan.work), (PlanStatus::Route, 0));
    }

    #[test]
    fn settings_out_of_range_are_named() {
        let bad = RrtStarParams { goal_share: 1.5, ..RrtStarParams::default() };
        assert_eq!(RrtStar::new(bad).unwrap_err().key, "goal_share");
    }
}
