//! Frenet optimal trajectories (Werling, Ziegler, Kammel, Thrun: Optimal Trajectory Generation for Dynamic
//! Street Scenarios in a Frenét Frame, ICRA 2010).
//!
//! Candidates are all combinations of an end offset, an end speed and an end time: quintics across the line,
//! quartics along it. Costs are the original planner's (Pylot's), so that figures compare; `search.rs` says
//! how the cheapest valid one is found without building them all.

pub mod candidate;
mod follow;
pub mod lattice;
pub mod line;
pub mod motion;
mod nearness;
mod params;
pub(crate) mod poly;
pub mod search;

pub use params::Params;

use swerve_core::Span;
use swerve_geom::{Pose2, math};
use swerve_msg::{Plan, PlanPoint, PlanStatus};
use swerve_vehicle::{Limits, Shape};

use crate::brake::way_ahead;
use crate::collision::{CollisionMode, Obstacles};
use crate::fallback::{comfort_limits, give_way, keep_or_brake, kept};
use crate::path::route::PATH_STEP_M;
use crate::request::{Budget, Counted, Planner, Request};
use crate::road::Road;
use candidate::{Candidate, Outcome};
use lattice::Lattice;
use line::{Line, OnLine, RouteLine};
use motion::{Checks, Drivable, FrenetState, Place};
use search::{Search, Task};
use swerve_core::param::ParamError;

/// Largest time between two points of a plan, seconds.
const POINT_STEP_S: f64 = 0.1;

/// How far a way goes on beyond the plan that it continues, metres.
const WAY_ON_M: f64 = 100.0;

/// The planner, with the storage it keeps from call to call; no call depends on an earlier one.
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
    /// With valid parameters.
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

    /// The same along a line whose corners are eased over `ease_m` before and after each place.
    pub(crate) fn eased(params: Params, ease_m: f64) -> Result<Self, ParamError> {
        Ok(Self { line: RouteLine::eased(ease_m), ..Self::new(params)? })
    }

    /// The parameters.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// Takes in route and predictions.
    fn set_world(&mut self, request: &Request<'_>, collision: CollisionMode) {
        self.line.follow(request.route.line());
        self.road.set(request.route);
        let center = request.start.pose.point();
        self.obstacles.set_near(request.predictions, collision, center, self.params.obstacle_range_m);
    }

    /// The start in the Frenet frame.
    fn frenet(&self, request: &Request<'_>) -> FrenetState {
        let start = &request.start;
        let OnLine { s_m, d_m, node, turn_rad } = self.line.locate(start.pose);
        let (sin, cos) = math::sin_cos(turn_rad);
        let speed_mps = start.speed_mps.max(0.0);
        let limits = request.limits;
        // An ego that is almost standing cannot go on braking hard without rolling back.
        let hardest = limits.brake_max_mps2.min(2.0 * speed_mps);
        let along = start.accel_mps2.clamp(-hardest, limits.accel_max_mps2);
        let lateral_max = limits.lateral_accel_max_mps2;
        let across = (speed_mps * start.yaw_rate_radps).clamp(-lateral_max, lateral_max);
        // Velocity and acceleration turned into the line's axes, then the line's own turning taken out
        // (the second derivative of r(s) + d n, solved for s and d).
        let stretch = (1.0 - node.curvature_1pm * d_m).max(0.1);
        let (s1, d1) = (speed_mps * cos / stretch, speed_mps * sin);
        let (accel_t, accel_n) = (along * cos - across * sin, along * sin + across * cos);
        let turning = s1 * (node.bend_1pm2 * s1 * d_m + 2.0 * node.curvature_1pm * d1);
        let s2 = (accel_t + turning) / stretch;
        let d2 = accel_n - node.curvature_1pm * s1 * s1 * stretch;
        FrenetState { s: [s_m, s1, s2], d: [d_m, d1, d2] }
    }

    /// The speed to aim for: no more change than the limits give within the earliest end.
    fn target(&self, request: &Request<'_>) -> f64 {
        let target_mps = request.target_speed_mps;
        // From and to zero acceleration a quartic peaks at 1.5 times its mean.
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
    /// The route's line, and where on it the request starts.
    pub(crate) fn along(&mut self, request: &Request<'_>) -> (&Line, f64) {
        self.line.follow(request.route.line());
        (self.line.line(), self.line.locate(request.start.pose).s_m)
    }

    /// Where the request starts beside the route's line.
    pub(crate) fn place(&mut self, request: &Request<'_>) -> OnLine {
        self.line.follow(request.route.line());
        self.line.locate(request.start.pose)
    }

    /// The route's line as followed last.
    pub(crate) fn line(&self) -> &Line {
        self.line.line()
    }

    /// Candidates end between these offsets, metres: to the left of the line, and to its right.
    pub(crate) fn set_offsets(&mut self, left_m: f64, right_m: f64) {
        (self.params.left_m, self.params.right_m) = (left_m, right_m);
    }

    /// The cheapest valid plan at about the target speed, by the first of the collision modes; no fallback.
    pub(crate) fn at_speed(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Option<Plan> {
        self.set_world(request, self.params.collision.in_order()[0]);
        self.search(request, |search, task, lattice, _| {
            search.run(task, lattice, Some(&mut *budget), &mut 0).found()
        })
    }

    /// The cheapest valid plan behind what is in the way, or slower than the target; no fallback.
    pub(crate) fn slower(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Option<Plan> {
        self.set_world(request, self.params.collision.in_order()[0]);
        self.search(request, |search, task, lattice, other| behind(search, task, lattice, other, budget))
    }

    /// The obstacles that were asked about last.
    pub(crate) fn obstacles(&self) -> &Obstacles {
        &self.obstacles
    }

    /// The rest of the previous plan's path from the start on, and from its end on beside the line as far as a stop takes.
    pub(crate) fn way_on(&self, request: &Request<'_>) -> Vec<Pose2> {
        let mut poses = way_ahead(request);
        let end = self.line.locate(*poses.last().unwrap_or(&request.start.pose));
        let steps = (WAY_ON_M / PATH_STEP_M).ceil() as usize;
        poses.extend((1..=steps).map(|k| {
            let node = self.line.line().at(end.s_m + k as f64 * PATH_STEP_M);
            let (x_m, y_m) = (node.x_m - node.sin * end.d_m, node.y_m + node.cos * end.d_m);
            Pose2::new(x_m, y_m, math::atan2(node.sin, node.cos))
        }));
        poses
    }

    /// A plan among the obstacles that are set; where there is none, what comes last falls back to something.
    fn plan_among(&mut self, request: &Request<'_>, last: bool, budget: &mut Counted<'_>) -> Option<Plan> {
        let found = self
            .search(request, |search, task, lattice, coarse| anytime(search, task, lattice, coarse, budget));
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

    /// What `look` finds among the obstacles that are set.
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

/// Searches a few candidates first, then all: when the budget ends, the best so far. Where all fail, those that stop or
/// follow behind what is in the way, then slower ones.
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
    // One of the few is among all.
    let known_cost = first.map_or(f64::INFINITY, |candidate| candidate.cost);
    match search.run_below(task, lattice, known_cost, budget, spent) {
        Outcome::Found(candidate) => return Some(candidate),
        Outcome::Stopped => return first,
        Outcome::Nothing => {}
    }
    behind(search, task, lattice, coarse, budget)
}

/// Those that stop or follow behind what is in the way, then slower ones.
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
        // The place says how near to come; nearness in the cost would favour braking late and hard, which
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
    };
    let tightest = curvature_max_1pm(limits, request.shape);
    Checks {
        obstacles,
        shape: request.shape,
        at: request.start.stamp,
        clearance_m: params.clearance_m,
        exact: false,
        curvature_max_1pm: params.max_curvature_1pm.min(tightest),
        offset_m: (f64::NEG_INFINITY, f64::INFINITY),
        smooth: true,
        drivable: Some(drivable),
        heading: (cos, sin),
        tail_s: params.tail_s,
    }
}

/// Curvature at full lock, 1/m.
pub fn curvature_max_1pm(limits: &Limits, shape: &Shape) -> f64 {
    math::tan(limits.steering_max_rad) / shape.wheelbase_m
}

/// The candidate's motion with points at most `POINT_STEP_S` apart.
pub fn to_plan(task: &Task<'_>, candidate: &Candidate, request: &Request<'_>) -> Plan {
    let curvature_max = task.checks.curvature_max_1pm;
    let points = places(task, candidate, POINT_STEP_S)
        .map(|(t_s, place)| PlanPoint {
            at: request.start.stamp + Span::from_secs(t_s),
            pose: Pose2::new(place.x_m, place.y_m, math::atan2(place.sin, place.cos)),
            // Near standstill a motion in time has no curvature worth the name.
            curvature_1pm: place.curvature_1pm.clamp(-curvature_max, curvature_max),
            speed_mps: place.speed_mps,
            accel_mps2: place.accel_mps2,
        })
        .collect();
    Plan { stamp: request.stamp, status: PlanStatus::Found, points, work: 0 }
}

/// Instants and places of a candidate with its tail, at most `step_s` apart.
pub fn places<'a>(
    task: &'a Task<'a>,
    candidate: &'a Candidate,
    step_s: f64,
) -> impl Iterator<Item = (f64, Place)> + 'a {
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
