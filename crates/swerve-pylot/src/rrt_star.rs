//! RRT* as in the original: a point among grown boxes, and the first path that comes near the goal.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{ParamError, Ranges, Rng};
use swerve_geom::{Point2, Pose2, Vector2};
use swerve_msg::Plan;
use swerve_planning::{Budget, CollisionMode, Planner, Request};

use crate::boxes::Sight;
use crate::closed_loop::{PathSearch, Replanner, Settings, Task, headed};
use crate::tree::{Aim, Growth, Tree};
use crate::{Original, Rules};

/// Parameters of the original's RRT* in the closed loop.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct RrtStarParams {
    /// Treatment of predicted motion in the collision check.
    pub collision: CollisionMode,
    /// Length of an extension, metres. Source: the paper (0.5 fast, 0.1 slow).
    #[schemars(range(min = 0.01, max = 100.0))]
    pub step_m: f64,
    /// Distance to the goal that counts as arrived, metres. Source: Pylot.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub arrival_m: f64,
    /// Growth of the search box around start and goal, metres. Source: Pylot.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub lane_width_m: f64,
    /// Fraction of the iterations that sample the goal. Source: Pylot.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub goal_share: f64,
    /// Largest number of iterations. Source: Pylot.
    #[schemars(range(min = 1, max = 100_000))]
    pub iterations_max: u64,
    /// Distance to keep from obstacles, metres; accounts for the car's width, as the car is a point. Source: Pylot.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub clearance_m: f64,
    /// Obstacles further away than this are ignored, metres. Source: Pylot.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub obstacle_range_m: f64,
    /// Distance of the goal ahead on the route, metres. Source: Pylot.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub goal_ahead_m: f64,
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
            collision: CollisionMode::SweptStatic,
            step_m: 0.5,
            arrival_m: 2.0,
            lane_width_m: 5.0,
            goal_share: 0.01,
            iterations_max: 2000,
            clearance_m: 1.5,
            obstacle_range_m: 10.0,
            goal_ahead_m: 30.0,
        }
    }

    /// The paper's slow configuration.
    pub fn slow() -> Self {
        Self { step_m: 0.1, ..Self::fast() }
    }
}

/// The planner, with storage that is reused between calls.
#[derive(Clone, Debug)]
pub struct RrtStar {
    params: RrtStarParams,
    rules: Rules,
    replanner: Replanner,
    search: TreeSearch,
}

/// The search with its reusable storage.
#[derive(Clone, Debug)]
struct TreeSearch {
    params: RrtStarParams,
    rewiring: bool,
    tree: Tree,
    points: Vec<Point2>,
}

impl RrtStar {
    /// Creates the planner from valid parameters and rules.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub fn new(params: RrtStarParams, rules: Rules) -> Result<Self, ParamError> {
        params.check_ranges()?;
        rules.validate(Original::RrtStar)?;
        let (tree, points) = (Tree::default(), Vec::new());
        let search = TreeSearch { params, rewiring: rules.rewiring, tree, points };
        Ok(Self { params, rules, replanner: Replanner::default(), search })
    }
}

impl Planner for RrtStar {
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

impl PathSearch for TreeSearch {
    fn search(&mut self, task: &Task<'_>, budget: &mut dyn Budget, path: &mut Vec<Pose2>) -> bool {
        let p = self.params;
        let growth = Growth {
            step_m: p.step_m,
            iterations_max: p.iterations_max,
            goal_share: p.goal_share,
            arrival_m: p.arrival_m,
            rewiring: self.rewiring,
            speed_mps: task.speed_mps,
        };
        let mut rng = Rng::keyed(task.seed, "rrt_star", &[]);
        let aim = Aim { start: task.start.point(), goal: task.goal.point(), bounds: task.bounds };
        let found = self.tree.grow(task.boxes, (&growth, &aim), &mut rng, budget, &mut self.points);
        headed(&self.points, task.start, path);
        found
    }
}

/// A point sampled uniformly from x_min, y_min, x_max, y_max, metres.
pub(crate) fn draw_within(bounds: &[f64; 4], rng: &mut Rng) -> Pose2 {
    Pose2::new(rng.uniform(bounds[0], bounds[2]), rng.uniform(bounds[1], bounds[3]), 0.0)
}

/// `to`, or the point `step_m` towards it if it is further away.
pub(crate) fn step_toward(from: Pose2, to: Pose2, step_m: f64) -> Pose2 {
    let way = to.point() - from.point();
    let length_m = way.norm();
    if length_m <= step_m {
        return to;
    }
    let point = from.point() + way * (step_m / length_m);
    Pose2::new(point.x_m, point.y_m, 0.0)
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
    use swerve_geom::Obb;
    use swerve_msg::PlanStatus;
    use swerve_planning::testing::{World, conformance};
    use swerve_planning::{Obstacles, Unlimited};

    use super::*;
    use crate::Era;

    fn planner(params: RrtStarParams) -> RrtStar {
        RrtStar::new(params, Rules::of(Era::May2020, Original::RrtStar)).unwrap()
    }

    /// A planner for which nothing to the left of a person is solid.
    fn open_to_the_left() -> RrtStar {
        let rules = Rules { solid_left: false, ..Rules::of(Era::May2020, Original::RrtStar) };
        RrtStar::new(RrtStarParams { obstacle_range_m: 30.0, ..RrtStarParams::fast() }, rules).unwrap()
    }

    #[test]
    fn original_rrt_star_conforms() {
        conformance(&|| planner(RrtStarParams { obstacle_range_m: 40.0, ..RrtStarParams::fast() }), false);
        conformance(&|| planner(RrtStarParams::slow()), false);
    }

    #[test]
    fn plan_depends_on_the_seed() {
        let world = World::straight(16.0).with_person((25.0, 0.0), (0.0, 0.0));
        let plan = |seed| {
            let request = Request { seed, ..world.request() };
            open_to_the_left().plan(&request, &mut Unlimited::default())
        };
        assert_eq!(plan(1), plan(1));
        assert_ne!(plan(1), plan(2));
    }

    #[test]
    fn car_is_a_point_that_keeps_to_the_right() {
        let world = World::straight(16.0).with_person((25.0, 0.0), (0.0, 0.0));
        let params = RrtStarParams { obstacle_range_m: 30.0, ..RrtStarParams::fast() };
        let plan = planner(params).plan(&world.request(), &mut Unlimited::default());
        assert_eq!(plan.status, PlanStatus::Found);
        let boxes = Obstacles::new(&world.predictions, CollisionMode::SweptStatic);
        for p in &plan.points {
            let middle = p.pose.ahead(world.shape.center_ahead_m());
            assert!(boxes.clearance_m(&Obb::new(middle, 0.0, 0.0), p.at) >= 1.3, "{p:?}");
            assert!((middle.x_m - 25.0).abs() > 1.0 || middle.y_m < 0.0, "{p:?}");
        }
        let last = plan.points[plan.points.len() - 1].pose.ahead(world.shape.center_ahead_m());
        assert!(last.point().distance(Point2::new(31.0, 0.0)) < 2.0, "{last:?}");
        let far = World::straight(16.0).with_person((75.0, 0.0), (0.0, 0.0));
        let plan = planner(params).plan(&far.request(), &mut Unlimited::default());
        assert_eq!((plan.status, plan.work), (PlanStatus::Route, 0));
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let bad = RrtStarParams { goal_share: 1.5, ..RrtStarParams::default() };
        let rules = Rules::of(Era::May2020, Original::RrtStar);
        assert_eq!(RrtStar::new(bad, rules).unwrap_err().key, "goal_share");
        let rules = Rules { steer_gain: 0.0, ..rules };
        assert_eq!(RrtStar::new(RrtStarParams::default(), rules).unwrap_err().key, "steer_gain");
    }
}
