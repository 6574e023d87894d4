//! A comfortable layer above a planner: while a plan within limits of comfort is free it is driven, else what the planner
//! finds within the vehicle's own.
//!
//! The layer searches Frenet candidates (Werling 2010, as [`crate::fot`]) along the line with its corners eased, so that
//! curvature comes and goes at a bounded rate, from where the previous plan has the ego by now: plans made one after
//! another are one motion, and what is remembered comes with the request.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_core::param::{ParamError, require_not_negative, require_positive, require_within};
use swerve_geom::{Pose2, angle_between};
use swerve_msg::{EgoState, Plan, PlanPoint, PlanStatus};
use swerve_vehicle::Limits;

use crate::collision::{CollisionMode, Obstacles};
use crate::following::{Accel, Follower, Gaps, Profile, SpeedTable, Step};
use crate::fot::line::{Line, OnLine};
use crate::fot::{self, Fot};
use crate::lane::{Lane, back_to_centre};
use crate::passing::{self, Passing};
use crate::request::{Budget, Counted, Planner, Request};
use crate::steady_stop;
use crate::traffic::{Behind, Knot, Mover, Traffic, without_followers};

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
    /// Time gap to a lead vehicle, seconds. Source: ISO 15622 has 1.0 to 2.2.
    pub time_gap_s: f64,
    /// Gap to a lead vehicle at standstill, metres. Source: Treiber, Hennecke and Helbing 2000.
    pub standstill_gap_m: f64,
    /// Gap to what stands in the lane where the other lane leads past it, metres: from here the ego can steer out.
    pub steer_out_gap_m: f64,
    /// The other lane is entered only with at least this time to collision with everybody in it, until the ego is back,
    /// seconds.
    pub other_lane_ttc_s: f64,
    /// A moving vehicle is overtaken only where it is slower than the target speed by at least this, m/s.
    pub overtake_gain_mps: f64,
    /// Longest time over the line of the own lane, seconds.
    pub over_line_max_s: f64,
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
            time_gap_s: 1.5,
            standstill_gap_m: 2.0,
            steer_out_gap_m: 7.0,
            other_lane_ttc_s: 4.0,
            overtake_gain_mps: 3.0,
            over_line_max_s: 12.0,
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
        require_within("ease_m", self.ease_m, [0.0, EASE_MAX_M])?;
        require_within("time_gap_s", self.time_gap_s, [0.5, 10.0])?;
        require_within("standstill_gap_m", self.standstill_gap_m, [0.5, 50.0])?;
        require_within("steer_out_gap_m", self.steer_out_gap_m, [0.5, 50.0])?;
        require_not_negative("other_lane_ttc_s", self.other_lane_ttc_s)?;
        require_not_negative("overtake_gain_mps", self.overtake_gain_mps)?;
        require_not_negative("over_line_max_s", self.over_line_max_s)
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
    manner: Manner,
    gentle: Fot,
    obstacles: Obstacles,
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
        let gentle = Fot::eased(gentle(&params, collision, manner), params.ease_m)?;
        Ok(Self { params, manner, gentle, obstacles: Obstacles::default(), planner })
    }

    /// A plan of this layer, if one is free: within the limits of comfort, or in the own lane braking harder where the least
    /// that suffices for a vehicle is more.
    fn comfortable(
        &mut self,
        request: &Request<'_>,
        follower: Option<Behind>,
        budget: &mut Counted<'_>,
    ) -> Option<Plan> {
        let limits = self.params.within(request);
        let start = taken_up(request);
        // Out of a swerve that is not comfortable only the planner below leads.
        if (start.speed_mps * start.yaw_rate_radps).abs() > SWERVE_SHARE * limits.lateral_accel_max_mps2 {
            return None;
        }
        let easy = Request { start, limits: &limits, ..*request };
        let curves_mps = before_curves_mps(self.gentle.along(&easy), &easy);
        let hurried_mps = hurried_mps(request.target_speed_mps, start.speed_mps, follower);
        let place = self.gentle.place(&easy);
        let traffic = Traffic::new(&easy, self.gentle.line(), place.s_m);
        let predictions =
            if self.manner == Manner::Waits { request.predictions } else { &traffic.predictions };
        let easy = Request { target_speed_mps: hurried_mps.min(curves_mps), predictions, ..easy };
        let scene = Scene { request: &easy, place, traffic: &traffic, vehicle: request.limits };
        self.free_in(&scene, budget)
    }

    /// The first free plan of: on in the own lane, past what blocks it, behind that.
    fn free_in(&mut self, scene: &Scene<'_>, budget: &mut Counted<'_>) -> Option<Plan> {
        let Scene { request, place, traffic, .. } = *scene;
        let passing = self.passing(scene);
        let open = passing.as_ref().filter(|passing| passing.may_open(&request.start, &place));
        let possible = passing.as_ref().is_some_and(Passing::is_possible);
        let passed = |one: &Mover| open.is_some_and(|open| open.passes(one));
        let waits = self.manner == Manner::Waits;
        let own = if waits { (0.0, 0.0) } else { own_offsets_m(request, &place) };
        let mut profile = self.profile(scene, possible, |one| !passed(one));
        if !profile.is_led {
            self.gentle.set_offsets(own.0, own.1);
            let plan = self.gentle.at_speed(request, budget);
            if let Some(plan) = plan.filter(|plan| self.returns_clear(scene, plan)) {
                return Some(comfortable(plan));
            }
        }
        if let Some(open) = open {
            self.gentle.set_offsets(stepped_up_m(open.offset_m), own.1);
            let led_mps = profile.steps.last().map_or(0.0, |step| step.speed_mps);
            let target_speed_mps = if profile.is_led { led_mps } else { request.target_speed_mps };
            let plan = self.gentle.at_speed(&Request { target_speed_mps, ..*request }, budget);
            let may = |plan: &Plan| open.may(plan, self.gentle.line(), &request.start, &place);
            if let Some(plan) = plan.filter(may) {
                return Some(comfortable(plan));
            }
            profile = self.profile(scene, possible, |_| true);
        }
        self.behind(scene, own, &profile, budget)
    }

    /// Behind what is in the way in the own lane: led by it, slower, stopping steadily.
    fn behind(
        &mut self,
        scene: &Scene<'_>,
        own: (f64, f64),
        profile: &Profile,
        budget: &mut Counted<'_>,
    ) -> Option<Plan> {
        let request = scene.request;
        if profile.is_led
            && let Some(plan) = self.follow(scene, profile)
        {
            return Some(plan);
        }
        // Where something else is in the way, too, it is gone round no faster than the lead allows.
        let led_mps = profile.steps.last().filter(|_| profile.is_led).map(|step| step.speed_mps);
        let target_speed_mps = request.target_speed_mps.min(led_mps.unwrap_or(f64::INFINITY));
        let slower = Request { target_speed_mps, ..*request };
        self.gentle.set_offsets(own.0, own.1);
        let found = if profile.is_led { self.gentle.at_speed(&slower, budget) } else { None };
        let found = found.or_else(|| self.gentle.slower(&slower, budget));
        if let Some(plan) = found.filter(|plan| !ends_beside(plan, request, self.gentle.line(), &scene.place))
        {
            return Some(comfortable(plan));
        }
        let way = self.gentle.way_on(request);
        let gaps_m = [self.params.standstill_gap_m, self.params.clearance_m];
        let stop = |brakes_mps2: [f64; 2]| {
            let steps = (1..=BRAKE_STEPS).map(|k| f64::from(k) / f64::from(BRAKE_STEPS));
            let brakes = steps.map(|share| brakes_mps2[0] + share * (brakes_mps2[1] - brakes_mps2[0]));
            steady_stop::stop(request, &way, self.gentle.obstacles(), brakes, gaps_m)
        };
        let comfort_mps2 = request.limits.brake_max_mps2;
        if let Some(plan) = stop([0.0, comfort_mps2]) {
            return Some(comfortable(plan));
        }
        // A vehicle in the lane is braked for in the lane; who is gone round for a person, by the planner below.
        let plan = if self.only_vehicles_in_way(scene) {
            stop([comfort_mps2, scene.vehicle.brake_max_mps2])
        } else {
            None
        };
        plan.map(|plan| Plan { status: PlanStatus::Found, ..plan })
    }

    /// Whether all that is or comes into the own lane are vehicles.
    fn only_vehicles_in_way(&self, scene: &Scene<'_>) -> bool {
        let lane = self.lane(scene.request);
        let mut in_way =
            scene.traffic.movers.iter().filter(|one| {
                one.knots.iter().any(|knot| knot.to_m > scene.place.s_m && lane.is_blocked(knot))
            });
        in_way.all(Mover::is_vehicle)
    }

    /// What blocks the lane and can be passed by the ground beside it.
    fn passing<'a>(&self, scene: &Scene<'a>) -> Option<Passing<'a>> {
        let Scene { request, place, traffic, .. } = *scene;
        let half_m = 0.5 * request.shape.width_m;
        let beyond = place.d_m + half_m > request.route.lane().left_m(place.s_m) + passing::OVER_LINE_M;
        let rules = passing::Rules {
            // A way that is under way is not given up for less than a part of the margin.
            ttc_min_s: if beyond { UNDER_WAY } else { 1.0 } * self.params.other_lane_ttc_s,
            gain_min_mps: if beyond { 0.0 } else { self.params.overtake_gain_mps },
            over_line_max_s: self.params.over_line_max_s,
        };
        if self.manner == Manner::Waits {
            return None;
        }
        let ground = (request.route, request.shape);
        Passing::new(rules, self.lane(request), ground, traffic, place.s_m, request.target_speed_mps)
    }

    /// Whether a plan that comes back into the lane leaves a gap to whoever moves there behind the ego.
    fn returns_clear(&self, scene: &Scene<'_>, plan: &Plan) -> bool {
        let Scene { request, place, traffic, .. } = *scene;
        let half_m = 0.5 * request.shape.width_m;
        let lane = self.lane(request);
        if place.d_m + half_m <= lane.borders.left_m(place.s_m) + passing::OVER_LINE_M {
            return true;
        }
        let line = self.gentle.line();
        let mut s_m = place.s_m;
        for p in plan.points.iter().step_by(2) {
            let (at_m, d_m) = line.project(p.pose.point(), s_m);
            s_m = at_m;
            if d_m + half_m > lane.borders.left_m(s_m) + passing::OVER_LINE_M {
                continue;
            }
            let t_s = (p.at - request.start.stamp).as_secs();
            let rear_m = s_m - request.shape.rear_overhang_m;
            return traffic.movers.iter().filter(|one| one.is_vehicle() && !one.stands()).all(|one| {
                let at = one.at(t_s);
                !lane.is_blocked(&at) || at.from_m > rear_m || at.to_m + passing::RETURN_GAP_M <= rear_m
            });
        }
        true
    }

    /// The speed along the line behind lead vehicles, those of them that `counts` says.
    fn profile(&self, scene: &Scene<'_>, steers_out: bool, counts: impl Fn(&Mover) -> bool) -> Profile {
        let Scene { request, place, traffic, vehicle } = *scene;
        let (line, limits, start) = (self.gentle.line(), request.limits, &request.start);
        let lane = self.lane(request);
        let in_way = |knot: &Knot| lane.is_blocked(knot);
        let brake_mps2 = BRAKE_SHARE * limits.brake_max_mps2;
        let lateral_mps2 = CURVE_SHARE * limits.lateral_accel_max_mps2;
        let leads = traffic.movers.iter().filter(|one| one.is_vehicle() && counts(one));
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
            curves: &SpeedTable::new(line, place.s_m, TABLE_M, lateral_mps2, brake_mps2),
            front_m: request.shape.length_m - request.shape.rear_overhang_m,
            leads: leads.map(|one| (one, steers_out && one.stands())).collect(),
            in_way: &in_way,
        };
        follower.profile(Step {
            s_m: place.s_m,
            speed_mps: start.speed_mps.max(0.0),
            accel_mps2: start.accel_mps2.clamp(-vehicle.brake_max_mps2, limits.accel_max_mps2),
        })
    }

    /// The ego's lane.
    fn lane<'a>(&self, request: &Request<'a>) -> Lane<'a> {
        Lane {
            borders: request.route.lane(),
            width_m: request.shape.width_m,
            clearance_m: self.params.clearance_m,
            on_line: self.manner == Manner::Waits,
        }
    }

    /// The plan along a profile, if it is free.
    fn follow(&mut self, scene: &Scene<'_>, profile: &Profile) -> Option<Plan> {
        let request = scene.request;
        let (start, shape) = (&request.start, request.shape);
        let reach_m = OBSTACLES_M;
        self.obstacles.set_near(
            &scene.traffic.predictions,
            CollisionMode::MayStop,
            start.pose.point(),
            reach_m,
        );
        let points = back_to_centre(self.gentle.line(), &scene.place, start, &profile.steps, shape);
        let lateral_mps2 = |p: &PlanPoint| p.curvature_1pm.abs() * p.speed_mps * p.speed_mps;
        let first_mps2 = points.first().map_or(0.0, lateral_mps2);
        let most_mps2 = request.limits.lateral_accel_max_mps2.max(SWERVE_SHARE * first_mps2);
        let poses: Vec<(Pose2, Time)> = points.iter().map(|p| (p.pose, p.at)).collect();
        let hard = profile.brake_mps2 > request.limits.brake_max_mps2 + HARDER_MPS2;
        let wanted_m = self.params.clearance_m;
        let clearance_m = if hard { HARD_CLEARANCE_M.min(wanted_m) } else { wanted_m };
        let free = self.obstacles.path_free(|pose| shape.footprint(pose), &poses, clearance_m);
        let status = if hard { PlanStatus::Found } else { PlanStatus::Comfortable };
        let holds = free && points.iter().all(|p| lateral_mps2(p) <= most_mps2);
        holds.then_some(Plan { stamp: request.stamp, status, points, work: 0 })
    }
}

/// What the layer plans in.
#[derive(Clone, Copy)]
struct Scene<'a> {
    /// From where the plan takes the ego up, within the limits of comfort.
    request: &'a Request<'a>,
    /// There along the line.
    place: OnLine,
    traffic: &'a Traffic,
    /// Limits of the vehicle.
    vehicle: &'a Limits,
}

fn comfortable(plan: Plan) -> Plan {
    Plan { status: PlanStatus::Comfortable, ..plan }
}

/// The target speed, or where somebody behind is about to run into the ego their speed, up to a share more.
fn hurried_mps(target_mps: f64, speed_mps: f64, follower: Option<Behind>) -> f64 {
    let Some(Behind { gap_m, speed_mps: behind_mps }) = follower else { return target_mps };
    let closing_mps = behind_mps - speed_mps.min(target_mps);
    if closing_mps * HURRIED_BEFORE_S < gap_m {
        return target_mps;
    }
    behind_mps.clamp(target_mps, HURRIED_SHARE * target_mps.max(0.0))
}

/// An ego that is run into within this time, seconds, hurries to at most this share of its target speed.
const HURRIED_BEFORE_S: f64 = 4.0;
const HURRIED_SHARE: f64 = 1.2;

/// Share of the time to collision in the other lane that is enough once the ego is in it.
const UNDER_WAY: f64 = 0.6;

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

/// The next offset of the lattice that is no less, metres.
fn stepped_up_m(offset_m: f64) -> f64 {
    ((offset_m / LATERAL_STEP_M).ceil() * LATERAL_STEP_M).min(LEFT_MAX_M)
}

/// Whether a plan ends at rest beyond the own lane.
fn ends_beside(plan: &Plan, request: &Request<'_>, line: &Line, place: &OnLine) -> bool {
    let Some(end) = plan.points.last().filter(|p| p.speed_mps < AT_REST_MPS) else { return false };
    let (s_m, d_m) = line.project(end.pose.point(), place.s_m);
    d_m + 0.5 * request.shape.width_m > request.route.lane().left_m(s_m) + passing::OVER_LINE_M
}

/// Slower than this the ego is at rest, m/s.
const AT_REST_MPS: f64 = 0.5;

/// Offsets of candidates: their distance, and the furthest, metres.
const LATERAL_STEP_M: f64 = 0.25;
const LEFT_MAX_M: f64 = 4.0;
const RIGHT_MAX_M: f64 = 1.0;

/// The lane's borders are looked at this far ahead, and kept away from by this much, metres.
const LANE_AHEAD_M: f64 = 60.0;
const LANE_EDGE_M: f64 = 0.05;

/// Obstacles that never come within this are left out, metres.
const OBSTACLES_M: f64 = 100.0;

/// Steady decelerations that are tried, up to a limit.
const BRAKE_STEPS: u32 = 7;

/// Curves are looked at this far ahead of a profile, metres.
const TABLE_M: f64 = 160.0;

/// A plan that brakes harder than comfort allows by more than this is not comfortable, m/s².
const HARDER_MPS2: f64 = 0.1;

/// Distance from obstacles that is enough where comfort is not, metres.
const HARD_CLEARANCE_M: f64 = 0.3;

/// A lateral acceleration beyond this share of the limit is not that of a comfortable plan.
const SWERVE_SHARE: f64 = 1.1;

impl Planner for Comfort {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let mut counted = Counted::new(budget);
        let Request { route, start, shape, .. } = *request;
        let (predictions, follower) =
            without_followers(request.predictions, (route, start.pose, shape), start.speed_mps);
        let request = &Request { predictions: &predictions, ..*request };
        let comfortable = self.comfortable(request, follower, &mut counted);
        let plan = comfortable.unwrap_or_else(|| self.planner.plan(request, &mut counted));
        Plan { work: counted.spent, ..plan }
    }
}

/// The layer's candidates: later ends and more speeds than the paper's, and where the planner does not ask for it far less
/// weight on nearness.
fn gentle(params: &Params, collision: CollisionMode, manner: Manner) -> fot::Params {
    let round = fot::Params {
        collision,
        obstacle_range_m: OBSTACLES_M,
        clearance_m: params.clearance_m,
        left_m: LEFT_MAX_M,
        lateral_step_m: LATERAL_STEP_M,
        time_step_s: 0.5,
        speed_step_mps: 0.5,
        speed_steps: 1,
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
    use swerve_geom::{Point2, math};
    use swerve_msg::Prediction;

    use super::*;
    use swerve_core::Span;

    use crate::request::Unlimited;
    use crate::steady_stop::STEP_S;
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
