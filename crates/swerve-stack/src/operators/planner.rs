//! Motion planners.

use std::borrow::Cow;
use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_flow::{
    At, Context, Inputs, Latest, Message, NamedInputs, NamedOutputs, Operator, OutputInfo, Outputs, Port,
    PortInfo, RuntimeModel, Window,
};
use swerve_msg::{
    ActorId, Decision, EgoState, LocalPose, Plan, PlanStatus, PoseQuality, Prediction, PredictionList, Route,
};
use swerve_planning::brake::brake;
use swerve_planning::collision::plan_within_risk;
use swerve_planning::{Budget, CollisionMode, Planner, Progress, Request, predicted_start, stop_wall};
use swerve_text::{KeyProblem, in_one_line};
use swerve_vehicle::{Limits, Shape};

use super::behaviour::OnRoute;
use super::changes::Changes;
use super::odom::{LocalPoses, carried};
use super::pose_trust::{Here, PoseTrust, Stop};
use crate::config::execution::Runtime;
use crate::config::model::Model;
use crate::config::{PlanningConfig, StartState};
use crate::kind::{Heavy, Node, OperatorKind, Scheduled, Settings};
use crate::ladder::Ladder;
use crate::site::Site;

/// A motion planner.
pub(super) struct Planners;

/// A decision, and past predictions and poses including those of the same stamp.
#[derive(Inputs)]
struct In {
    /// Ground, speeds and stops to plan within.
    decision: At<Decision>,
    /// Predictions of the other road users, among them those that the decision is based on.
    predictions: Window<PredictionList, PREDICTIONS>,
    /// Newest routes, among them that of the decision.
    routes: Window<Route, ROUTES>,
    /// Past poses of the ego.
    poses: Window<EgoState, POSES>,
    /// Accuracy of the pose.
    quality: Option<Latest<PoseQuality>>,
    /// Local poses: successive plans are continuous in the odometry frame.
    local: Option<Window<LocalPose, POSES>>,
}

/// A plan.
#[derive(Outputs)]
struct Out {
    /// The plan.
    plan: Port<Plan>,
}

impl OperatorKind for Planners {
    fn node(&self) -> Node {
        Node::new("planner", "motion planner, chosen by `planning.planner`")
            .section(&PlanningConfig::SECTION)
            .heavy(Heavy::Yes)
            .scheduled(Scheduled::Planner)
            .on_ladder()
    }

    fn outputs(&self, _: &Settings<'_>) -> Vec<OutputInfo> {
        Out::ports()
    }

    fn inputs(&self, _: &Settings<'_>) -> Vec<PortInfo> {
        In::ports()
    }

    fn ladder(&self, settings: &Settings<'_>) -> Option<Ladder> {
        let setup = settings.setup;
        let rungs = setup.planning.rungs().unwrap_or_default();
        let reports = setup.planning.ladder.is_some() || setup.execution.model == Model::Periodic;
        reports.then_some(Ladder { sets_run_time: !rungs.is_empty(), rungs })
    }

    fn runtime(&self, settings: &Settings<'_>) -> Result<RuntimeModel, String> {
        let config = settings.setup;
        // On a vehicle the planner takes its actual time.
        if config.live.is_some() && settings.on_wall_clock() {
            return Ok(RuntimeModel::Zero);
        }
        if config.planning.ladder.is_some() {
            return Ok(RuntimeModel::LADDER);
        }
        config.planning.cost_of_chosen().map_or(Ok(RuntimeModel::Zero), Runtime::model)
    }

    fn added_delay_ms(&self, settings: &Settings<'_>) -> f64 {
        settings.setup.planning.added_latency_ms
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let operator = PlannerOperator::new(site)?;
        site.add_carrying(operator, None, |from, to| core::mem::swap(&mut from.memory, &mut to.memory))
    }
}

/// Past predictions kept to find those of a decision: up to the age of a decision, at 20 Hz.
const PREDICTIONS: usize = 32;
/// Routes kept to find that of a decision: a route is in force for much longer than a decision takes.
const ROUTES: usize = 2;
/// Identities of places to stop at count down from this: tracks count up.
const LAST_STOP_ID: u32 = u32::MAX;

/// Past poses kept to find the one at a frame's stamp: up to the age of a frame, at 100 Hz.
const POSES: usize = 64;

/// Deceleration to a lower speed limit ahead, m/s².
const EASE_MPS2: f64 = 1.0;
/// Time by which the ego begins to slow down earlier, seconds: that until a plan takes effect.
const AHEAD_S: f64 = 1.0;

/// Requests a plan from a motion planner for each frame.
struct PlannerOperator {
    planner: Box<dyn Planner>,
    has_comfort: bool,
    shape: Shape,
    limits: Limits,
    /// With weighted modes: largest total probability of modes that are not kept clear of.
    risk_max: Option<f64>,
    /// Time by which a predicted start is moved on.
    ahead: Option<Ahead>,
    /// True if it plans on a timer, from the newest pose instead of the one at the stamp of the predictions.
    is_timed: bool,
    memory: Memory,
}

/// Time from the measured state to the first effect of a plan.
#[derive(Clone, Copy)]
enum Ahead {
    /// Expected time from a sensor frame to its plan.
    OfFrame(Span),
    /// Run time of the step, which starts when the age of the state is known.
    OfStep(Span),
}

/// State from plan to plan.
struct Memory {
    trust: PoseTrust,
    predictions: Option<Arc<PredictionList>>,
    decision: Option<Arc<Decision>>,
    previous: Option<Arc<Plan>>,
    local: LocalPoses,
    /// Local pose at the previous plan's stamp.
    previous_local: Option<LocalPose>,
    /// Position of the ego along the route.
    place: OnRoute,
    /// Route with the ground of a decision.
    corridor: Option<(Arc<Decision>, Arc<Route>)>,
    changes: Changes,
}

impl PlannerOperator {
    fn new(site: &Site<'_>) -> anyhow::Result<Self> {
        let config = site.setup();
        let (vehicle, planning) = (&config.sim.vehicle, &config.planning);
        let is_timed = site.schedule().period.is_some();
        let of_ms = |ms: f64| Span::from_secs(ms * 1e-3);
        let of_step = site.run_time().or_else(|| is_timed.then(|| of_ms(planning.expected_ms())));
        let of_frame = || Ahead::OfFrame(of_ms(config.expected_ms()));
        let ahead = || of_step.map_or_else(of_frame, Ahead::OfStep);
        let memory = Memory {
            trust: PoseTrust::new(planning.slow_by_sigma_m(), planning.lane_sigmas(), vehicle.shape),
            predictions: None,
            decision: None,
            previous: None,
            local: LocalPoses::default(),
            previous_local: None,
            place: OnRoute::default(),
            corridor: None,
            changes: Changes::default(),
        };
        // The planner's own share of the time to its plan does not include the detector's.
        let expecting = PlanningConfig { expected_ms: Some(config.expected_ms()), ..planning.clone() };
        Ok(Self {
            planner: expecting.planner(&config.registry).map_err(|found| wrong(&found))?,
            has_comfort: planning.has_comfort(&config.registry),
            shape: vehicle.shape,
            limits: vehicle.limits,
            risk_max: (planning.collision() == CollisionMode::Risk).then_some(planning.risk_max),
            ahead: (planning.start_state() == StartState::Predicted).then(ahead),
            is_timed,
            memory,
        })
    }

    /// Route of a decision with the ground for its plans, and with that for emergencies; `None` if the route is not known.
    /// In an emergency, the ego may cross lines that must not be crossed.
    fn ground(&mut self, decision: &Arc<Decision>, routes: &[Message<Route>]) -> Option<[Arc<Route>; 2]> {
        let route = routes.iter().rev().find(|route| route.header().seq == decision.route)?;
        let Some(corridor) = decision.corridor.as_ref().or(route.between_lines()) else {
            return Some([route.shared(), route.shared()]);
        };
        let is_known = |(known, _): &(Arc<Decision>, Arc<Route>)| {
            known.route == decision.route && known.corridor == decision.corridor
        };
        if !self.memory.corridor.as_ref().is_some_and(is_known) {
            let ground = Arc::new(route.within(corridor.clone()));
            self.memory.corridor = Some((decision.clone(), ground));
        }
        let ground = self.memory.corridor.as_ref()?.1.clone();
        let emergency = if decision.corridor.is_some() { ground.clone() } else { route.shared() };
        Some([ground, emergency])
    }

    /// Plans from predictions, a decision on its route, and a measured state.
    fn plan(
        &mut self,
        cx: &mut Context<'_>,
        predictions: &PredictionList,
        (decision, [route, emergency]): (&Decision, [&Route; 2]),
        measured: &EgoState,
    ) -> Arc<Plan> {
        let ahead = self.ahead.map(|ahead| match ahead {
            Ahead::OfFrame(expected) => expected,
            Ahead::OfStep(run_time) => cx.now() - measured.stamp + run_time,
        });
        let memory = &mut self.memory;
        let stamp = predictions.stamp;
        let mut changed_lately = memory.changes.take(stamp, &predictions.predictions);
        // Those that wait will drive on.
        changed_lately.extend(&decision.waiting);
        let local = memory.local.at(stamp);
        let measured = &memory.local.state(measured, local);
        let moved = memory.previous.as_deref().and_then(|plan| carried(plan, memory.previous_local, local));
        let previous = moved.as_ref().or(memory.previous.as_deref());
        let start = match ahead {
            None => *measured,
            Some(ahead) => predicted_start(measured, previous, ahead),
        };
        if memory.place.is_new(decision.route) {
            memory.trust.begin_route();
        }
        let here = memory.place.of(decision.route).locate(route.line(), measured.pose);
        let reach_m = measured.pose.point().distance(start.pose.point()) + 1.0;
        let place = route.project_near(start.pose.point(), here.s_m, reach_m);
        let predictions = obstacles(&predictions.predictions, decision, route);
        let on_route = Here { ego: measured, place: here, route };
        let stop = memory.trust.stop(on_route);
        let free_mps = decision.speed_mps(place.s_m + AHEAD_S * start.speed_mps, EASE_MPS2);
        let target_speed_mps = memory.trust.target_speed_mps(free_mps, on_route, &predictions);
        let walled: Option<Vec<Prediction>> =
            stop.as_ref().map(|stop| predictions.iter().chain([&stop.wall]).cloned().collect());
        let overtake_max_m = memory.trust.overtake_max_m(on_route).min(decision.overtake_max_m(place.s_m));
        let ground = memory.trust.ground(on_route);
        let request = Request {
            stamp,
            start,
            route: ground,
            along_m: Some(place.s_m),
            target_speed_mps,
            overtake_max_m,
            changed_lately: &changed_lately,
            predictions: walled.as_deref().unwrap_or(&predictions),
            shape: &self.shape,
            limits: &self.limits,
            previous,
            seed: cx.rng().bits(),
        };
        let (planner, budget) = (&mut *self.planner, &mut Metered(cx));
        let mut plan_once = |request: &Request<'_>| {
            let plan = match self.risk_max {
                Some(risk_max) => plan_within_risk(planner, request, risk_max, budget),
                None => planner.plan(request, budget),
            };
            // A plan that no car can follow is no answer.
            if plan.is_plausible() { plan } else { Plan { status: PlanStatus::Refused, ..brake(request) } }
        };
        let is_comfortable = |plan: &Plan| plan.status == PlanStatus::Comfortable;
        let mut plan_for = |request: &Request<'_>| {
            let plan = plan_once(request);
            let is_poor = plan.status.is_fallback() || (self.has_comfort && !is_comfortable(&plan));
            if is_poor && !core::ptr::eq(ground, route) {
                // Plans on the whole ground if the deviations leave no comfortable plan, or none at all.
                let whole = plan_once(&Request { route, ..*request });
                if is_comfortable(&whole) || plan.status.is_fallback() {
                    return whole;
                }
            }
            if !plan.status.is_fallback() || core::ptr::eq(route, emergency) {
                return plan;
            }
            let over_lines = plan_once(&Request { route: emergency, ..*request });
            if over_lines.status.is_fallback() { plan } else { over_lines }
        };
        let mut plan = plan_for(&request);
        if stop.is_some_and(|stop| !stop.is_fit(&plan, on_route, &self.shape)) {
            // A stop that begins now would end in the other lane or brake too hard: the ego first drives on.
            let free = plan_for(&Request { predictions: &predictions, ..request });
            if Stop::is_worse_than(&plan, &free) {
                plan = free;
                memory.trust.postpone();
            }
        }
        let plan = Arc::new(memory.trust.explained(plan));
        (memory.previous, memory.previous_local) = (Some(plan.clone()), local);
        plan
    }
}

/// Newest state up to an instant, or the oldest one.
pub(super) fn measured_at(instant: Time, poses: &Window<EgoState, POSES>) -> Option<&EgoState> {
    let mut poses = poses.get().iter().filter(|p| p.is_plausible());
    let first = poses.next()?;
    let before = poses.rev().find(|p| p.header().stamp <= instant);
    Some(before.unwrap_or(first))
}

/// Plausible predictions up to where others give way to the ego, and the places of a decision to stop at.
fn obstacles<'a>(all: &'a [Prediction], decision: &Decision, route: &Route) -> Cow<'a, [Prediction]> {
    let is_as_is = decision.stops.is_empty() && decision.expected_to_yield.is_empty();
    if is_as_is && all.iter().all(Prediction::is_plausible) {
        return Cow::Borrowed(all);
    }
    let plausible = all.iter().filter(|one| one.is_plausible()).map(|one| {
        let found = decision.expected_to_yield.binary_search_by_key(&one.id, |stop| stop.id);
        found.map_or_else(|_| one.clone(), |index| stopped(one, decision.expected_to_yield[index].after_m))
    });
    Cow::Owned(plausible.chain(stops(decision, route)).collect())
}

/// A prediction of which the way ends: from there on, its last pose holds.
fn stopped(one: &Prediction, after_m: f64) -> Prediction {
    let mut stopped = one.clone();
    let mut way_m = 0.0;
    for k in 1..one.path.len() {
        way_m += one.path[k - 1].pose.point().distance(one.path[k].pose.point());
        if way_m > after_m {
            let last = stopped.path[k - 1].pose;
            stopped.path[k..].iter_mut().for_each(|point| point.pose = last);
            break;
        }
    }
    stopped
}

/// Places of a decision to stop at, as obstacles.
fn stops<'a>(decision: &'a Decision, route: &'a Route) -> impl Iterator<Item = Prediction> + 'a {
    let wall = move |(k, stop): (u32, &swerve_msg::StopPoint)| {
        stop_wall(ActorId(LAST_STOP_ID - k), stop.s_m, route, decision.stamp)
    };
    (0..).zip(&decision.stops).map(wall)
}

impl Operator for PlannerOperator {
    type In = In;
    type Out = Out;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Out) {
        // On a timer it plans again from predictions that it has planned from, as the ego has moved on.
        if let Some(decision) = input.decision.get() {
            let mut lists = input.predictions.get().iter().rev();
            let Some(predictions) = lists.find(|list| list.stamp == decision.stamp) else { return };
            self.memory.predictions = Some(predictions.shared());
            self.memory.decision = Some(decision.shared());
        }
        let instant = if self.is_timed { cx.now() } else { cx.stamp() };
        let measured = measured_at(instant, &input.poses);
        let (Some(predictions), Some(measured)) = (self.memory.predictions.clone(), measured) else { return };
        let Some(decision) = self.memory.decision.clone() else { return };
        let Some([route, emergency]) = self.ground(&decision, input.routes.get()) else { return };
        self.memory.trust.take(input.quality.as_ref());
        self.memory.local.take(input.local.as_ref().map_or(&[], |local| local.get()));
        out.plan.forward(self.plan(cx, &predictions, (&decision, [&route, &emergency]), measured));
    }
}

/// The engine's meter as a planner's budget.
struct Metered<'a, 'b>(&'a mut Context<'b>);

impl Budget for Metered<'_, '_> {
    fn spend(&mut self, units: u64) -> Progress {
        match self.0.spend(units) {
            swerve_flow::Progress::Continue => Progress::Continue,
            swerve_flow::Progress::Stop => Progress::Stop,
        }
    }
}

/// Error message for a planner's parameters.
fn wrong(problems: &[KeyProblem]) -> anyhow::Error {
    anyhow::anyhow!("planning.params: {}", in_one_line(problems))
}

#[cfg(test)]
mod tests {
    use swerve_geom::Pose2;
    use swerve_msg::{ActorKind, Extent, PredictedPose};

    use super::*;

    #[test]
    fn prediction_of_a_vehicle_that_gives_way_ends_before_its_stop() {
        let at = |k: i64| PredictedPose {
            at: Time::ZERO + Span::from_ms(500 * k),
            pose: Pose2::new(4.0 * k as f64, 1.0, 0.0),
        };
        let extent = Extent { length_m: 4.5, width_m: 1.8, height_m: 1.5 };
        let one = Prediction::single(ActorId(7), ActorKind::Car, extent, (0..6).map(at).collect());
        let places = |after_m: f64| -> Vec<f64> {
            stopped(&one, after_m).path.iter().map(|point| point.pose.x_m).collect()
        };
        assert_eq!(places(9.0), [0.0, 4.0, 8.0, 8.0, 8.0, 8.0]);
        assert_eq!(places(0.5), [0.0; 6]);
        assert_eq!(places(100.0), [0.0, 4.0, 8.0, 12.0, 16.0, 20.0]);
        let line = swerve_geom::Polyline::new(&[at(0).pose.point(), at(5).pose.point()]).unwrap();
        let route = Route::uniform(line, 2.0, 2.0);
        let stop = swerve_msg::ExpectedStop { id: ActorId(7), after_m: 9.0 };
        let decision = Decision { expected_to_yield: vec![stop], ..Decision::default() };
        let other = Prediction { id: ActorId(8), ..one.clone() };
        let all = [one.clone(), other.clone()];
        assert_eq!(obstacles(&all, &decision, &route)[..], [stopped(&one, 9.0), other]);
        assert_eq!(obstacles(&all, &Decision::default(), &route)[..], all);
    }
}
