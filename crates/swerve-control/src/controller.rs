//! The controller: selects path, target speed and control law.

mod gentle;
mod params;
mod reckoning;
mod stop;
mod wheels;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_geom::{FrenetPoint, LineTracker, Pose2, math};
use swerve_msg::{Command, EgoState, Plan, PlanPoint, Route};
use swerve_vehicle::{Limits, Shape};

use crate::grip::Grip;
use crate::lateral::{self, OnPath};
use crate::mpc::{self, Knot, Mpc, State};
use crate::reference::Reference;
use crate::speed::{SpeedLaw, Stop, Target};
use crate::{AccelToPedals, Pedals, pid};
use gentle::Rise;
use reckoning::Reckoning;

pub use params::{AlongParams, ComfortAccelParams, Following, Law, Params, StopParams};

/// Input of one control step.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// The current instant.
    pub now: Time,
    /// The measured ego state.
    pub ego: &'a EgoState,
    /// The latest plan, or `None` before the first.
    pub plan: Option<&'a Plan>,
    /// Route: followed before the first plan, and beyond the end of a plan.
    pub route: &'a Route,
}

impl Input<'_> {
    /// Instant of the state. The state is compared with the plan at this instant, so that latency does not count as lag
    /// behind the plan. A state older than 50 ms is first extrapolated to now using the past commands.
    fn stated(&self) -> Time {
        self.ego.stamp.min(self.now)
    }
}

/// Result of a step.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Output {
    /// Command to the vehicle.
    pub command: Command,
    /// Target speed, m/s.
    pub speed_mps: f64,
    /// Target acceleration, m/s²; `None` if the law operates the pedals itself.
    pub accel_mps2: Option<f64>,
    /// The path that the command follows.
    pub status: Status,
    /// Report of the model predictive law, with [`Law::Mpc`].
    pub mpc: Option<mpc::Report>,
}

/// The path that a command follows.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// No plan yet: the route, at the speed of the first step.
    Route,
    /// The plan.
    Plan,
    /// A comfortable stop along the last path.
    Stopping(StopReason),
    /// The ego state is not finite or too old: a stop along the last path by dead reckoning.
    Blind,
}

/// Reason for a stop of the controller.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// The last point of the plan has passed.
    PlanExpired,
    /// The plan has no points.
    PlanEmpty,
    /// The plan contains a non-finite number.
    PlanNotFinite,
    /// The plan was made before ego states resumed: the ego is not where the plan expected it.
    PlanOutdated,
}

/// A controller: from plans to commands for the vehicle.
pub trait Controller: Send {
    /// Runs one control step. To be called at a fixed rate. A plan whose last point has passed is over: the vehicle
    /// is stopped along its path.
    fn step(&mut self, input: &Input<'_>) -> Output;
}

/// Follows plans with one of the [`Law`]s.
pub struct LawController {
    params: Params,
    shape: Shape,
    limits: Limits,
    drive: Box<dyn AccelToPedals>,
    reference: Reference,
    pid: pid::Pid,
    speed: SpeedLaw,
    /// Speed at which the route is followed before the first plan.
    route_speed_mps: Option<f64>,
    /// The stop under way.
    stopping: Option<Stop>,
    /// The last usable state.
    seen: Option<EgoState>,
    reckoning: Reckoning,
    /// Stamp of the first state after an interval without states.
    seen_again: Option<Time>,
    before: Option<Time>,
    /// Steering angle of the last command.
    steering_rad: f64,
    accel_mps2: f64,
    rise: Rise,
    grip: Grip,
    mpc: Option<Predictive>,
    /// Tracker of the ego's place along the route, with its arc length, metres.
    place: LineTracker,
    route_m: f64,
}

/// The model predictive law and its last input.
struct Predictive {
    mpc: Mpc,
    start: State,
    knots: Vec<Knot>,
}

impl LawController {
    /// Creates a controller for a vehicle of this shape and these limits; `drive` maps accelerations to its pedals.
    pub fn new(params: Params, shape: Shape, limits: Limits, drive: Box<dyn AccelToPedals>) -> Self {
        let mpc = (params.law == Law::Mpc).then(|| Predictive {
            mpc: Mpc::new(params.mpc, shape.wheelbase_m, &limits),
            start: State::default(),
            knots: Vec::with_capacity(params.mpc.horizon + 1),
        });
        Self {
            params,
            shape,
            limits,
            drive,
            mpc,
            reference: Reference::default(),
            pid: pid::Pid::new(params.pid),
            speed: SpeedLaw::new(params.speed),
            route_speed_mps: None,
            stopping: None,
            seen: None,
            reckoning: Reckoning::new(params.slip, shape.wheelbase_m, params.stanley.preview_s),
            seen_again: None,
            before: None,
            steering_rad: 0.0,
            accel_mps2: 0.0,
            rise: Rise::default(),
            grip: Grip::new(params.grip),
            place: LineTracker::default(),
            route_m: 0.0,
        }
    }

    /// Start state and knots of the last step of the model predictive law, for inspection and comparison.
    pub fn posed(&self) -> Option<(State, &[Knot])> {
        self.mpc.as_ref().map(|predictive| (predictive.start, &*predictive.knots))
    }

    /// Output before the first state: wheels held, brake applied.
    fn held(&self) -> Output {
        let brake = self.drive.pedals(-self.params.stop.blind_decel_mps2, 0.0).brake;
        let command = Command { steering_rad: self.steering_rad, throttle: 0.0, brake };
        Output { command, speed_mps: 0.0, accel_mps2: None, status: Status::Blind, mpc: None }
    }

    /// Selects the path and loads it as the reference.
    fn load(&mut self, input: &Input<'_>, is_seen: bool) -> Status {
        use StopReason::{PlanExpired, PlanOutdated};
        let Input { now, ego, route, .. } = *input;
        let route_speed = *self.route_speed_mps.get_or_insert(ego.speed_mps.max(0.0));
        let status = match input.plan {
            None => Status::Route,
            Some(plan) if plan.points.is_empty() => Status::Stopping(StopReason::PlanEmpty),
            Some(plan) if !plan_is_finite(plan) => Status::Stopping(StopReason::PlanNotFinite),
            Some(plan) if self.seen_again.is_some_and(|again| plan.stamp < again) => {
                Status::Stopping(StopReason::PlanOutdated)
            }
            Some(plan) if now > plan.end() => Status::Stopping(StopReason::PlanExpired),
            Some(_) => Status::Plan,
        };
        match (status, input.plan) {
            // Keeps the previous path.
            _ if !is_seen || self.reckoning.is_overdue() => {}
            (Status::Plan | Status::Stopping(PlanExpired | PlanOutdated), Some(plan)) => {
                self.reference.load_plan(plan);
            }
            _ => self.reference.load_route(route, self.route_m, route_speed, now),
        }
        let status = if is_seen { status } else { Status::Blind };
        match status {
            Status::Stopping(_) => self.begin_stop(now, ego),
            Status::Route | Status::Plan | Status::Blind => self.stopping = None,
        }
        status
    }

    /// Place of the ego on the path, with its target there.
    fn here(&mut self, input: &Input<'_>, status: Status) -> Here {
        let Input { now, ego, route, .. } = *input;
        let by_time = status == Status::Plan && self.params.following == Following::Time;
        let point = ego.pose.point();
        let along = self.params.along;
        let then = input.stated();
        let due_m = self.reference.s_at(then);
        let mut s_m = if by_time {
            self.reference.project_near(point, due_m, along.reach_m)
        } else {
            self.reference.project(point)
        };
        let until_m = s_m.max(0.0) + self.reach_m(ego.speed_mps);
        self.reference.extend(route, self.route_m - s_m.max(0.0), until_m);
        if !by_time && s_m >= 0.0 {
            // Beyond the end of the plan the ego is on the plan's continuation.
            s_m = self.reference.project(point);
        }
        let from_m = if by_time { due_m } else { s_m };
        let planned = input.plan.filter(|_| by_time).and_then(|plan| plan.at(then));
        let here = planned.or_else(|| self.reference.at(from_m)).unwrap_or_default();
        let mut target = Target { speed_mps: here.speed_mps, accel_mps2: here.accel_mps2 };
        if by_time {
            let late_m = (due_m - s_m) * along.gain_ps;
            target.speed_mps += late_m.clamp(-along.speed_max_mps, along.speed_max_mps);
            target.speed_mps = target.speed_mps.max(0.0);
        }
        if let Some(stop) = self.stopping {
            target = stop.target(now);
        }
        Here { s_m, from_m, target }
    }

    /// Length of path that a law may use, metres.
    fn reach_m(&self, speed_mps: f64) -> f64 {
        let lookahead = match self.params.law {
            Law::Mpc => {
                let seconds = self.params.mpc.dt_s * self.params.mpc.horizon as f64;
                speed_mps.max(0.0) * seconds + 0.5 * self.limits.accel_max_mps2 * seconds * seconds
            }
            _ => self.params.pure_pursuit.lookahead_m(speed_mps),
        };
        lookahead.max(self.params.waypoint.waypoint_min_m) + 5.0
    }

    fn step_pid(&mut self, input: &Input<'_>, here: &Here, dt_s: f64) -> (f64, Drive) {
        let ego = input.ego;
        let min_m = self.params.waypoint.waypoint_min_m;
        let waypoint =
            self.reference.waypoint(ego.pose.point(), here.from_m, min_m).copied().unwrap_or_default();
        let target_mps = if self.stopping.is_some() { here.target.speed_mps } else { waypoint.speed_mps };
        let steering = lateral::waypoint_angle(ego.pose, waypoint.pose.point(), &self.params.waypoint);
        let pedals = self.pid.step(target_mps, ego.speed_mps, dt_s);
        (steering, Drive { pedals, speed_mps: target_mps, accel_mps2: None })
    }

    fn step_tracker(&mut self, input: &Input<'_>, here: &Here, status: Status, dt_s: f64) -> (f64, Drive) {
        let ego = input.ego;
        let steering_rad = self.steering_by(self.params.law, ego, here, 0.0);
        let most_mps2 = self.accel_most_mps2(input, status, here.target.accel_mps2);
        let accel_mps2 = self.speed.accel_within(most_mps2, here.target, ego.speed_mps, dt_s);
        (steering_rad, self.drive_at(here.target.speed_mps, accel_mps2, ego))
    }

    /// Angle of the front road wheels by a path-tracking law, radians; tyre slip is that at the given deceleration.
    fn steering_by(&self, law: Law, ego: &EgoState, here: &Here, decel_mps2: f64) -> f64 {
        let beside = self.at(here.s_m);
        let speed = ego.speed_mps.max(0.0);
        let preview_s = match law {
            Law::PurePursuit => self.params.pure_pursuit.preview_s,
            _ => self.params.stanley.preview_s,
        };
        let ahead = self.at(here.s_m + preview_s * speed);
        let on_path = OnPath { pose: beside.pose, curvature_1pm: ahead.curvature_1pm };
        let course = self.course(ego, &beside);
        let wheelbase = self.shape.wheelbase_m;
        let steering_rad = if law == Law::PurePursuit {
            let params = &self.params.pure_pursuit;
            let goal = self.at(here.s_m + params.lookahead_m(ego.speed_mps)).pose.point();
            lateral::pure_pursuit(course, goal, on_path, wheelbase, params)
        } else {
            let params = &self.params.stanley;
            lateral::stanley(course, ego.speed_mps, ego.yaw_rate_radps, on_path, wheelbase, params)
        };
        steering_rad + self.params.slip.added_m(wheelbase, speed, decel_mps2) * ahead.curvature_1pm
    }

    /// Ego pose with the heading replaced by the course of the rear axle: in a turn the nose points further inwards.
    fn course(&self, ego: &EgoState, beside: &PlanPoint) -> Pose2 {
        let EgoState { pose, speed_mps, .. } = *ego;
        let course_rad = self.params.slip.course_rad(pose.heading_rad, beside.curvature_1pm, speed_mps);
        Pose2::new(pose.x_m, pose.y_m, course_rad)
    }

    fn step_mpc(
        &mut self,
        input: &Input<'_>,
        here: &Here,
        status: Status,
        report: &mut Option<mpc::Report>,
    ) -> (f64, Drive) {
        let ego = input.ego;
        let mut predictive = self.mpc.take().expect("built with the law and put back below");
        self.lay_knots(input, here, status, &mut predictive.knots);
        let start = State {
            pose: self.course(ego, &self.at(here.s_m)),
            speed_mps: ego.speed_mps,
            steering_rad: ego.steering_rad,
            accel_mps2: ego.accel_mps2,
        };
        predictive.start = start;
        let step = predictive.mpc.step(input.now, &start, &predictive.knots);
        let wanted = predictive.knots.iter().fold(0.0, |v: f64, knot| v.max(knot.wanted_speed_mps));
        self.mpc = Some(predictive);
        *report = Some(step.report);
        let rests = wanted < 0.05 && ego.speed_mps.abs() < 0.3;
        let accel = if rests { -self.params.speed.hold_mps2 } else { step.accel_mps2 };
        let accel = accel.min(self.accel_most_mps2(input, status, here.target.accel_mps2));
        // The horizon may begin with low speeds: the speed at its end is the target.
        (step.steering_rad, self.drive_at(wanted, accel, ego))
    }

    /// Pedals for an acceleration on the way to a speed.
    fn drive_at(&self, speed_mps: f64, accel_mps2: f64, ego: &EgoState) -> Drive {
        let pedals = self.drive.pedals(accel_mps2, ego.speed_mps);
        Drive { pedals, speed_mps, accel_mps2: Some(accel_mps2) }
    }

    /// Places one knot per step of the horizon along the path, at speeds limited by how fast the ego can reach the
    /// target speeds.
    fn lay_knots(&self, input: &Input<'_>, here: &Here, status: Status, knots: &mut Vec<Knot>) {
        let Input { ego, route, .. } = *input;
        let then = input.stated();
        let dt = Span::from_secs(self.params.mpc.dt_s);
        let dt_s = dt.as_secs();
        let (mut s_m, mut speed_mps) = (here.s_m, ego.speed_mps.max(0.0));
        let slowest = -self.limits.brake_max_mps2 * dt_s;
        let fastest = self.limits.accel_max_mps2 * dt_s;
        knots.clear();
        for k in 0..=self.params.mpc.horizon as i64 {
            let on_path = self.at(s_m);
            let wanted = self.wanted(input, status, then + dt * k, s_m);
            let change = (wanted.speed_mps - speed_mps).clamp(slowest, fastest);
            let (left_m, right_m) = self.room(route, &on_path, s_m - here.s_m);
            knots.push(Knot {
                state: State {
                    pose: on_path.pose,
                    speed_mps,
                    steering_rad: self.steering_of(on_path.curvature_1pm),
                    accel_mps2: 0.0,
                },
                wanted_along_m: wanted.ahead_m,
                wanted_speed_mps: wanted.speed_mps.min(self.params.mpc.speed_max_mps),
                wanted_accel_mps2: wanted.accel_mps2,
                left_m,
                right_m,
            });
            let next = (speed_mps + change).max(0.0);
            s_m += 0.5 * (speed_mps + next) * dt_s;
            speed_mps = next;
        }
    }

    /// Target place and speed at `instant`, given the expected arc length `s_m` then.
    fn wanted(&self, input: &Input<'_>, status: Status, instant: Time, s_m: f64) -> Wanted {
        if let Some(stop) = self.stopping {
            let target = stop.target(instant);
            return Wanted { ahead_m: 0.0, speed_mps: target.speed_mps, accel_mps2: target.accel_mps2 };
        }
        let by_time = status == Status::Plan && self.params.following == Following::Time;
        match input.plan.filter(|_| by_time).and_then(|plan| plan.at(instant)) {
            Some(point) => {
                // A lag beyond the reach of the speed correction is reduced gradually.
                let along = self.params.along;
                let most = along.speed_max_mps / along.gain_ps;
                Wanted {
                    ahead_m: (self.reference.s_at(instant) - s_m).clamp(-most, most),
                    speed_mps: point.speed_mps,
                    accel_mps2: point.accel_mps2,
                }
            }
            None => {
                let point = self.at(s_m);
                Wanted { ahead_m: 0.0, speed_mps: point.speed_mps, accel_mps2: point.accel_mps2 }
            }
        }
    }

    /// Room for the ego origin to the left and right of a path point `ahead_m` ahead of the ego: the corridor, limited
    /// by the road.
    fn room(&self, route: &Route, on_path: &PlanPoint, ahead_m: f64) -> (f64, f64) {
        let mpc::Params { corridor_m, edge_m, .. } = self.params.mpc;
        let point = on_path.pose.point();
        let FrenetPoint { s_m, d_m } = route.project_near(point, self.route_m + ahead_m, ROOM_REACH_M);
        let aside_m = 0.5 * self.shape.width_m + edge_m;
        let left_m = (route.left_m(s_m) - d_m - aside_m).min(corridor_m);
        let right_m = (route.right_m(s_m) + d_m - aside_m).min(corridor_m);
        (left_m, right_m)
    }

    /// Angle of the road wheels for a curvature, within the limit, radians.
    fn steering_of(&self, curvature_1pm: f64) -> f64 {
        let max = self.limits.steering_max_rad;
        math::atan(self.shape.wheelbase_m * curvature_1pm).clamp(-max, max)
    }

    fn at(&self, s_m: f64) -> PlanPoint {
        self.reference.at(s_m).expect("every way to load the reference leaves a point in it")
    }
}

impl Controller for LawController {
    /// The time since the previous call is the step of the integrals.
    fn step(&mut self, input: &Input<'_>) -> Output {
        let dt_s = self.before.map_or(0.0, |before| (input.now - before).as_secs().max(0.0));
        self.before = Some(input.now);
        let is_seen = self.is_usable(input.ego, input.now);
        self.reckoning.advance(input.now, self.steering_rad, self.accel_mps2);
        if is_finite(input.ego) {
            self.reckoning.take(input.ego);
        }
        if is_seen {
            self.see(input.ego, input.now);
        }
        let Some(seen) = self.seen else { return self.held() };
        if !is_seen {
            self.brake_blind(input);
        }
        let is_known = is_seen && !self.reckoning.is_late();
        let ego = if is_known { seen } else { self.reckoning.state().unwrap_or(seen) };
        let input = &Input { ego: &ego, ..*input };
        self.route_m = self.place.locate(input.route.line(), ego.pose).s_m;
        self.rise.advance(&self.params.comfort_accel, &ego, self.accel_mps2, dt_s);
        self.grip.advance(is_known.then_some(&ego), &self.params.slip, self.shape.wheelbase_m, dt_s);
        let status = self.load(input, is_seen);
        let here = self.here(input, status);
        let mut report = None;
        let (steering_rad, drive) = match (&self.mpc, self.params.law) {
            _ if !is_seen => self.step_blind(&ego, &here),
            (_, Law::Pid) => self.step_pid(input, &here, dt_s),
            (Some(_), Law::Mpc) => self.step_mpc(input, &here, status, &mut report),
            _ => self.step_tracker(input, &here, status, dt_s),
        };
        let max = self.limits.steering_max_rad;
        let change = self.steering_change_rad(input, status, &here, dt_s);
        self.steering_rad =
            steering_rad.clamp(self.steering_rad - change, self.steering_rad + change).clamp(-max, max);
        let drive = self.braked(drive, input.now);
        let Pedals { throttle, brake } = drive.pedals;
        let command = Command { steering_rad: self.steering_rad, throttle, brake };
        let Drive { speed_mps, accel_mps2, .. } = drive;
        self.accel_mps2 = accel_mps2.unwrap_or(ego.accel_mps2);
        Output { command, speed_mps, accel_mps2, status, mpc: report }
    }
}

/// Search radius along the route for a point of the path, metres.
const ROOM_REACH_M: f64 = 20.0;

/// Longitudinal output of a law.
struct Drive {
    pedals: Pedals,
    speed_mps: f64,
    accel_mps2: Option<f64>,
}

/// Target place and speed at one instant of the horizon.
struct Wanted {
    /// Distance ahead of the expected place, metres.
    ahead_m: f64,
    speed_mps: f64,
    accel_mps2: f64,
}

/// Place and target of one step.
struct Here {
    /// Arc length of the path beside the ego, metres.
    s_m: f64,
    /// Arc length of the path where the ego should be, metres: beside it, or at the plan's current place.
    from_m: f64,
    target: Target,
}

fn is_finite(ego: &EgoState) -> bool {
    ego.pose.is_finite()
        && [ego.speed_mps, ego.accel_mps2, ego.yaw_rate_radps, ego.steering_rad].iter().all(|x| x.is_finite())
}

fn plan_is_finite(plan: &Plan) -> bool {
    plan.points.iter().all(|p| {
        p.pose.is_finite() && [p.curvature_1pm, p.speed_mps, p.accel_mps2].iter().all(|x| x.is_finite())
    })
}

#[cfg(test)]
mod grip_tests;
#[cfg(test)]
mod slip_tests;
#[cfg(test)]
mod stop_tests;
#[cfg(test)]
mod tests;
