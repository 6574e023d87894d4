//! Frenet optimal trajectories (Werling, Ziegler, Kammel, Thrun: Optimal Trajectory Generation for Dynamic
//! Street Scenarios in a Frenét Frame, ICRA 2010).
//!
//! Candidates are all combinations of an end offset, an end speed and an end time: quintics across the line, quartics
//! along it. Costs are those of the original planner (Pylot's), so that results are comparable; `search.rs` explains
//! how the cheapest valid candidate is found without building all of them.

pub mod candidate;
mod follow;
mod lateral;
pub mod lattice;
pub mod line;
pub mod motion;
mod nearness;
mod params;
pub(crate) mod poly;
pub mod search;
mod task;

pub use params::Params;
pub(crate) use params::WEIGHT_MAX;

use swerve_core::{Span, Time};
use swerve_geom::{Pose2, math};
use swerve_msg::{Plan, PlanPoint, PlanStatus};

use crate::brake::way_ahead;
use crate::collision::{CollisionMode, Obstacles, Solid};
use crate::fallback::{comfort_limits, give_way, keep_or_brake, kept};
use crate::lane::stretch;
pub use crate::lock::curvature_max_1pm;
use crate::path::route::PATH_STEP_M;
use crate::request::{Budget, Counted, Planner, Request};
use crate::road::Road;
use candidate::{Candidate, Outcome};
pub use lateral::FrenetState;
use lattice::Lattice;
use line::{Line, OnLine, RouteLine};
use motion::{Checks, Drivable, MotionState};
use poly::Quintic;
use search::Search;
use swerve_core::param::ParamError;
use task::Task;

/// Largest time step of a plan, seconds.
const POINT_STEP_S: f64 = 0.1;

/// A path continued beyond a plan's end turns into the line's direction over this distance, metres.
const TURN_IN_M: f64 = 15.0;

/// Largest angle to the line from which such a path turns in, radians.
const TURN_MAX_RAD: f64 = 0.5;

/// Fraction of the clearance that suffices in the ego's lane before a plan meets oncoming traffic in the other lane.
const CLOSER: f64 = 0.4;

/// Distance of the right-most candidate from the limit at the edge of the road, metres: during a lateral move of half a
/// metre in 2 s the front corner, 3.8 m ahead, swings 0.03 m beyond the end at 12 m/s.
const EDGE_SWING_M: f64 = 0.05;

/// Below this speed lateral motion is a function of arc length, m/s.
const LOW_MPS: f64 = 4.0;

/// Below this speed the curvature is taken from the steering angle, as the yaw rate is not informative, m/s.
const WHEELS_MPS: f64 = 1.0;

/// Cosine of the largest angle to the line from which lateral motion is a function of arc length.
const COS_MIN: f64 = 0.3;

/// Frenet planner with storage that is reused between calls; calls are independent of each other.
#[derive(Clone, Debug)]
pub struct Fot {
    params: Params,
    search: Search,
    lattice: Lattice,
    coarse: Lattice,
    line: RouteLine,
    road: Road,
    obstacles: Obstacles,
}

impl Fot {
    /// Creates the planner from valid parameters.
    pub fn new(params: Params) -> Result<Self, ParamError> {
        params.validate()?;
        Ok(Self {
            params,
            search: Search::default(),
            lattice: Lattice::default(),
            coarse: Lattice::default(),
            line: RouteLine::default(),
            road: Road::default(),
            obstacles: Obstacles::default(),
        })
    }

    /// As [`new`](Self::new), along a line whose corners are smoothed over `ease_m` before and after each place.
    pub(crate) fn eased(params: Params, ease_m: f64) -> Result<Self, ParamError> {
        Ok(Self { line: RouteLine::eased(ease_m), ..Self::new(params)? })
    }

    /// The parameters.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// Sets route and obstacles.
    fn set_world(&mut self, request: &Request<'_>, collision: CollisionMode) {
        self.line.follow(request.route.line());
        self.road.set_near(request);
        let center = request.start.pose.point();
        self.obstacles.set_near(request.predictions, collision, center, self.params.obstacle_range_m);
    }

    /// The start in the Frenet frame.
    fn frenet(&self, request: &Request<'_>) -> FrenetState {
        let start = &request.start;
        let OnLine { s_m, d_m, node, turn_rad } = self.line.locate_from(start.pose, request.place().s_m);
        let (sin, cos) = math::sin_cos(turn_rad);
        let speed_mps = start.speed_mps.max(0.0);
        let limits = request.limits;
        // An ego that is almost at rest cannot continue braking hard without rolling back.
        let hardest = limits.brake_max_mps2.min(2.0 * speed_mps);
        let along = start.accel_mps2.clamp(-hardest, limits.accel_max_mps2);
        let lateral_max = limits.lateral_accel_max_mps2;
        let across = (speed_mps * start.yaw_rate_radps).clamp(-lateral_max, lateral_max);
        // Velocity and acceleration rotated into the line's axes, then corrected for the rotation of the line (second
        // derivative of r(s) + d n, solved for s and d).
        let stretch = (1.0 - node.curvature_1pm * d_m).max(0.1);
        let (s1, d1) = (speed_mps * cos / stretch, speed_mps * sin);
        let (accel_t, accel_n) = (along * cos - across * sin, along * sin + across * cos);
        let turning = s1 * (node.bend_1pm2 * s1 * d_m + 2.0 * node.curvature_1pm * d1);
        let s2 = (accel_t + turning) / stretch;
        let d2 = accel_n - node.curvature_1pm * s1 * s1 * stretch;
        let d_by_s = if speed_mps < LOW_MPS && cos > COS_MIN {
            // Heading and curvature as derivatives by arc length: properties of the path, independent of the speed.
            let slope = stretch * sin / cos;
            let length = stretch / cos;
            let curvature = standing_curvature_1pm(request, speed_mps);
            let narrows = node.bend_1pm2 * d_m + 2.0 * node.curvature_1pm * slope;
            let bend = (curvature * length * length * length - slope * narrows) / stretch;
            Some([d_m, slope, bend - node.curvature_1pm * stretch])
        } else {
            None
        };
        FrenetState { s: [s_m, s1, s2], d: [d_m, d1, d2], d_by_s }
    }

    /// Target speed, changed no more than the limits allow within the earliest end time.
    fn target(&self, request: &Request<'_>) -> f64 {
        let target_mps = request.target_speed_mps.min(self.params.max_speed_mps);
        // From and to zero acceleration, a quartic peaks at 1.5 times its mean.
        let within_s = 0.9 * self.params.horizon_min_s / 1.5;
        let v = request.start.speed_mps.max(0.0);
        let slowest = (v - within_s * request.limits.brake_max_mps2).max(0.0);
        target_mps.clamp(slowest, v + within_s * request.limits.accel_max_mps2)
    }
}

impl Planner for Fot {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let mut counted = Counted::new(budget);
        let collision = self.params.collision;
        let modes = collision.in_order();
        let mut found = None;
        for (k, &mode) in modes.iter().enumerate() {
            self.set_world(request, mode);
            let last = k + 1 == modes.len() || !self.obstacles.any_may_stop();
            let limits = if last { *request.limits } else { comfort_limits(request) };
            found = self.plan_among(&Request { limits: &limits, ..*request }, last, &mut counted);
            if last || found.is_some() {
                break;
            }
        }
        let plan = found.expect("the last mode always has a plan");
        Plan { work: counted.spent, ..plan }
    }
}

impl Fot {
    /// Place of the start along the route's line.
    pub(crate) fn place(&mut self, request: &Request<'_>) -> OnLine {
        self.line.follow(request.route.line());
        self.road.set_near(request);
        self.line.locate_from(request.start.pose, request.place().s_m)
    }

    /// The line of the last route.
    pub(crate) fn line(&self) -> &Line {
        self.line.line()
    }

    /// Sets the range of candidate end offsets, metres: to the left of the line, and to its right.
    pub(crate) fn set_offsets(&mut self, left_m: f64, right_m: f64) {
        (self.params.left_m, self.params.right_m) = (left_m, right_m);
    }

    /// Sets the gap for stopping behind an obstacle in the way, metres.
    pub(crate) fn set_follow_gap(&mut self, gap_m: f64) {
        self.params.follow_gap_m = gap_m;
    }

    /// The cheapest valid plan at about the target speed, with the first of the collision modes; without fallback.
    pub(crate) fn at_speed(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Option<Plan> {
        self.set_world(request, self.params.collision.in_order()[0]);
        self.search(request, |search, task, lattice, _| {
            search.run(task, lattice, Some(&mut *budget), &mut 0).found()
        })
    }

    /// The cheapest valid plan behind the obstacle in the way, or slower than the target; without fallback.
    pub(crate) fn slower(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Option<Plan> {
        self.set_world(request, self.params.collision.in_order()[0]);
        self.search(request, |search, task, lattice, other| behind(search, task, lattice, other, budget))
    }

    /// Obstacles of the last search.
    pub(crate) fn obstacles(&self) -> &Obstacles {
        &self.obstacles
    }

    /// Rest of the previous plan's path from the start on, continued from its end parallel to the line for `further_m`,
    /// turning into the line's direction over [`TURN_IN_M`].
    pub(crate) fn way_on(&self, request: &Request<'_>, further_m: f64) -> Vec<Pose2> {
        let mut poses = way_ahead(request);
        let last = *poses.last().unwrap_or(&request.start.pose);
        let way_m: f64 = poses.windows(2).map(|two| two[0].point().distance(two[1].point())).sum();
        let end = self.line.locate_from(last, request.place_of(last.point(), way_m).s_m);
        let slope = stretch(&end) * math::tan(end.turn_rad.clamp(-TURN_MAX_RAD, TURN_MAX_RAD));
        // Half of the distance that it would deviate unchanged.
        let to_m = end.d_m + 0.5 * TURN_IN_M * slope;
        let offset = Quintic::new([end.d_m, slope, 0.0], [to_m, 0.0, 0.0], TURN_IN_M);
        let steps = (further_m / PATH_STEP_M).ceil() as usize;
        poses.extend((1..=steps).map(|k| {
            let along_m = k as f64 * PATH_STEP_M;
            let node = self.line.line().at(end.s_m + along_m);
            let aside = offset.at(along_m.min(TURN_IN_M));
            let (x_m, y_m) = (node.x_m - node.sin * aside.x, node.y_m + node.cos * aside.x);
            let turn_rad = math::atan2(aside.v, 1.0 - node.curvature_1pm * aside.x);
            Pose2::new(x_m, y_m, math::atan2(node.sin, node.cos) + turn_rad)
        }));
        poses
    }

    /// Returns true if the ego stays on the drivable ground at all `poses`, with the margin of a plan or that of the
    /// first pose.
    pub(crate) fn keeps_road(&self, request: &Request<'_>, poses: &[(Pose2, Time)]) -> bool {
        let solid = |pose: Pose2| Solid::from(&request.shape.footprint(pose));
        let start_m = poses.first().map_or(0.0, |first| self.road.margin_m(&solid(first.0)));
        let needed_m = self.params.road_margin_m.min(start_m - 0.02);
        poses.iter().all(|&(pose, _)| self.road.keeps(&solid(pose), needed_m))
    }

    /// Plan among the current obstacles; if there is none, the last mode falls back.
    fn plan_among(&mut self, request: &Request<'_>, last: bool, budget: &mut Counted<'_>) -> Option<Plan> {
        let found = self.anytime(request, budget);
        let Self { params, obstacles, .. } = self;
        found.or_else(|| {
            if last {
                Some(keep_or_brake(request, obstacles, 0.0))
            } else {
                kept(request, obstacles, params.clearance_m)
                    .or_else(|| give_way(request, obstacles, params.clearance_m))
            }
        })
    }

    /// The cheapest valid candidate, or the best within the budget. A plan that meets oncoming traffic in the other
    /// lane is the last choice, after candidates in the ego's own lane.
    fn anytime(&mut self, request: &Request<'_>, budget: &mut Counted<'_>) -> Option<Plan> {
        let found = self.among_all(request, budget)?;
        if !request.meets_in_other_lane(&found) {
            return Some(found);
        }
        self.in_own_lane(request, budget)
            .or_else(|| kept(request, &self.obstacles, 0.0).filter(|plan| request.keeps_lane(plan)))
            .or(Some(found))
    }

    /// The cheapest valid candidate between the left line of the ego's lane and the right edge of the road, with a
    /// fraction of the clearance if none keeps all of it.
    fn in_own_lane(&mut self, request: &Request<'_>, budget: &mut Counted<'_>) -> Option<Plan> {
        let (place, wanted) = (request.place(), self.params);
        let right_m = request.route.right_m(place.s_m) - 0.5 * request.shape.width_m - wanted.road_margin_m;
        let right_m = wanted.right_m.min(right_m - EDGE_SWING_M);
        let left_m = wanted.left_m.min(request.rest_left_m(place.s_m)).max(-right_m);
        let found = [1.0, CLOSER].into_iter().find_map(|share| {
            let clearance_m = share * wanted.clearance_m;
            self.params = Params { left_m, right_m, clearance_m, ..wanted };
            self.among_all(request, budget)
        });
        self.params = wanted;
        found
    }

    /// The cheapest valid candidate of the lattice, or the best within the budget.
    fn among_all(&mut self, request: &Request<'_>, budget: &mut Counted<'_>) -> Option<Plan> {
        self.search(request, |search, task, lattice, coarse| anytime(search, task, lattice, coarse, budget))
    }

    /// Runs `look` among the current obstacles and returns its result as a plan.
    fn search(
        &mut self,
        request: &Request<'_>,
        look: impl FnOnce(&mut Search, &Task<'_>, &Lattice, &mut Lattice) -> Option<Candidate>,
    ) -> Option<Plan> {
        let start = self.frenet(request);
        let target_mps = self.target(request);
        self.lattice.set(&self.params, target_mps);
        self.lattice.drop_reverse();
        let Self { params, search, lattice, coarse, line, road, obstacles } = self;
        let checks = checks(params, request, obstacles, road);
        let line = line.line();
        let task = Task { params, line, cut_m: f64::INFINITY, start, target_mps, checks };
        look(search, &task, lattice, coarse).map(|candidate| to_plan(&task, &candidate, request))
    }
}

/// Searches a few candidates first, then all; returns the best so far when the budget ends. If all fail, candidates
/// that stop or follow behind the obstacle in the way, then slower ones.
pub fn anytime(
    search: &mut Search,
    task: &Task<'_>,
    lattice: &Lattice,
    coarse: &mut Lattice,
    budget: &mut dyn Budget,
) -> Option<Candidate> {
    let spent = &mut 0;
    coarse.set_coarse(lattice);
    let first = match search.run(task, coarse, Some(budget), spent) {
        Outcome::Found(candidate) => Some(candidate),
        Outcome::Nothing => None,
        Outcome::Stopped => return None,
    };
    // The coarse candidate is contained in the full lattice.
    let known_cost = first.map_or(f64::INFINITY, |candidate| candidate.cost);
    match search.run_below(task, lattice, known_cost, budget, spent) {
        Outcome::Found(candidate) => return Some(candidate),
        Outcome::Stopped => return first,
        Outcome::Nothing => {}
    }
    behind(search, task, lattice, coarse, budget)
}

/// Candidates that stop or follow behind the obstacle in the way, then slower ones.
fn behind(
    search: &mut Search,
    task: &Task<'_>,
    lattice: &Lattice,
    other: &mut Lattice,
    budget: &mut dyn Budget,
) -> Option<Candidate> {
    let spent = &mut 0;
    if task.params.follow_gap_m > 0.0 {
        other.set_aims(lattice, task.start.d[0], |t_s| follow::aim(task, t_s));
        // The target place already sets the distance; nearness in the cost would favour late and hard braking, which
        // takes fewer samples.
        let params = Params { weight_obstacle: 0.0, ..*task.params };
        match search.run(&Task { params: &params, ..*task }, other, Some(budget), spent) {
            Outcome::Found(candidate) => return Some(candidate),
            Outcome::Stopped => return None,
            Outcome::Nothing => {}
        }
    }
    other.set_slower(lattice, task.params.slower_speeds);
    search.run(task, other, Some(budget), spent).found()
}

fn checks<'a>(
    params: &Params,
    request: &Request<'a>,
    obstacles: &'a Obstacles,
    road: &'a Road,
) -> Checks<'a> {
    let limits = request.limits;
    let (sin, cos) = math::sin_cos(request.start.pose.heading_rad);
    let drivable = Drivable {
        lateral_accel_max_mps2: limits.lateral_accel_max_mps2,
        accel_max_mps2: limits.accel_max_mps2,
        brake_max_mps2: limits.brake_max_mps2,
        steering_rate_max_radps: limits.steering_rate_max_radps,
        road,
        road_margin_m: params.road_margin_m,
        rest_left_m: request.rest_left_m(request.place().s_m),
    };
    let tightest = curvature_max_1pm(limits, request.shape);
    Checks {
        obstacles,
        shape: request.shape,
        at: request.start.stamp,
        clearance_m: params.clearance_m,
        exact: false,
        curvature_max_1pm: params.max_curvature_1pm.min(tightest),
        speed_max_mps: params.max_speed_mps,
        accel_max_mps2: params.max_accel_mps2,
        offset_m: (f64::NEG_INFINITY, f64::INFINITY),
        smooth: true,
        drivable: Some(drivable),
        heading: (cos, sin),
        tail_s: params.tail_s,
    }
}

/// Path curvature of a slow ego, 1/m.
fn standing_curvature_1pm(request: &Request<'_>, speed_mps: f64) -> f64 {
    let start = &request.start;
    let tightest = curvature_max_1pm(request.limits, request.shape);
    let curvature = if speed_mps < WHEELS_MPS {
        math::tan(start.steering_rad) / request.shape.wheelbase_m
    } else {
        start.yaw_rate_radps / speed_mps
    };
    curvature.clamp(-tightest, tightest)
}

/// Plan of a candidate with points at most `POINT_STEP_S` apart.
pub fn to_plan(task: &Task<'_>, candidate: &Candidate, request: &Request<'_>) -> Plan {
    let curvature_max = task.checks.curvature_max_1pm;
    let points = places(task, candidate, POINT_STEP_S)
        .map(|(t_s, place)| PlanPoint {
            at: request.start.stamp + Span::from_secs(t_s),
            pose: Pose2::new(place.x_m, place.y_m, math::atan2(place.sin, place.cos)),
            // Near standstill the curvature of a motion over time is not meaningful.
            curvature_1pm: place.curvature_1pm.clamp(-curvature_max, curvature_max),
            speed_mps: place.speed_mps,
            accel_mps2: place.accel_mps2,
        })
        .collect();
    Plan { stamp: request.stamp, status: PlanStatus::Found, points, work: 0 }
}

/// Instants and places of a candidate with its tail, at most `step_s` apart, seconds.
pub fn places<'a>(
    task: &'a Task<'a>,
    candidate: &'a Candidate,
    step_s: f64,
) -> impl Iterator<Item = (f64, MotionState)> + 'a {
    let end_s = candidate.last_s + task.checks.tail_s;
    let steps = (end_s / step_s - 1e-9).ceil().max(1.0);
    let mut still = task.checks.heading;
    (0..=steps as usize).map(move |k| {
        let t_s = end_s * k as f64 / steps;
        let place = candidate.motion.at(task.line, t_s, still);
        still = (place.cos, place.sin);
        (t_s, place)
    })
}

#[cfg(test)]
mod allocations;
#[cfg(test)]
mod tests;
