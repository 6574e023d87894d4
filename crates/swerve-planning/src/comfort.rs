//! A comfortable layer above a planner: while a plan within limits of comfort is free it is driven, else what the planner
//! finds within the vehicle's own.
//!
//! The layer searches Frenet candidates (Werling 2010, as [`crate::fot`]) along the line with its corners eased, so that
//! curvature comes and goes at a bounded rate, from where the previous plan has the ego by now: plans made one after
//! another are one motion, and what is remembered comes with the request.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require_not_negative, require_positive, require_within};
use swerve_core::{Span, Time};
use swerve_geom::{Pose2, angle_between, math};
use swerve_msg::{EgoState, Plan, PlanPoint, PlanStatus};
use swerve_vehicle::Limits;

use crate::collision::CollisionMode;
use crate::fot::line::Line;
use crate::fot::{self, Fot};
use crate::path::points::{Measured, PathPoint, with_curvature};
use crate::request::{Budget, Counted, Planner, Request};

/// Limits of comfort; the vehicle's are kept too.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Largest lateral acceleration, m/s². Source: people call 2 m/s² firm.
    pub lateral_accel_max_mps2: f64,
    /// Largest change of the lateral acceleration by steering, m/s³.
    pub lateral_jerk_max_mps3: f64,
    /// Largest acceleration, m/s². Source: within nuPlan's 2.4.
    pub accel_max_mps2: f64,
    /// Largest deceleration, m/s². Source: within nuPlan's 4.05.
    pub brake_max_mps2: f64,
    /// Distance to keep from obstacles, metres.
    pub clearance_m: f64,
    /// Corners of the line are eased over this much before and after each place, metres.
    pub ease_m: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            lateral_accel_max_mps2: 2.5,
            lateral_jerk_max_mps3: 5.0,
            accel_max_mps2: 2.0,
            brake_max_mps2: 3.5,
            clearance_m: 0.5,
            ease_m: 4.0,
        }
    }
}

impl Params {
    /// Checks all ranges.
    pub fn validate(&self) -> Result<(), ParamError> {
        require_positive("lateral_accel_max_mps2", self.lateral_accel_max_mps2)?;
        require_positive("lateral_jerk_max_mps3", self.lateral_jerk_max_mps3)?;
        require_positive("accel_max_mps2", self.accel_max_mps2)?;
        require_positive("brake_max_mps2", self.brake_max_mps2)?;
        require_not_negative("clearance_m", self.clearance_m)?;
        require_within("ease_m", self.ease_m, [0.0, EASE_MAX_M])
    }

    /// The vehicle's limits where these are not narrower.
    fn within(&self, request: &Request<'_>) -> Limits {
        let vehicle = request.limits;
        // Lateral acceleration is v² κ, and the front wheels' angle close to L κ.
        let v = request.start.speed_mps.max(SLOW_MPS);
        let steering_rate_radps = request.shape.wheelbase_m * self.lateral_jerk_max_mps3 / (v * v);
        Limits {
            steering_rate_max_radps: steering_rate_radps.min(vehicle.steering_rate_max_radps),
            lateral_accel_max_mps2: self.lateral_accel_max_mps2.min(vehicle.lateral_accel_max_mps2),
            accel_max_mps2: self.accel_max_mps2.min(vehicle.accel_max_mps2),
            brake_max_mps2: self.brake_max_mps2.min(vehicle.brake_max_mps2),
            ..*vehicle
        }
    }
}

/// Longest stretch to either side that corners are eased over, metres: bounds the work.
const EASE_MAX_M: f64 = 50.0;

/// Slower than this the wheels are turned no faster than at it, m/s.
const SLOW_MPS: f64 = 6.0;

/// How a comfortable plan keeps clear of others: as the planner below it does.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Manner {
    /// On the line: it slows, stops and follows, and crosses nobody's way.
    Waits,
    /// Round what is in the way of the line.
    GoesRound,
    /// Away from what is near too, as a Frenet planner of these [`fot::Params`] does.
    KeepsAway {
        /// Weight of nearness.
        weight_obstacle: f64,
        /// Time between the samples that it is summed over, seconds.
        time_step_s: f64,
    },
}

/// A planner with a comfortable layer above it.
pub struct Comfort {
    params: Params,
    gentle: Fot,
    planner: Box<dyn Planner>,
}

impl Comfort {
    /// Above `planner`; `collision` says how a layer that does not wait takes predictions.
    pub fn new(
        params: Params,
        collision: CollisionMode,
        manner: Manner,
        planner: Box<dyn Planner>,
    ) -> Result<Self, ParamError> {
        params.validate()?;
        Ok(Self { params, gentle: Fot::eased(gentle(&params, collision, manner), params.ease_m)?, planner })
    }

    /// A plan within the limits of comfort, if one is free.
    fn comfortable(&mut self, request: &Request<'_>, budget: &mut Counted<'_>) -> Option<Plan> {
        let limits = self.params.within(request);
        let start = taken_up(request);
        // Out of a swerve that is not comfortable only the planner below leads.
        if (start.speed_mps * start.yaw_rate_radps).abs() > SWERVE_SHARE * limits.lateral_accel_max_mps2 {
            return None;
        }
        let easy = Request { start, limits: &limits, ..*request };
        let curves_mps = before_curves_mps(self.gentle.along(&easy), &easy);
        let target_speed_mps = request.target_speed_mps.min(curves_mps);
        let slowed = Request { target_speed_mps, ..easy };
        let plan = match self.gentle.found(&slowed, budget) {
            Some(plan) => plan,
            None => {
                let stop = stop(&easy, &self.gentle, &self.params)?;
                // An ego at rest waits for obstacles only: without them it must be able to set off.
                let waits = start.speed_mps >= REST_MPS || self.gentle.finds_alone(&slowed, budget);
                waits.then_some(stop)?
            }
        };
        Some(Plan { status: PlanStatus::Comfortable, ..plan })
    }
}

/// Slower than this the ego is at rest, m/s.
const REST_MPS: f64 = 0.1;

/// A lateral acceleration beyond this share of the limit is not that of a comfortable plan.
const SWERVE_SHARE: f64 = 1.1;

/// The gentlest steady braking along the way ahead that comes to rest before what is in it, if one is free.
///
/// A quintic that ends at rest brakes half as hard again as its mean; where that is too much, this may not be.
fn stop(request: &Request<'_>, gentle: &Fot, params: &Params) -> Option<Plan> {
    let Limits { brake_max_mps2, lateral_accel_max_mps2, .. } = *request.limits;
    // As far as the gentlest steady braking takes.
    let v = request.start.speed_mps.max(0.0);
    let further_m = v * v * f64::from(BRAKE_STEPS) / (2.0 * brake_max_mps2) + v * SETTLE_S;
    let path = with_curvature(&gentle.way_on(request, further_m));
    let path = Measured::new(&path);
    let lateral = |p: &PlanPoint| p.curvature_1pm.abs() * p.speed_mps * p.speed_mps;
    let free = |poses: &[(Pose2, Time)], clearance_m: f64| {
        gentle.obstacles().path_free(|pose| request.shape.footprint(pose), poses, clearance_m)
    };
    let mut too_near = Vec::new();
    for k in 1..=BRAKE_STEPS {
        let brake_mps2 = brake_max_mps2 * f64::from(k) / f64::from(BRAKE_STEPS);
        let plan = braking(request, &path, brake_mps2);
        if !plan.points.iter().all(|p| lateral(p) <= lateral_accel_max_mps2) {
            continue;
        }
        let poses: Vec<(Pose2, Time)> = plan.points.iter().map(|p| (p.pose, p.at)).collect();
        if !gentle.keeps_road(request, &poses) {
            continue;
        }
        if free(&poses, STOP_GAP_M.max(params.clearance_m)) {
            return Some(plan);
        }
        too_near.push((plan, poses));
    }
    too_near.into_iter().find(|(_, poses)| free(poses, params.clearance_m)).map(|(plan, _)| plan)
}

/// Along `path` to rest: the deceleration grows to `brake_mps2` and dies away before the end, both at [`JERK_MPS3`];
/// standing after that.
fn braking(request: &Request<'_>, path: &Measured<'_>, brake_mps2: f64) -> Plan {
    let start = &request.start;
    let (mut s_m, mut speed_mps) = (0.0, start.speed_mps.max(0.0));
    let mut accel_mps2 = start.accel_mps2.clamp(-brake_mps2, request.limits.accel_max_mps2);
    let mut points = Vec::new();
    let mut at = start.stamp;
    let mut standing = 0;
    while standing < STAND_STEPS {
        let PathPoint { pose, curvature_1pm } = path.at(s_m);
        points.push(PlanPoint { at, pose, curvature_1pm, speed_mps, accel_mps2 });
        // So hard that it can die away until the ego stands, and never so gently that it creeps.
        let wanted = -brake_mps2.min((2.0 * JERK_MPS3 * speed_mps).sqrt()).max(CREEP_BRAKE_MPS2);
        let next = wanted.max(accel_mps2 - JERK_MPS3 * STEP_S);
        let next_mps = (speed_mps + 0.5 * (accel_mps2 + next) * STEP_S).max(0.0);
        s_m += 0.5 * (speed_mps + next_mps) * STEP_S;
        accel_mps2 = if next_mps > 0.0 { next } else { 0.0 };
        standing += u32::from(next_mps == 0.0);
        speed_mps = next_mps;
        at += Span::from_secs(STEP_S);
    }
    Plan { stamp: request.stamp, status: PlanStatus::Comfortable, points, work: 0 }
}

/// Distance left before what is stopped for, where there is room, metres.
const STOP_GAP_M: f64 = 1.5;

/// Time that a deceleration takes to grow, seconds.
const SETTLE_S: f64 = 2.0;

/// Steady decelerations that are tried, up to the limit of comfort.
const BRAKE_STEPS: u32 = 7;

/// How fast a steady deceleration grows, m/s³.
const JERK_MPS3: f64 = 5.0;

/// Least deceleration of a stop, m/s².
const CREEP_BRAKE_MPS2: f64 = 0.3;

/// Time between the points of a stop, seconds, and how many of them it stands at its end.
const STEP_S: f64 = 0.1;
const STAND_STEPS: u32 = 20;

impl Planner for Comfort {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let mut counted = Counted::new(budget);
        let comfortable = self.comfortable(request, &mut counted);
        let plan = comfortable.unwrap_or_else(|| self.planner.plan(request, &mut counted));
        Plan { work: counted.spent, ..plan }
    }
}

/// The layer's candidates: later ends and more speeds than the paper's, and where the planner does not ask for it far less
/// weight on nearness.
fn gentle(params: &Params, collision: CollisionMode, manner: Manner) -> fot::Params {
    let round = fot::Params {
        collision,
        obstacle_range_m: 100.0,
        clearance_m: params.clearance_m,
        left_m: 4.0,
        lateral_step_m: 0.25,
        time_step_s: 0.5,
        speed_step_mps: 0.5,
        speed_steps: 1,
        // The target speed is the only one.
        max_speed_mps: SPEED_MAX_MPS,
        horizon_min_s: 3.0,
        horizon_max_s: 7.0,
        slower_speeds: 12,
        weight_obstacle: 2.0,
        ..fot::Params::fast()
    };
    match manner {
        Manner::Waits => {
            fot::Params { collision: CollisionMode::SweptStatic, left_m: 0.0, right_m: 0.0, ..round }
        }
        Manner::GoesRound => round,
        // Nearness is summed over samples: seconds are to weigh as much as there.
        Manner::KeepsAway { weight_obstacle, time_step_s } => {
            fot::Params { weight_obstacle: weight_obstacle * round.time_step_s / time_step_s, ..round }
        }
    }
}

/// More than any vehicle's speed, m/s.
const SPEED_MAX_MPS: f64 = 1e3;

/// An ego nearer to its plan than this, in place, speed and heading, takes it up where it should be by now.
const ON_PLAN_M: f64 = 0.5;
const ON_PLAN_MPS: f64 = 1.0;
const ON_PLAN_RAD: f64 = 0.1;

/// Where the previous plan has the ego at the start's instant, else where it is.
fn taken_up(request: &Request<'_>) -> EgoState {
    let start = request.start;
    let covers =
        |plan: &&Plan| plan.points.first().is_some_and(|p| p.at <= start.stamp) && start.stamp <= plan.end();
    let Some(p) = request.previous.filter(covers).and_then(|plan| plan.at(start.stamp)) else { return start };
    let near = p.pose.point().distance(start.pose.point()) <= ON_PLAN_M
        && (p.speed_mps - start.speed_mps).abs() <= ON_PLAN_MPS
        && angle_between(p.pose.heading_rad, start.pose.heading_rad).abs() <= ON_PLAN_RAD;
    if !near {
        return start;
    }
    let yaw_rate_radps = p.speed_mps * p.curvature_1pm;
    EgoState {
        pose: p.pose,
        speed_mps: p.speed_mps,
        accel_mps2: p.accel_mps2,
        steering_rad: math::atan(request.shape.wheelbase_m * p.curvature_1pm),
        yaw_rate_radps,
        lateral_accel_mps2: p.speed_mps * yaw_rate_radps,
        ..start
    }
}

/// Shares of the limits that the line's curves are driven with: the rest is for what is corrected.
const CURVE_SHARE: f64 = 0.8;
const BRAKE_SHARE: f64 = 0.5;

/// Distance between the places at which the curves ahead are looked at, metres.
const LOOK_M: f64 = 1.0;

/// The speed from which each curve ahead can be reached slowly enough, m/s.
fn before_curves_mps((line, s_m): (&Line, f64), request: &Request<'_>) -> f64 {
    let Limits { lateral_accel_max_mps2, brake_max_mps2, .. } = *request.limits;
    let v = request.start.speed_mps.max(request.target_speed_mps).max(0.0);
    let brake_mps2 = BRAKE_SHARE * brake_max_mps2;
    let reach_m = (v * v / (2.0 * brake_mps2)).min(line.length_m());
    let steps = (reach_m / LOOK_M).ceil() as usize;
    let allowed = |ahead_m: f64| {
        let curvature_1pm = line.at(s_m + ahead_m).curvature_1pm.abs().max(1e-9);
        (CURVE_SHARE * lateral_accel_max_mps2 / curvature_1pm + 2.0 * brake_mps2 * ahead_m).sqrt()
    };
    (0..=steps).map(|k| allowed(k as f64 * LOOK_M)).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use swerve_geom::Point2;
    use swerve_msg::Prediction;

    use super::*;
    use crate::collision::Obstacles;
    use crate::request::Unlimited;
    use crate::testing::World;

    /// Says that it was asked.
    struct Below;

    impl Planner for Below {
        fn plan(&mut self, request: &Request<'_>, _: &mut dyn Budget) -> Plan {
            Plan { stamp: request.stamp, status: PlanStatus::GaveUp, ..Plan::default() }
        }
    }

    fn plan(world: &World, manner: Manner, previous: Option<&Plan>) -> Plan {
        let mut comfort =
            Comfort::new(Params::default(), CollisionMode::TimeIndexed, manner, Box::new(Below)).unwrap();
        comfort.plan(&Request { previous, ..world.request() }, &mut Unlimited::default())
    }

    /// Largest deceleration and lateral acceleration, m/s², and lateral jerk between points, m/s³.
    fn felt(plan: &Plan) -> [f64; 3] {
        let lateral = |p: &PlanPoint| p.curvature_1pm * p.speed_mps * p.speed_mps;
        let brake = plan.points.iter().map(|p| -p.accel_mps2).fold(0.0, f64::max);
        let across = plan.points.iter().map(|p| lateral(p).abs()).fold(0.0, f64::max);
        let jerk = plan.points.windows(2).map(|p| (lateral(&p[1]) - lateral(&p[0])).abs() / STEP_S);
        [brake, across, jerk.fold(0.0, f64::max)]
    }

    fn is_free(world: &World, plan: &Plan, predictions: &[Prediction]) -> bool {
        let obstacles = Obstacles::new(predictions, CollisionMode::TimeIndexed);
        let poses: Vec<(Pose2, Time)> = plan.points.iter().map(|p| (p.pose, p.at)).collect();
        obstacles.path_free(|pose| world.shape.footprint(pose), &poses, 0.4)
    }

    #[test]
    fn a_bend_is_slowed_down_for_and_entered_gently() {
        // 14 m/s round 60 m would be 3.3 m/s²; the bend begins 40 m ahead.
        let straight = (-20..40).map(|x| Point2::new(f64::from(x), 0.0));
        let bend = (0..150).map(|k| {
            let (sin, cos) = math::sin_cos(f64::from(k) / 60.0);
            Point2::new(40.0 + 60.0 * sin, 60.0 * (1.0 - cos))
        });
        let mut world = World::on(&straight.chain(bend).collect::<Vec<_>>(), 14.0);
        let mut previous: Option<Plan> = None;
        for _ in 0..60 {
            let plan = plan(&world, Manner::GoesRound, previous.as_ref());
            assert_eq!(plan.status, PlanStatus::Comfortable);
            let [brake, across, jerk] = felt(&plan);
            assert!(brake <= 3.5 + 1e-6 && across <= 2.75 && jerk < 7.0, "{brake} {across} {jerk}");
            let next = plan.at(world.start.stamp + Span::from_ms(100)).unwrap();
            world.start =
                EgoState { speed_mps: next.speed_mps, pose: next.pose, stamp: next.at, ..world.start };
            world.start.yaw_rate_radps = next.speed_mps * next.curvature_1pm;
            world.start.accel_mps2 = next.accel_mps2;
            previous = Some(plan);
        }
        assert!(world.start.speed_mps < 12.5, "{}", world.start.speed_mps);
    }

    #[test]
    fn what_stands_ahead_is_stopped_for_steadily() {
        // A quartic from 14 m/s over these 35 m would brake with 4.2 m/s².
        let world = World::straight(14.0).with_person((40.0, 0.0), (0.0, 0.0));
        let plan = plan(&world, Manner::Waits, None);
        assert_eq!(plan.status, PlanStatus::Comfortable);
        let [brake, ..] = felt(&plan);
        assert!((3.0..=3.5 + 1e-6).contains(&brake), "{brake}");
        assert!(is_free(&world, &plan, &world.predictions));
        assert!(plan.points.last().unwrap().speed_mps == 0.0);
    }

    #[test]
    fn what_comes_too_near_is_left_to_the_planner_below() {
        let world = World::straight(14.0).with_person((20.0, 0.0), (0.0, 0.0));
        assert_eq!(plan(&world, Manner::Waits, None).status, PlanStatus::GaveUp);
        // And so is a swerve that is under way.
        let mut world = World::straight(14.0);
        world.start.yaw_rate_radps = 0.3;
        assert_eq!(plan(&world, Manner::GoesRound, None).status, PlanStatus::GaveUp);
    }

    #[test]
    fn only_who_goes_round_leaves_the_line() {
        let world = World::straight(8.0).with_person((28.0, -0.3), (0.0, 0.0));
        let farthest = |manner| {
            let plan = plan(&world, manner, None);
            assert!(plan.status == PlanStatus::Comfortable && is_free(&world, &plan, &world.predictions));
            plan.points.iter().map(|p| p.pose.y_m.abs()).fold(0.0, f64::max)
        };
        assert!(farthest(Manner::Waits) < 1e-6);
        assert!(farthest(Manner::GoesRound) > 1.0);
    }

    #[test]
    fn limits_out_of_range_are_named() {
        let params = Params { brake_max_mps2: 0.0, ..Params::default() };
        assert_eq!(params.validate().unwrap_err().key, "brake_max_mps2");
        let params = Params { ease_m: 1e12, ..Params::default() };
        assert_eq!(params.validate().unwrap_err().key, "ease_m");
    }
}
