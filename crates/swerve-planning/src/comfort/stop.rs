//! Stops along the path ahead, in the ego's lane and short of people, instead of swinging out before them.

use swerve_core::Time;
use swerve_geom::{Pose2, math};
use swerve_msg::{Plan, PlanStatus};

use super::Comfort;
use super::scene::{HARD_CLEARANCE_M, REST_MPS, Scene, can_lead, comfortable};
use crate::following::Step;
use crate::lane::{Aside, aside, stretch};
use crate::passing::Passing;
use crate::request::Request;
use crate::steady_stop::{self, Demands, JERK_MPS3};
use crate::traffic::Mover;

impl Comfort {
    /// The gentlest steady braking along the path ahead, on the road and to rest in the ego's lane.
    pub(super) fn stop(&self, scene: &Scene<'_>, standing_m: f64) -> Option<Plan> {
        let request = scene.request;
        let v = request.start.speed_mps.max(0.0);
        // Distance of the gentlest steady braking.
        let further_m = v * v * f64::from(BRAKE_STEPS) / (2.0 * request.limits.brake_max_mps2) + v * SETTLE_S;
        let way = self.gentle.way_on(request, further_m);
        let (clearance_m, jerk_mps3) = (self.params.clearance_m, JERK_MPS3);
        let usable = |poses: &[(Pose2, Time)]| {
            poses.last().is_none_or(|end| request.may_rest_at(end.0))
                && self.gentle.keeps_road(request, poses)
        };
        let stop = |brakes_mps2: [f64; 2], hardest: bool| {
            let steps = (1..=BRAKE_STEPS).map(|k| f64::from(k) / f64::from(BRAKE_STEPS));
            let brakes = steps.map(|share| brakes_mps2[0] + share * (brakes_mps2[1] - brakes_mps2[0]));
            let demands = Demands {
                gaps_m: [standing_m, self.params.standstill_gap_m],
                clearance_m,
                hardest,
                jerk_mps3,
            };
            steady_stop::stop(request, &way, self.gentle.obstacles(), brakes, (demands, &usable))
        };
        let comfort_mps2 = request.limits.brake_max_mps2;
        if let Some(plan) = stop([0.0, comfort_mps2], true) {
            return Some(comfortable(plan));
        }
        // For vehicles and obstacles that close the road the ego brakes in the lane; people are left to the inner
        // planner.
        let plan = if self.in_way(scene).all(|one| can_lead(one, request)) {
            stop([comfort_mps2, scene.vehicle.brake_max_mps2], false)
        } else {
            None
        };
        plan.map(|plan| Plan { status: PlanStatus::Found, ..plan })
    }

    /// For an ego near people, the gentlest steady braking that suffices. Up to 30 km/h it may end anywhere; above that,
    /// only short of a person who begins to cross. An ego at rest waits only for people who move.
    pub(super) fn stop_short(&self, scene: &Scene<'_>) -> Option<Plan> {
        let v = scene.request.start.speed_mps.max(0.0);
        let movers = &scene.traffic.movers;
        let counts = |one: &Mover| one.kind.is_person() && (v > REST_MPS || !one.stands());
        if !movers.iter().any(counts) {
            return None;
        }
        let short_of_m = if v > SLOW_MPS { first_hurried_m(scene)? } else { f64::INFINITY };
        let request = &Request { limits: scene.vehicle, ..*scene.request };
        let beyond = self.lane(request).is_over(scene.place.s_m, scene.place.d_m);
        let way = if beyond { self.gentle.way_on(request, v * SETTLE_S) } else { self.way_in_lane(scene) };
        let vehicle_mps2 = scene.vehicle.brake_max_mps2;
        let jerks_mps3: &[f64] = if v > SLOW_MPS { &[FIRM_MPS3] } else { &[JERK_MPS3, FIRM_MPS3] };
        let front_m = request.shape.length_m - request.shape.rear_overhang_m;
        let rests_short = |(end, _): &(Pose2, Time)| {
            self.gentle.line().project(end.point(), scene.place.s_m).0 + front_m < short_of_m
        };
        let usable = |poses: &[(Pose2, Time)]| {
            poses.last().is_none_or(rests_short) && self.gentle.keeps_road(request, poses)
        };
        let stop = |jerk_mps3: f64| {
            let brakes = (1..=BRAKE_STEPS).map(|k| vehicle_mps2 * f64::from(k) / f64::from(BRAKE_STEPS));
            let demands = (self.short_stop(jerk_mps3), &usable as _);
            steady_stop::stop(request, &way, self.gentle.obstacles(), brakes, demands)
        };
        let plan = jerks_mps3.iter().find_map(|jerk_mps3| stop(*jerk_mps3))?;
        Some(Plan { status: PlanStatus::Found, ..plan })
    }

    /// Stop of an ego that has begun to move out of its lane and meets an oncoming vehicle: the gentlest steady braking
    /// that leaves it room, or else the hardest.
    pub(super) fn stop_before_line(&self, scene: &Scene<'_>, back: &Passing<'_>) -> Option<Plan> {
        let Scene { request, place, .. } = *scene;
        let is_over = self.lane(request).is_over(place.s_m, place.d_m);
        if is_over || !back.meets_vehicle(&request.start, self.gentle.line(), &place) {
            return None;
        }
        let request = &Request { limits: scene.vehicle, ..*request };
        let way = self.way_in_lane(scene);
        let usable = |poses: &[(Pose2, Time)]| self.gentle.keeps_road(request, poses);
        let stop = |brake_mps2: f64| {
            let brake = core::iter::once(brake_mps2);
            let demands = (self.short_stop(FIRM_MPS3), &usable as _);
            steady_stop::stop(request, &way, self.gentle.obstacles(), brake, demands)
        };
        let steps = (1..=BRAKE_STEPS).map(|k| f64::from(k) / f64::from(BRAKE_STEPS));
        let mut stops = steps.filter_map(|share| stop(share * scene.vehicle.brake_max_mps2));
        let leaves_room = |plan: &Plan| back.may_give_up(plan, self.gentle.line(), &request.start, &place);
        let plan = stops.find(leaves_room).or_else(|| stop(scene.vehicle.brake_max_mps2))?;
        Some(Plan { status: PlanStatus::Found, ..plan })
    }

    /// Demands of a stop that may end closer than the comfort clearance, with a jerk.
    fn short_stop(&self, jerk_mps3: f64) -> Demands {
        let clearance_m = HARD_CLEARANCE_M.min(self.params.clearance_m);
        Demands { gaps_m: [self.params.clearance_m, clearance_m], clearance_m, hardest: false, jerk_mps3 }
    }

    /// Path ahead for an ego in its lane: straightens along the line without leaving the lane, whatever was planned
    /// before.
    fn way_in_lane(&self, scene: &Scene<'_>) -> Vec<Pose2> {
        let Scene { request, place, .. } = *scene;
        let v = request.start.speed_mps.max(0.0);
        let length_m = (v * STRAIGHTENS_S).max(STRAIGHTENS_M);
        let drift_m = 0.5 * length_m * stretch(&place) * math::tan(place.turn_rad.clamp(-1.0, 1.0));
        let to_m = (place.d_m + drift_m).min(request.rest_left_m(place.s_m).max(0.0));
        let count = ((length_m + v * SETTLE_S) / WAY_STEP_M).ceil() as usize;
        let steps: Vec<Step> = (0..=count)
            .map(|k| Step { s_m: place.s_m + k as f64 * WAY_STEP_M, speed_mps: v, accel_mps2: 0.0 })
            .collect();
        let way = Aside { to_m, length_m };
        let points = aside(self.gentle.line(), &place, &request.start, &steps, (request.shape, way));
        points.iter().map(|p| p.pose).collect()
    }

    /// True for a plan that swings over the line, starting from a swerve in the lane, while a person begins to cross.
    pub(super) fn swings_before_person(&self, scene: &Scene<'_>, plan: &Plan) -> bool {
        let Scene { request, place, .. } = *scene;
        let lane = self.lane(request);
        if lane.is_over(place.s_m, place.d_m) || first_hurried_m(scene).is_none() {
            return false;
        }
        self.places(plan, place.s_m).any(|(_, [s_m, d_m])| lane.is_over(s_m, d_m))
    }
}

/// Arc length of the first person ahead who begins to cross, metres.
fn first_hurried_m(scene: &Scene<'_>) -> Option<f64> {
    let hurried = scene.traffic.movers.iter().filter(|one| may_hurry(one)).map(|one| one.knots[0]);
    hurried.filter(|at| at.to_m > scene.place.s_m).map(|at| at.from_m).min_by(f64::total_cmp)
}

/// True for a person who has just begun to cross and may walk faster next.
fn may_hurry(one: &Mover) -> bool {
    one.kind.is_person() && one.changed_lately && one.comes_over()
}

/// Up to this speed an ego stops for a person who enters its path instead of going round, m/s: 30 km/h.
const SLOW_MPS: f64 = 8.5;

/// Jerk at which the deceleration grows if the ego must stop firmly, m/s³.
const FIRM_MPS3: f64 = 20.0;

/// A stop in the lane straightens within this time, seconds, and at least this distance, metres; step of its path, metres.
const STRAIGHTENS_S: f64 = 1.0;
const STRAIGHTENS_M: f64 = 6.0;
const WAY_STEP_M: f64 = 0.5;

/// Time that a deceleration takes to build up, seconds.
const SETTLE_S: f64 = 2.0;

/// Number of steady decelerations that are tried, up to the limit.
const BRAKE_STEPS: u32 = 7;
