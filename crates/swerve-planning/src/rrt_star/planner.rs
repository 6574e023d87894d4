//! The planner in the closed loop.

use serde::{Deserialize, Serialize};
use swerve_core::Rng;
use swerve_geom::{FrenetPoint, Pose2, Vector2};
use swerve_msg::Plan;

use super::space::{PointSpace, RoadSpace};
use super::tree::{Aim, Growth, Tree, Until};
use crate::collision::CollisionMode;
use crate::hybrid_astar::dubins::{Dubins, Piece};
use crate::hybrid_astar::ground::{Ground, Outline};
use crate::hybrid_astar::on_road::{Desk, OnRoad, PathSearch, Task};
use crate::hybrid_astar::search::join;
use crate::hybrid_astar::shorten::Shortener;
use crate::params::{InvalidParam, require, require_not_negative, require_positive};
use crate::posed::Preset;
use crate::request::{Budget, Planner, Request};
use crate::world::{PathPoint, with_curvature};

/// Settings of RRT* in the closed loop.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Which limits the planner has.
    pub preset: Preset,
    /// How predicted motion enters the collision check.
    pub collision: CollisionMode,
    /// `paper`: length of an extension, metres.
    pub step_m: f64,
    /// `paper`: distance to the goal that counts as arrived, metres.
    pub arrival_m: f64,
    /// `paper`: growth of the search box around start and goal, metres. `best` searches the road.
    pub lane_width_m: f64,
    /// Share of the iterations that aim at the goal.
    pub goal_share: f64,
    /// Iterations of one search at most; `best` may search again with other goals, three times in all, and then with
    /// a third of them while braking or nearer to what is in the way, five times in all.
    pub iterations_max: u64,
    /// Distance to keep from obstacles, metres; `paper` plans for a point, so it holds the car's width too.
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
            step_m: 0.5,
            arrival_m: 2.0,
            lane_width_m: 5.0,
            goal_share: 0.01,
            iterations_max: 2000,
            clearance_m: 1.5,
            obstacle_range_m: 70.0,
            goal_ahead_m: 30.0,
            goal_ahead_s: 0.0,
            horizon_s: 5.0,
        };
        match preset {
            Preset::Paper => paper,
            Preset::Best => {
                Self { goal_share: 0.1, iterations_max: 300, clearance_m: 0.3, goal_ahead_s: 3.0, ..paper }
            }
        }
    }

    /// The paper's slow configuration.
    pub fn slow(preset: Preset) -> Self {
        Self { step_m: 0.1, ..Self::fast(preset) }
    }

    /// Checks all ranges.
    pub fn validate(&self) -> Result<(), InvalidParam> {
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
            ("goal_ahead_s", self.goal_ahead_s),
        ] {
            require_not_negative(key, value)?;
        }
        let share = self.goal_share;
        require("goal_share", share, (0.0..=1.0).contains(&share), "must be 0 to 1")?;
        let n = self.iterations_max;
        require("iterations_max", n as f64, (1..=ITERATIONS_MAX).contains(&n), "must be 1 to 100,000")
    }
}

/// Most iterations that may be asked for: they bound the memory.
const ITERATIONS_MAX: u64 = 100_000;

/// RRT* as a motion planner.
#[derive(Clone, Debug)]
pub struct RrtStar {
    params: Params,
    desk: Desk,
    trees: TreeSearch,
}

/// The two searches with their memory.
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
    /// With valid settings.
    pub fn new(params: Params) -> Result<Self, InvalidParam> {
        params.validate()?;
        let trees = TreeSearch {
            params,
            tree: Tree::default(),
            shortener: Shortener::default(),
            guides: Vec::new(),
            poses: Vec::new(),
            pieces: Vec::new(),
        };
        Ok(Self { params, desk: Desk::default(), trees })
    }

    /// The settings.
    pub fn params(&self) -> &Params {
        &self.params
    }

    fn on_road(&self) -> OnRoad {
        let p = &self.params;
        OnRoad {
            goal_ahead_m: p.goal_ahead_m,
            goal_ahead_s: p.goal_ahead_s,
            obstacle_range_m: p.obstacle_range_m,
            clearance_m: p.clearance_m,
            lane_width_m: p.lane_width_m,
            horizon_s: p.horizon_s,
            collision: p.collision,
            outline: Outline::POINT,
        }
    }
}

impl Planner for RrtStar {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let settings = self.on_road();
        match self.params.preset {
            Preset::Paper => self.desk.plan_paper(&mut self.trees, &settings, request, budget),
            Preset::Best => self.desk.plan_best(&mut self.trees, &settings, request, budget),
        }
    }
}

/// `gamma` of the rewiring radius in two dimensions for a free area: `4 (1 + 1/2) area` (Karaman and Frazzoli,
/// theorem 38).
pub(crate) fn gamma_m2([x_min, y_min, x_max, y_max]: [f64; 4]) -> f64 {
    6.0 * (x_max - x_min) * (y_max - y_min)
}

impl PathSearch for TreeSearch {
    fn paper(
        &mut self,
        ground: &Ground<'_>,
        task: &Task<'_>,
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
        let mut rng = Rng::keyed(task.request.seed, "rrt_star", &[]);
        let aim = Aim { start: task.start, goal: task.goal, bounds: task.bounds, guides: &[] };
        let found = self.tree.grow(&space, &growth, &aim, &mut rng, budget);
        if !found || self.tree.take_best(&mut self.poses).is_none() {
            return false;
        }
        turn_along(&mut self.poses);
        path.extend(with_curvature(&self.poses));
        true
    }

    fn best(
        &mut self,
        ground: &Ground<'_>,
        task: &Task<'_>,
        budget: &mut dyn Budget,
        pieces: &mut Vec<Piece>,
    ) -> bool {
        let p = self.params;
        let line = task.request.route.line();
        let space = RoadSpace {
            ground,
            route: task.request.route,
            radius_m: task.radius_m,
            from_s_m: line.project(task.start.point()).s_m,
            to_s_m: line.project(task.goal.point()).s_m,
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
        // Rewiring moves arrivals forward, so a path that was free piece by piece may not be: the best that is.
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
    /// Poses along the road on either side of where each obstacle will be while the ego comes by, along the road and
    /// turned to that side: what moves across is cleared where it is worst, at the front or at the rear.
    fn place_guides(&mut self, space: &RoadSpace<'_>, ground: &Ground<'_>, task: &Task<'_>) {
        self.guides.clear();
        let line = task.request.route.line();
        let outline = &ground.outline;
        let beside_m = outline.half_width_m + ground.clearance_m + GUIDE_SPARE_M;
        for prediction in task.request.predictions {
            let half_m = 0.5 * prediction.extent.length_m.max(prediction.extent.width_m);
            let passing_m = outline.half_length_m + half_m;
            let (mut s_m, mut d_m) = (space.from_s_m, [0.0; 2]);
            // Twice suffices: where it is now tells when the ego comes by, and that tells where it will be then.
            let mut at = line.project(prediction.path[0].pose.point());
            for _ in 0..2 {
                s_m = at.s_m - outline.center_ahead_m;
                let then = |further_m: f64| {
                    let travelled_m = (s_m + further_m - space.from_s_m).max(0.0);
                    line.project(prediction.pose_at(ground.clock.at(travelled_m)).point())
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

/// Guides are this much further from obstacles than the clearance, metres.
const GUIDE_SPARE_M: f64 = 0.1;

/// Directions of guides against the road's, to their side, radians.
const GUIDE_OFF_RAD: [f64; 3] = [0.0, 0.1, 0.2];

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
    use super::*;
    use crate::collision::Obstacles;
    use crate::request::Unlimited;
    use crate::testing::{World, conformance, minds_walkers};
    use swerve_geom::{Obb, Point2};
    use swerve_msg::PlanStatus;

    #[test]
    fn holds_what_every_planner_must() {
        conformance(&|| RrtStar::new(Params::fast(Preset::Best)).unwrap(), true);
        conformance(&|| RrtStar::new(Params::fast(Preset::Paper)).unwrap(), false);
        conformance(&|| RrtStar::new(Params::slow(Preset::Paper)).unwrap(), false);
    }

    #[test]
    fn minds_walkers_who_may_stop() {
        minds_walkers(&|collision| RrtStar::new(Params { collision, ..Params::default() }).unwrap());
    }

    #[test]
    fn swerves_around_a_person_and_back() {
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
    fn finds_the_gap_where_a_person_steps_out() {
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
        // Random trees may miss a gap of a few decimetres, but seldom.
        assert!(found >= 22, "{found} of 24");
    }

    #[test]
    fn the_seed_decides() {
        let world = World::straight(16.0).with_person((25.0, 0.0), (0.0, 0.0));
        let plan = |seed, preset| {
            let request = Request { seed, ..world.request() };
            RrtStar::new(Params::fast(preset)).unwrap().plan(&request, &mut Unlimited::default())
        };
        assert_eq!(plan(1, Preset::Paper), plan(1, Preset::Paper));
        assert_ne!(plan(1, Preset::Paper), plan(2, Preset::Paper));
        assert_eq!(plan(1, Preset::Best), plan(1, Preset::Best));
    }

    #[test]
    fn paper_takes_the_car_for_a_point() {
        let world = World::straight(16.0).with_person((25.0, 0.0), (0.0, 0.0));
        let mut planner = RrtStar::new(Params::fast(Preset::Paper)).unwrap();
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
        let bad = Params { goal_share: 1.5, ..Params::default() };
        assert_eq!(RrtStar::new(bad).unwrap_err().key, "goal_share");
    }
}
