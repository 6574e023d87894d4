//! The closed loop around a path search, shared by RRT* and Hybrid A*.

use swerve_core::Time;
use swerve_geom::{FrenetPoint, Pose2, angle_between, math};
use swerve_msg::{Plan, PlanStatus};
use swerve_vehicle::Limits;

use super::dubins::Dubins;
use super::ground::{Area, Clock, Ground, Outline, around};
use super::piece::Piece;
use super::points::{PathPoint, place_points};
use super::route::follow_route;
use super::speed::{SpeedProfile, timed_points};
use crate::collision::{CollisionMode, Obstacles};
use crate::fallback::{comfort_limits, give_way, keep_or_brake, kept};
use crate::request::{Budget, Counted, Request};
use crate::road::Road;

/// One search for a path between two poses.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Task<'a> {
    /// Request with the route to follow.
    pub(crate) request: &'a Request<'a>,
    /// Start pose.
    pub(crate) start: Pose2,
    /// Goal pose.
    pub(crate) goal: Pose2,
    /// Smallest turning radius, metres.
    pub(crate) radius_m: f64,
    /// Bounds of the planned point: x_min, y_min, x_max, y_max, metres.
    pub(crate) bounds: [f64; 4],
    /// True if the search may use all its iterations; false if a third of them, in later attempts of a call.
    pub(crate) thorough: bool,
}

/// The search of one planner.
pub(crate) trait PathSearch {
    /// Searches for a collision-free path with turns of the task's radius that ends at the goal pose itself; writes it
    /// to `pieces` and returns true if there is one.
    fn search(
        &mut self,
        ground: &Ground<'_>,
        task: &Task<'_>,
        budget: &mut dyn Budget,
        pieces: &mut Vec<Piece>,
    ) -> bool;
}

/// Settings that the planners share.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Settings {
    pub(crate) goal_ahead_m: f64,
    pub(crate) goal_ahead_s: f64,
    pub(crate) obstacle_range_m: f64,
    pub(crate) clearance_m: f64,
    pub(crate) horizon_s: f64,
    pub(crate) collision: CollisionMode,
}

/// Replans on every frame, with storage that is reused between calls; calls are independent of each other.
#[derive(Clone, Debug, Default)]
pub(crate) struct Replanner {
    obstacles: Obstacles,
    road: Road,
    pieces: Vec<Piece>,
    path: Vec<PathPoint>,
}

/// Distance to keep from the edge of the road, metres.
const EDGE_M: f64 = 0.05;

/// Fraction of the allowed lateral acceleration used in turns.
const LATERAL_SHARE: f64 = 0.9;

/// Turns are designed for the speed reached within this distance, metres.
const SPEED_AHEAD_M: f64 = 15.0;

impl Replanner {
    /// The route if it is free; otherwise a drivable path on the road around the obstacle and back to the route,
    /// checked against predicted motion; otherwise the last plan while it is free; otherwise full brake.
    pub(crate) fn plan(
        &mut self,
        search: &mut impl PathSearch,
        settings: &Settings,
        request: &Request<'_>,
        budget: &mut dyn Budget,
    ) -> Plan {
        self.road.set_near(request);
        let mut counted = Counted::new(budget);
        let modes = settings.collision.in_order();
        let mut found = None;
        for (k, &mode) in modes.iter().enumerate() {
            self.obstacles.set(request.predictions, mode);
            let last = k + 1 == modes.len() || !self.obstacles.any_may_stop();
            let limits = if last { *request.limits } else { comfort_limits(request) };
            let request = &Request { limits: &limits, ..*request };
            found = self
                .follow(settings, request)
                .or_else(|| {
                    let way = self.search(search, settings, request, last, &mut counted)?;
                    Some(self.own_lane_first(settings, request, way))
                })
                .or_else(|| self.otherwise(settings, request, last));
            if last || found.is_some() {
                break;
            }
        }
        let plan = found.expect("the last mode always has a plan");
        Plan { work: counted.spent, ..plan }
    }

    /// Fallback without a path: the previous plan or a stop if they are free; the `last` mode always returns a plan.
    fn otherwise(&self, settings: &Settings, request: &Request<'_>, last: bool) -> Option<Plan> {
        let obstacles = &self.obstacles;
        if last {
            return Some(keep_or_brake(request, obstacles, 0.0));
        }
        kept(request, obstacles, settings.clearance_m)
            .or_else(|| give_way(request, obstacles, settings.clearance_m))
    }

    /// A path that leaves the lane to meet oncoming traffic, or goes round a walking pedestrian, is the last choice,
    /// after the previous plan and a stop in the ego's own lane: the arcs of these paths begin with a steering step
    /// that the wheels cannot follow.
    fn own_lane_first(&self, settings: &Settings, request: &Request<'_>, way: Plan) -> Plan {
        let round_walker = request.somebody_walks() && request.leaves_lane(&way);
        if !round_walker && !request.meets_in_other_lane(&way) {
            return way;
        }
        let kept = kept(request, &self.obstacles, 0.0).filter(|plan| request.keeps_lane(plan));
        kept.or_else(|| give_way(request, &self.obstacles, settings.clearance_m))
            .filter(|plan| request.keeps_lane(plan))
            .unwrap_or(way)
    }

    /// The route itself, if the ego is on it and it is free.
    fn follow(&self, settings: &Settings, request: &Request<'_>) -> Option<Plan> {
        let start = request.start.pose;
        let FrenetPoint { s_m, d_m } = request.place();
        let off_rad = angle_between(request.route.line().at(s_m).pose.heading_rad, start.heading_rad);
        if d_m.abs() > 0.1 || off_rad.abs() > 0.02 {
            return None;
        }
        let clear = !request.obstacle_in_range(settings.obstacle_range_m);
        let status = if clear { PlanStatus::Route } else { PlanStatus::Found };
        let plan = follow_route(request, SpeedProfile::Limited, settings.horizon_s, status);
        self.plan_free(&plan, request, settings.clearance_m).then_some(plan)
    }

    /// A path around the obstacle; only the `last` mode accepts less than the requested clearance.
    fn search(
        &mut self,
        search: &mut impl PathSearch,
        settings: &Settings,
        request: &Request<'_>,
        last: bool,
        budget: &mut Counted<'_>,
    ) -> Option<Plan> {
        let outline = own_outline(request);
        let Margins { clearance_m, edge_m } = self.margins(settings, request, &outline)?;
        let ahead_m = settings.goal_ahead_m.max(settings.goal_ahead_s * request.start.speed_mps);
        let from_s_m = request.place().s_m;
        // Full braking is not released for a path with less than the requested clearance.
        let braking = request.previous.is_some_and(|plan| plan.status == PlanStatus::Brake);
        let exactly = braking || !last;
        for attempt in ATTEMPTS.iter().filter(|attempt| !exactly || attempt.clearance == 1.0) {
            let target_mps = attempt.target_mps(request);
            let limits = Limits { brake_max_mps2: attempt.brake(request.limits), ..*request.limits };
            let slowed = Request { target_speed_mps: target_mps, limits: &limits, ..*request };
            let mut searches = 0;
            for (stretch, d_m) in GOALS {
                if searches == attempt.searches || budget.stopped {
                    break;
                }
                let s_m = from_s_m + ahead_m * stretch;
                let clearance_m = clearance_m * attempt.clearance;
                let profile = attempt.profile();
                let demands = Demands { clearance_m, edge_m, outline, thorough: attempt.thorough(), profile };
                match self.reach(search, &slowed, demands, FrenetPoint { s_m, d_m }, budget) {
                    Outcome::NoGoal => {}
                    Outcome::NoWay => searches += 1,
                    Outcome::Way(plan) => return Some(plan),
                }
            }
        }
        None
    }

    /// A path to one goal, with the speeds of `request`.
    fn reach(
        &mut self,
        search: &mut impl PathSearch,
        request: &Request<'_>,
        Demands { clearance_m, edge_m, outline, thorough, profile }: Demands,
        at: FrenetPoint,
        budget: &mut Counted<'_>,
    ) -> Outcome {
        let (start, line) = (request.start.pose, request.route.line());
        let radius_m = turning_radius_m(request);
        let point = line.to_map(at);
        let goal = Pose2::new(point.x_m, point.y_m, line.at(at.s_m).pose.heading_rad);
        let bounds = around(&[start, goal], request.route.borders().farthest_m() + 2.0);
        let ground = Ground {
            obstacles: &self.obstacles,
            clearance_m,
            outline,
            area: Area::Road { road: &self.road, margin_m: edge_m, bounds },
            clock: clock(request, profile),
        };
        let direct = Dubins::shortest(start, goal, radius_m);
        if !ground.pose_free(goal, direct.length()) {
            return Outcome::NoGoal;
        }
        let task = Task { request, start, goal, radius_m, bounds, thorough };
        let found = search.search(&ground, &task, budget, &mut self.pieces)
            && ground.free_exactly(start, &self.pieces);
        if !found {
            return Outcome::NoWay;
        }
        let plan = self.timed(request, profile);
        let free = self.plan_free(&plan, request, (clearance_m - TIMING_M).max(0.0));
        if free { Outcome::Way(plan) } else { Outcome::NoWay }
    }

    /// Clearance and distance from the edge of the road to keep: the requested ones, or those of the start if smaller.
    /// `None` if the start already collides.
    fn margins(&self, settings: &Settings, request: &Request<'_>, outline: &Outline) -> Option<Margins> {
        let pose = request.start.pose;
        let (sin, cos) = math::sin_cos(pose.heading_rad);
        let solid = outline.at(pose.point(), [cos, sin]);
        let wanted_m = settings.clearance_m;
        let has_m = self.obstacles.distance_below(&solid, request.start.stamp, 2.0 * wanted_m + 1.0);
        let edge_m = EDGE_M.min(self.road.margin_m(&solid) - TIMING_M);
        (has_m > 0.0).then(|| Margins { clearance_m: wanted_m.min(0.8 * has_m - TIMING_M).max(0.0), edge_m })
    }

    /// The plan along `pieces`.
    fn timed(&mut self, request: &Request<'_>, profile: SpeedProfile) -> Plan {
        self.path.clear();
        place_points(request.start.pose, &self.pieces, &mut self.path);
        let (path, target_mps) = (&self.path, request.target_speed_mps);
        let points = timed_points(path, &request.start, target_mps, profile, request.limits);
        Plan { stamp: request.stamp, status: PlanStatus::Found, points, work: 0 }
    }

    /// Returns true if a plan is collision-free at its own times.
    fn plan_free(&self, plan: &Plan, request: &Request<'_>, clearance_m: f64) -> bool {
        let path: Vec<(Pose2, Time)> = plan.points.iter().map(|p| (p.pose, p.at)).collect();
        self.obstacles.path_free(|pose| request.shape.footprint(pose), &path, clearance_m)
    }
}

/// Goals in the order in which they are tried: fraction of the requested distance, and offset from the line, metres.
/// Further on there is more room to return to the line behind the obstacle.
const GOALS: [(f64, f64); 8] =
    [(1.0, 0.0), (1.5, 0.0), (1.0, 1.0), (1.0, -1.0), (1.0, 2.0), (1.0, -2.0), (1.0, 3.0), (1.0, 4.0)];

/// Distances that a path has to keep.
struct Margins {
    /// From obstacles, metres.
    clearance_m: f64,
    /// From the edge of the road, metres.
    edge_m: f64,
}

/// Conditions on a path, and the extent of the search.
#[derive(Clone, Copy, Debug)]
struct Demands {
    /// Distance to keep from obstacles, metres.
    clearance_m: f64,
    /// Distance to keep from the edge of the road, metres.
    edge_m: f64,
    /// The moving outline.
    outline: Outline,
    /// True if the search may use all its iterations.
    thorough: bool,
    /// Speed profile along the path.
    profile: SpeedProfile,
}

/// The result for one goal.
enum Outcome {
    /// The goal itself collides.
    NoGoal,
    /// No path to it was found.
    NoWay,
    /// A plan that reaches it.
    Way(Plan),
}

/// One attempt to drive around an obstacle.
struct Attempt {
    /// Deceleration during the manoeuvre, m/s².
    brake_mps2: f64,
    /// Fraction of the clearance that is kept.
    clearance: f64,
    /// Largest number of goals that are searched for.
    searches: usize,
}

/// The attempts, from the most to the least comfortable: at the target speed, while braking, and both again with less
/// clearance.
const ATTEMPTS: [Attempt; 6] = [
    Attempt { brake_mps2: 0.0, clearance: 1.0, searches: 3 },
    Attempt { brake_mps2: 3.0, clearance: 1.0, searches: 1 },
    Attempt { brake_mps2: 6.0, clearance: 1.0, searches: 1 },
    Attempt { brake_mps2: 0.0, clearance: 0.4, searches: 1 },
    Attempt { brake_mps2: 3.0, clearance: 0.4, searches: 1 },
    Attempt { brake_mps2: 6.0, clearance: 0.4, searches: 1 },
];

/// Duration of the braking, seconds, and lower bound on the speed as a fraction of the initial speed.
const BRAKING_S: f64 = 1.5;
const SLOWEST: f64 = 0.4;

impl Attempt {
    /// Returns true if searches may use all their iterations: in the first attempt.
    fn thorough(&self) -> bool {
        self.brake_mps2 == 0.0 && self.clearance == 1.0
    }

    /// Speed profile towards the target speed.
    fn profile(&self) -> SpeedProfile {
        if self.brake_mps2 > 0.0 { SpeedProfile::Braking } else { SpeedProfile::Limited }
    }

    /// Target speed, m/s.
    fn target_mps(&self, request: &Request<'_>) -> f64 {
        let (v0, target_mps) = (request.start.speed_mps.max(0.0), request.target_speed_mps);
        let slowed_mps = (v0 - self.brake_mps2 * BRAKING_S).max(SLOWEST * v0);
        if self.brake_mps2 > 0.0 { target_mps.min(slowed_mps) } else { target_mps }
    }

    /// Largest deceleration, m/s².
    fn brake(&self, limits: &Limits) -> f64 {
        if self.brake_mps2 > 0.0 { self.brake_mps2.min(limits.brake_max_mps2) } else { limits.brake_max_mps2 }
    }
}

/// Allowance for chords instead of arcs and for the plan's times against the search's, metres.
const TIMING_M: f64 = 0.05;

/// The actual outline of the car.
fn own_outline(request: &Request<'_>) -> Outline {
    Outline {
        half_length_m: 0.5 * request.shape.length_m,
        half_width_m: 0.5 * request.shape.width_m,
        center_ahead_m: request.shape.center_ahead_m(),
    }
}

/// Arrival times: those of [`timed_points`] if no turn requires less speed.
fn clock(request: &Request<'_>, profile: SpeedProfile) -> Clock {
    let (speed_mps, target_mps) = (request.start.speed_mps, request.target_speed_mps);
    let limits = request.limits;
    let accel_mps2 = if target_mps >= speed_mps { limits.accel_max_mps2 } else { profile.ease_mps2(limits) };
    Clock { start: request.start.stamp, speed_mps, target_mps, accel_mps2 }
}

/// Smallest turning radius, metres: bounded by the steering and by the lateral acceleration at the expected speed.
fn turning_radius_m(request: &Request<'_>) -> f64 {
    let limits = request.limits;
    let v0 = request.start.speed_mps.max(0.0);
    let reached = (v0 * v0 + 2.0 * limits.accel_max_mps2 * SPEED_AHEAD_M).sqrt();
    let speed_mps = v0.max(request.target_speed_mps.min(reached));
    let steered_m = request.shape.wheelbase_m / math::tan(limits.steering_max_rad);
    (speed_mps * speed_mps / (LATERAL_SHARE * limits.lateral_accel_max_mps2)).max(1.01 * steered_m)
}
