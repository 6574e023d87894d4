//! Decision flow of the comfort layer: keep the lane, pass the blockage, or stay behind it.

use swerve_core::Time;
use swerve_geom::{Pose2, math};
use swerve_msg::{Plan, PlanPoint, PlanStatus};

use super::ends::{AT_REST_MPS, brakes_mps2, ends_beside, ends_beyond, ends_slower, rests};
use super::scene::{
    HARD_CLEARANCE_M, HARDER_MPS2, NEAR_M, REST_MPS, Scene, UNDER_WAY, can_lead, comfortable, is_clear_at,
    stepped_up_m,
};
use super::{
    BRAKE_SHARE, CURVE_SHARE, Comfort, LANE_EDGE_M, LATERAL_STEP_M, LEFT_MAX_M, Manner, OBSTACLES_M, Params,
    RIGHT_MAX_M, SWERVE_SHARE, taken_up,
};
use crate::collision::CollisionMode;
use crate::fallback::kept;
use crate::following::{self, Accel, Curve, Follower, Gaps, Lead, Profile, Response, SpeedTable, Step};
use crate::fot::line::OnLine;
use crate::lane::{Lane, back_to_centre, stretch, towards_centre};
use crate::lock::curvature_max_1pm;
use crate::passing::{self, MOVES_OUT_M, Passing};
use crate::request::{Counted, Request};
use crate::room::{Room, Wanted};
use crate::traffic::{Behind, Knot, Mover, Traffic};

impl Comfort {
    /// Plan of this layer if one is free: within the limits of comfort, or braking harder in the ego's lane if a
    /// vehicle requires more.
    pub(super) fn comfortable(
        &mut self,
        request: &Request<'_>,
        follower: Option<Behind>,
        budget: &mut Counted<'_>,
    ) -> Option<Plan> {
        let limits = self.params.within(request);
        let start = taken_up(request);
        self.sight_mps = f64::INFINITY;
        // During an uncomfortable swerve only the inner planner continues.
        if (start.speed_mps * start.yaw_rate_radps).abs() > SWERVE_SHARE * limits.lateral_accel_max_mps2 {
            return None;
        }
        let easy = Request { start, limits: &limits, ..*request };
        let hurried_mps = hurried_mps(request.target_speed_mps, start.speed_mps, follower);
        let place = self.gentle.place(&easy);
        let mut traffic = Traffic::new(&easy, self.gentle.line(), place.s_m);
        let curves = self.in_sight(&easy, &place, &mut traffic, self.curves(&easy, place.s_m));
        let curves_mps = curves.before(place.s_m, start.speed_mps.max(0.0));
        let mut free = |layer: &mut Self, traffic: &Traffic, slow_mps: f64| {
            let predictions =
                if layer.manner == Manner::Waits { request.predictions } else { &traffic.predictions };
            let at_once = curves_mps.min(slow_mps) < hurried_mps || hurried_mps > request.target_speed_mps;
            let target_speed_mps = hurried_mps.min(curves_mps).min(slow_mps);
            let easy = Request { target_speed_mps, predictions, ..easy };
            let vehicle = request.limits;
            layer
                .free_in(&Scene { request: &easy, place, traffic, vehicle, curves: &curves, at_once }, budget)
        };
        let wanted = self.wanted();
        let Some(room) = self.room(wanted, &easy, &traffic, place.s_m) else {
            return free(self, &traffic, f64::INFINITY);
        };
        let plan = free(self, &room.traffic, room.slow_mps);
        let firm_mps2 = FIRM_SHARE * limits.brake_max_mps2;
        let in_vain = Room::is_final(&traffic);
        let is_waiting = |plan: &Plan| {
            let hurries = start.speed_mps < AT_REST_MPS || brakes_mps2(plan) > firm_mps2;
            if in_vain { ends_slower(plan, CREEPS_MPS) } else { rests(plan) && hurries }
        };
        if plan.as_ref().is_some_and(|plan| !is_waiting(plan)) {
            return plan;
        }
        // The ego neither stands nor brakes hard to gain more passing distance than the clearance.
        let less = self.room(wanted.less(), &easy, &traffic, place.s_m);
        let plan_with_less = less.and_then(|less| free(self, &less.traffic, room.slower_mps));
        if plan_with_less.as_ref().is_some_and(|plan| !ends_slower(plan, CREEPS_MPS)) {
            return plan_with_less;
        }
        let close = free(self, &traffic, room.slower_mps);
        if close.as_ref().is_none_or(rests) { plan.or(close) } else { close }
    }

    /// Passing distances used if the road is wide enough.
    fn wanted(&self) -> Wanted {
        let Params { clearance_m, pass_person_m, pass_vehicle_m, .. } = self.params;
        Wanted { clearance_m, person_m: pass_person_m, vehicle_m: pass_vehicle_m, step_out_m: STEP_OUT_M }
    }

    /// Traffic with the passing distances added; `None` if nobody is given more than the clearance.
    fn room(&self, wanted: Wanted, request: &Request<'_>, traffic: &Traffic, s_m: f64) -> Option<Room> {
        if self.manner == Manner::Waits {
            return None;
        }
        Room::new(wanted, request, (self.gentle.line(), s_m), traffic, [LEFT_MAX_M, RIGHT_MAX_M])
    }

    /// First free plan of: keep the lane, pass the blockage, stay behind it.
    fn free_in(&mut self, scene: &Scene<'_>, budget: &mut Counted<'_>) -> Option<Plan> {
        let Scene { request, place, .. } = *scene;
        let passing = self.passing(scene);
        let open = passing.as_ref().filter(|passing| passing.may_open);
        let possible = passing.as_ref().is_some_and(Passing::is_possible);
        let passed = |one: &Mover| open.is_some_and(|open| open.passes(one));
        let waits = self.manner == Manner::Waits;
        let own = if waits { (0.0, 0.0) } else { own_offsets_m(request, &place) };
        if !waits && let Some(plan) = self.meet(scene, possible) {
            return Some(plan);
        }
        let mut profile = self.led(scene, possible, |one| !passed(one));
        let beside = |open: &&Passing<'_>| open.is_beside(&place, request.start.speed_mps);
        if !profile.is_led && open.filter(beside).is_none() {
            // A plan towards one speed would be late.
            if scene.at_once
                && let Some(plan) = self.follow(scene, &self.profile(scene, Vec::new()))
                && self.returns_clear(scene, &plan)
            {
                return Some(plan);
            }
            self.gentle.set_offsets(own.0, own.1);
            // All places of a lead at once would form a wall.
            let swept = waits.then(|| scene.traffic.without_leads(request.predictions));
            let predictions = swept.as_deref().unwrap_or(request.predictions);
            let plan = self.gentle.at_speed(&Request { predictions, ..*request }, budget);
            if let Some(plan) =
                plan.filter(|plan| self.returns_clear(scene, plan) && !self.swings_before_person(scene, plan))
            {
                return Some(comfortable(plan));
            }
        }
        if let Some(open) = open {
            self.gentle.set_offsets(stepped_up_m(open.offset_m), own.1);
            let led_mps = profile.steps.last().map_or(0.0, |step| step.speed_mps);
            let most_mps = if profile.is_led { led_mps } else { request.target_speed_mps };
            // In a bend the path out turns more than the line, which requires another speed. Behind a lead, slower plans
            // would only approach what stands.
            let shares = if profile.is_led { &PASSING_SHARES[..1] } else { &PASSING_SHARES };
            let plan = shares.iter().find_map(|share| {
                let target_speed_mps = share * most_mps;
                let plan = self.gentle.at_speed(&Request { target_speed_mps, ..*request }, budget)?;
                open.may(&plan, self.gentle.line(), &request.start, &place).then_some(plan)
            });
            let plan = plan.or_else(|| self.steer_out(scene, open));
            if let Some(plan) = plan.or_else(|| self.kept_out(scene, open)) {
                return Some(comfortable(plan));
            }
            profile = self.led(scene, possible, |_| true);
        }
        if let Some(plan) = passing.as_ref().and_then(|passing| self.beside(scene, passing, own, budget)) {
            return Some(plan);
        }
        // An obstacle that narrows the lane from beside it is passed like one that blocks the lane.
        let on_line = [place.s_m, 0.0];
        let narrows = || !is_clear_at(scene, on_line, (LANE_AHEAD_M, self.params.clearance_m));
        let steers_past = possible || (self.in_way(scene).next().is_none() && narrows());
        let standing_m = if steers_past { self.params.steer_out_gap_m } else { self.params.standstill_gap_m };
        let plan = self.behind(scene, (own, standing_m, passing.is_some()), &profile, budget);
        // No plan that stays in the other lane while oncoming traffic arrives.
        let back = passing.map(|passing| passing.committed(BACK_TTC_SHARE * self.params.other_lane_ttc_s));
        let may = |plan: &Plan| {
            back.as_ref().is_none_or(|it| it.may_give_up(plan, self.gentle.line(), &request.start, &place))
        };
        let plan = plan.filter(|plan| may(plan) && self.returns_clear(scene, plan));
        let (swings, plan) = match plan {
            Some(plan) if self.swings_before_person(scene, &plan) => (Some(plan), None),
            plan => (None, plan),
        };
        let plan = plan.or_else(|| back.as_ref().and_then(|back| self.come_back(scene, back, &profile)));
        let plan = plan.or_else(|| back.and_then(|back| self.stop_before_line(scene, &back)));
        plan.or_else(|| self.stop_short(scene)).or(swings)
    }

    /// Stays behind the blockage in the ego's lane: follows it, slows, or stops steadily.
    fn behind(
        &mut self,
        scene: &Scene<'_>,
        (own, standing_m, is_blocked): ((f64, f64), f64, bool),
        profile: &Profile,
        budget: &mut Counted<'_>,
    ) -> Option<Plan> {
        let request = scene.request;
        self.gentle.set_follow_gap(standing_m);
        let alone = (!profile.is_led).then(|| self.profile(scene, Vec::new()));
        if let Some(plan) = self.follow(scene, alone.as_ref().unwrap_or(profile)) {
            return Some(plan);
        }
        // If something else is in the way too, it is passed no faster than the lead allows.
        let led_mps = profile.steps.last().filter(|_| profile.is_led).map(|step| step.speed_mps);
        let target_speed_mps = request.target_speed_mps.min(led_mps.unwrap_or(f64::INFINITY));
        let slower = Request { target_speed_mps, ..*request };
        self.gentle.set_offsets(own.0, own.1);
        let found = if profile.is_led { self.gentle.at_speed(&slower, budget) } else { None };
        let found = found.or_else(|| self.gentle.slower(&slower, budget));
        // If the way past may become free, the ego keeps enough distance to steer out.
        let v = request.start.speed_mps.max(0.0);
        let waits = standing_m > self.params.standstill_gap_m && v < CREEPS_MPS;
        let found = found.filter(|plan| !(waits && ends_slower(plan, CREEPS_MPS)));
        if found.as_ref().is_none_or(|plan| rests(plan) || !self.leads_past(scene, plan))
            && !is_blocked
            && self.manner != Manner::Waits
            && let Some(plan) = self.steer_within(scene, own)
        {
            return Some(plan);
        }
        if let Some(plan) = found.filter(|plan| !ends_beside(plan, request)) {
            let plan = comfortable(plan);
            // A quintic that ends at rest peaks at one and a half times its mean deceleration.
            let stops_for = rests(&plan) && !request.predictions.is_empty();
            let gentler = stops_for.then(|| self.stop(scene, standing_m)).flatten();
            let is_gentler =
                |stop: &Plan| brakes_mps2(stop) < brakes_mps2(&plan) && !ends_beyond(stop, &plan);
            return Some(gentler.filter(is_gentler).unwrap_or(plan));
        }
        // An ego at rest that could not set off on an empty road is not waiting for anybody.
        let alone = Request { predictions: &[], ..slower };
        if v < REST_MPS
            && self.gentle.at_speed(&alone, budget).or_else(|| self.gentle.slower(&alone, budget)).is_none()
        {
            return None;
        }
        self.stop(scene, standing_m)
    }

    /// Road users in the ego's lane ahead of the ego, or moving into it.
    pub(super) fn in_way<'a>(&self, scene: &Scene<'a>) -> impl Iterator<Item = &'a Mover> {
        let (lane, s_m) = (self.lane(scene.request), scene.place.s_m);
        let is_in_way =
            move |one: &&Mover| one.knots.iter().any(|knot| knot.to_m > s_m && lane.is_blocked(knot));
        scene.traffic.movers.iter().filter(is_in_way)
    }

    /// True if a plan, continued at its end offset, passes all things that stand near its end.
    fn leads_past(&self, scene: &Scene<'_>, plan: &Plan) -> bool {
        let end = self.places(plan, scene.place.s_m).last();
        let clearance_m = HARD_CLEARANCE_M.min(self.params.clearance_m);
        end.is_none_or(|(_, end)| is_clear_at(scene, end, (NEAR_M, clearance_m)))
    }

    /// The pass that is under way, while it keeps clear and returns: braking beside the centre would be worse.
    pub(super) fn kept_out(&self, scene: &Scene<'_>, open: &Passing<'_>) -> Option<Plan> {
        let Scene { request, place, .. } = *scene;
        self.under_way(scene).filter(|plan| open.may(plan, self.gentle.line(), &request.start, &place))
    }

    /// The previous plan, while it keeps clear and does not end at rest.
    pub(super) fn under_way(&self, scene: &Scene<'_>) -> Option<Plan> {
        let plan = kept(scene.request, self.gentle.obstacles(), KEPT_SHARE * self.params.clearance_m);
        plan.filter(|plan| !rests(plan))
    }

    /// Blockage of the lane that can be passed on the ground beside it.
    fn passing<'a>(&self, scene: &Scene<'a>) -> Option<Passing<'a>> {
        let Scene { request, place, traffic, .. } = *scene;
        let lane = self.lane(request);
        let beyond = lane.is_over(place.s_m, place.d_m);
        let rules = passing::Rules {
            // A pass under way is abandoned only below a fraction of the margin.
            ttc_min_s: if beyond { UNDER_WAY } else { 1.0 } * self.params.other_lane_ttc_s,
            gain_min_mps: if beyond { f64::NEG_INFINITY } else { self.params.overtake_gain_mps },
            over_line_max_s: self.params.over_line_max_s,
            over_line_max_m: request.overtake_max_m,
            under_way: beyond,
            whole_lane: true,
        };
        if self.manner == Manner::Waits {
            return None;
        }
        let ground = (request.route, request.shape);
        Passing::new(rules, lane, ground, traffic, (&request.start, &place, request.target_speed_mps))
    }

    /// Returns true if a plan that returns to the lane leaves a gap to moving road users behind the ego.
    pub(super) fn returns_clear(&self, scene: &Scene<'_>, plan: &Plan) -> bool {
        let Scene { request, place, traffic, .. } = *scene;
        let lane = self.lane(request);
        if !lane.is_over(place.s_m, place.d_m) {
            return true;
        }
        let back = self.places(plan, place.s_m).find(|(_, [s_m, d_m])| !lane.is_over(*s_m, *d_m));
        let Some((at, [s_m, _])) = back else { return true };
        let t_s = (at - request.start.stamp).as_secs();
        let rear_m = s_m - request.shape.rear_overhang_m;
        traffic.movers.iter().filter(|one| one.is_vehicle() && !one.stands()).all(|one| {
            let at = one.at(t_s);
            !lane.is_blocked(&at) || at.from_m > rear_m || at.to_m + passing::RETURN_GAP_M <= rear_m
        })
    }

    /// Instants of a plan from arc length `s_m` on, with arc length and offset along the line, metres.
    pub(super) fn places(&self, plan: &Plan, mut s_m: f64) -> impl Iterator<Item = (Time, [f64; 2])> {
        plan.points.iter().step_by(2).map(move |p| {
            let (at_m, d_m) = self.gentle.line().project(p.pose.point(), s_m);
            s_m = at_m;
            (p.at, [s_m, d_m])
        })
    }

    /// Speed along the line behind the lead vehicles selected by `counts`; not computed if there are none.
    pub(super) fn led<'a>(
        &self,
        scene: &Scene<'a>,
        steers_out: bool,
        counts: impl Fn(&Mover) -> bool,
    ) -> Profile {
        let (route, width_m) = (scene.request.route, scene.request.shape.width_m);
        let is_met = |one: &Mover| one.kind.is_person() && passing::is_oncoming(one, route, width_m);
        let leads =
            self.in_way(scene).filter(|one| can_lead(one, scene.request) && !is_met(one) && counts(one));
        let moves_out = scene.place.d_m > MOVES_OUT_M;
        let lead = |mover: &'a Mover| {
            let firmly = moves_out && mover.stands() && !mover.changed_lately;
            let is_passed_later = steers_out && mover.comes_to_rest();
            let response = if is_passed_later { Response::PassLater { firmly } } else { Response::Follow };
            Lead { mover, response }
        };
        let leads: Vec<_> = leads.map(lead).collect();
        if leads.is_empty() {
            return Profile::default();
        }
        self.profile(scene, leads)
    }

    /// Speed along the line behind `leads`.
    pub(super) fn profile(&self, scene: &Scene<'_>, leads: Vec<Lead<'_>>) -> Profile {
        let Scene { request, place, vehicle, .. } = *scene;
        let (limits, start) = (request.limits, &request.start);
        let lane = self.lane(request);
        let in_way = |knot: &Knot| lane.is_blocked(knot);
        let follower = Follower {
            gaps: Gaps {
                standstill_m: self.params.standstill_gap_m,
                steer_out_m: self.params.steer_out_gap_m,
                time_s: self.params.time_gap_s,
            },
            accel: Accel {
                most_mps2: limits.accel_max_mps2,
                brake_mps2: limits.brake_max_mps2,
                hardest_mps2: vehicle.brake_max_mps2,
            },
            target_mps: request.target_speed_mps,
            curves: scene.curves,
            front_m: request.shape.length_m - request.shape.rear_overhang_m,
            leads,
            in_way: &in_way,
        };
        let along = math::cos(place.turn_rad).max(0.1) / stretch(&place);
        follower.profile(Step {
            s_m: place.s_m,
            speed_mps: start.speed_mps.max(0.0) * along,
            accel_mps2: start.accel_mps2.clamp(-vehicle.brake_max_mps2, limits.accel_max_mps2) * along,
        })
    }

    /// Speed that the curves from `s_m` on allow, as far as the ego can get plus its stopping distance.
    fn curves(&self, request: &Request<'_>, s_m: f64) -> SpeedTable {
        let v = request.start.speed_mps.max(request.target_speed_mps).max(0.0);
        let brake_mps2 = BRAKE_SHARE * request.limits.brake_max_mps2;
        let curve = Curve {
            accel_mps2: CURVE_SHARE * request.limits.lateral_accel_max_mps2,
            jerk_mps3: self.params.lateral_jerk_max_mps3,
        };
        let length_m = following::AHEAD_S * v + v * v / (2.0 * brake_mps2);
        SpeedTable::new(self.gentle.line(), [s_m, length_m], curve, brake_mps2)
    }

    /// The ego's lane.
    pub(super) fn lane<'a>(&self, request: &Request<'a>) -> Lane<'a> {
        Lane {
            borders: request.route.lane(),
            width_m: request.shape.width_m,
            clearance_m: self.params.clearance_m,
            on_line: self.manner == Manner::Waits,
        }
    }

    /// The plan along a profile, if it is free.
    fn follow(&mut self, scene: &Scene<'_>, profile: &Profile) -> Option<Plan> {
        let Scene { request, place, .. } = *scene;
        let (line, start, steps, shape) = (self.gentle.line(), &request.start, &profile.steps, request.shape);
        let lateral_mps2 = CURVE_SHARE * request.limits.lateral_accel_max_mps2;
        let tightest_1pm = CURVE_SHARE * curvature_max_1pm(request.limits, shape);
        let to_rest = (place.d_m > MOVES_OUT_M)
            .then(|| towards_centre(line, &place, start, steps, (shape, lateral_mps2, tightest_1pm)))
            .flatten();
        let back = back_to_centre(line, &place, start, steps, shape);
        let hard = profile.brake_mps2 > request.limits.brake_max_mps2 + HARDER_MPS2;
        let wanted_m = self.params.clearance_m;
        let clearance_m = if hard { HARD_CLEARANCE_M.min(wanted_m) } else { wanted_m };
        let mut ways = to_rest.into_iter().chain([back]);
        let plan = ways.find_map(|points| self.checked(scene, points, clearance_m))?;
        let status = if hard { PlanStatus::Found } else { PlanStatus::Comfortable };
        Some(Plan { status, ..plan })
    }

    /// The plan through `points`, if it is free and its lateral acceleration is within comfort or about that of its
    /// first point.
    pub(super) fn checked(
        &mut self,
        scene: &Scene<'_>,
        points: Vec<PlanPoint>,
        clearance_m: f64,
    ) -> Option<Plan> {
        let request = scene.request;
        let center = request.start.pose.point();
        self.obstacles.set_near(&scene.traffic.predictions, CollisionMode::MayStop, center, OBSTACLES_M);
        let lateral_mps2 = |p: &PlanPoint| p.curvature_1pm.abs() * p.speed_mps * p.speed_mps;
        let first_mps2 = points.first().map_or(0.0, lateral_mps2);
        let most_mps2 = request.limits.lateral_accel_max_mps2.max(SWERVE_SHARE * first_mps2);
        let poses: Vec<(Pose2, Time)> = points.iter().map(|p| (p.pose, p.at)).collect();
        let tightest_1pm = curvature_max_1pm(request.limits, request.shape);
        let holds = points.iter().all(|p| lateral_mps2(p) <= most_mps2 && p.curvature_1pm.abs() <= tightest_1pm)
                && points.windows(2).all(|two| bends_at_most([&two[0], &two[1]], most_mps2))
                // The road takes several times as long to check as the obstacles.
                && self.obstacles.path_free(|pose| request.shape.footprint(pose), &poses, clearance_m)
                && self.gentle.keeps_road(request, &poses);
        holds.then_some(Plan { stamp: request.stamp, status: PlanStatus::Comfortable, points, work: 0 })
    }
}

/// False if the way between two points turns away from its first heading by more than a lateral acceleration allows: a
/// move shorter than the distance of the points has no curvature at either.
fn bends_at_most([from, to]: [&PlanPoint; 2], lateral_mps2: f64) -> bool {
    let way = to.pose.point() - from.pose.point();
    let aside_m = way.dot(from.pose.direction().left()).abs();
    let dt_s = (to.at - from.at).as_secs();
    aside_m <= 0.5 * lateral_mps2 * dt_s * dt_s + BENDS_M
}

/// Offset that two points may have besides, metres.
const BENDS_M: f64 = 0.1;

/// Target speed; if a road user behind is about to hit the ego, its speed, up to a factor above the target.
fn hurried_mps(target_mps: f64, speed_mps: f64, follower: Option<Behind>) -> f64 {
    let Some(Behind { gap_m, speed_mps: behind_mps }) = follower else { return target_mps };
    let closing_mps = behind_mps - speed_mps.min(target_mps);
    if closing_mps * HURRIED_BEFORE_S < gap_m {
        return target_mps;
    }
    behind_mps.clamp(target_mps, HURRIED_SHARE * target_mps.max(0.0))
}

/// An ego that would be hit within this time, seconds, speeds up to at most this multiple of its target speed.
const HURRIED_BEFORE_S: f64 = 2.0;
const HURRIED_SHARE: f64 = 1.2;

/// Fraction of it that suffices while an ego that abandons a pass returns to its lane.
const BACK_TTC_SHARE: f64 = 0.25;

/// Offsets that keep the ego in its lane, metres: to the left of the line, and to its right.
fn own_offsets_m(request: &Request<'_>, place: &OnLine) -> (f64, f64) {
    let lane = request.route.lane();
    let ahead = [place.s_m, place.s_m + LANE_AHEAD_M];
    let room_m = |border_m: f64| {
        let room_m = border_m - 0.5 * request.shape.width_m - LANE_EDGE_M;
        (room_m / LATERAL_STEP_M).floor().max(0.0) * LATERAL_STEP_M
    };
    let [left_m, right_m] = [lane.left(), lane.right()].map(|border| room_m(border.min_between_m(ahead)));
    (left_m.min(LEFT_MAX_M), right_m.min(RIGHT_MAX_M))
}

/// Step of a pedestrian to the side that she faces, metres.
const STEP_OUT_M: f64 = 1.0;

/// A stop that needs more than this fraction of the comfort deceleration is not made to gain passing distance beyond
/// the clearance.
const FIRM_SHARE: f64 = 0.75;

/// Fractions of its speed at which the ego passes; the first that leaves a way is used.
const PASSING_SHARES: [f64; 3] = [1.0, 0.85, 0.7];

/// Below this speed the ego creeps, m/s.
const CREEPS_MPS: f64 = 1.5;

/// Look-ahead distance for the lane's borders, metres.
const LANE_AHEAD_M: f64 = 60.0;

/// Fraction of the clearance that suffices for a pass under way.
const KEPT_SHARE: f64 = 0.8;
