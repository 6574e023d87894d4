//! Motion planners.

use std::borrow::Cow;
use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_flow::{
    At, Context, Every, Inputs, Latest, NamedInputs, NamedOutputs, Operator, OutputInfo, Outputs, Port,
    PortInfo, RuntimeModel, Window,
};
use swerve_geom::LineTracker;
use swerve_msg::{
    EgoState, LocalPose, Plan, PlanStatus, PoseQuality, Prediction, PredictionList, Route, RungTaken,
};
use swerve_planning::collision::plan_within_risk;
use swerve_planning::{Budget, CollisionMode, Planner, Progress, Request, Unlimited, predicted_start};
use swerve_text::{KeyProblem, in_one_line};
use swerve_vehicle::{Limits, Shape};

use super::changes::Changes;
use super::deadlines::planner_deadline;
use super::ladder::{on_ladder, take};
use super::odom::{LocalPoses, carried};
use super::pose_trust::{Here, PoseTrust, Stop};
use crate::config::execution::Runtime;
use crate::config::model::{Model, Rung};
use crate::config::{Config, PlanningConfig, StartState};
use crate::kind::{Heavy, Node, OperatorKind, Scheduled, Settings};
use crate::setup::Setup;
use crate::site::{Site, Surroundings};

/// A motion planner, under any execution model.
pub(super) struct Planners;

/// Predictions, and past poses including the one of the same stamp.
#[derive(Inputs)]
struct In {
    /// Predictions of the other road users.
    predictions: At<PredictionList>,
    /// Past poses of the ego.
    poses: Window<EgoState, POSES>,
    /// Accuracy of the pose.
    quality: Option<Latest<PoseQuality>>,
    /// Local poses: successive plans are continuous in the odometry frame.
    local: Option<Window<LocalPose, POSES>>,
}

/// Newest inputs, at each tick.
#[derive(Inputs)]
struct PeriodicIn {
    /// Period of the planner.
    tick: Every,
    /// Predictions of the other road users.
    predictions: Latest<PredictionList>,
    /// State of the ego.
    ego: Latest<EgoState>,
    /// Accuracy of the pose.
    quality: Option<Latest<PoseQuality>>,
    /// Local poses: successive plans are continuous in the odometry frame.
    local: Option<Window<LocalPose, POSES>>,
}

/// A plan, and the rung that made it.
#[derive(Outputs)]
struct LadderOut {
    /// The plan.
    plan: Port<Plan>,
    /// Rung of the ladder that was used.
    rung: Port<RungTaken>,
}

impl OperatorKind for Planners {
    fn node(&self) -> Node {
        Node::new("planner", "motion planner, chosen by `planning.planner`")
            .section(&PlanningConfig::SECTION)
            .heavy(Heavy::Yes)
            .scheduled(Scheduled::Planner)
    }

    fn outputs(&self, settings: &Settings<'_>) -> Vec<OutputInfo> {
        let Config { execution, planning, .. } = &settings.setup.config;
        match execution.model != Model::Periodic && planning.ladder.is_none() {
            true => <Port<Plan> as NamedOutputs>::ports(),
            false => LadderOut::ports(),
        }
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        match settings.setup.execution.model {
            Model::Periodic => PeriodicIn::ports(),
            _ => In::ports(),
        }
    }

    fn runtime(&self, settings: &Settings<'_>) -> Result<RuntimeModel, String> {
        let config = settings.setup;
        // On a vehicle the planner takes its actual time.
        if config.live.is_some() && settings.on_wall_clock() {
            return Ok(RuntimeModel::Zero);
        }
        if config.planning.ladder.is_some() {
            return Ok(on_ladder());
        }
        config.planning.cost_of_chosen().map_or(Ok(RuntimeModel::Zero), Runtime::model)
    }

    fn added_delay_ms(&self, settings: &Settings<'_>) -> f64 {
        settings.setup.planning.added_latency_ms
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let settings = site.settings();
        let config = settings.setup;
        let operator = PlannerOperator::new(config, site.surroundings())?;
        let make = |Rung { name, run_time, what }: &Rung<toml::Table>| {
            let what = config.planning.planner_with(&config.registry, what);
            let what = what.map_err(|found| wrong(&found))?;
            Ok(Rung { name: name.clone(), run_time: *run_time, what })
        };
        let rungs = &site.resolved().planner_rungs;
        let mut rungs = rungs.iter().map(make).collect::<anyhow::Result<Vec<_>>>()?;
        if let Some(timer) = site.own_timer() {
            let usual = Span::from_secs(config.planning.expected_ms() * 1e-3);
            let periodic = PeriodicPlanner { operator, rung: rungs.pop(), usual };
            site.add(periodic, Some(timer))?;
        } else if rungs.is_empty() {
            site.add(operator, None)?;
        } else {
            site.add(LadderPlanner { operator, rungs }, None)?;
        }
        if let Some(deadline) = planner_deadline(site)? {
            let _configured = site.node()?.deadline(deadline);
        }
        Ok(())
    }
}

/// Past poses kept to find the one at a frame's stamp: up to the age of a frame, at 100 Hz.
const POSES: usize = 64;

/// Requests a plan from a motion planner for each frame.
struct PlannerOperator {
    planner: Box<dyn Planner>,
    route: Route,
    target_speed_mps: f64,
    trust: PoseTrust,
    has_comfort: bool,
    shape: Shape,
    limits: Limits,
    /// With weighted modes: largest total probability of modes that are not kept clear of.
    risk_max: Option<f64>,
    /// Time by which a predicted start is moved on.
    expected: Option<Span>,
    previous: Option<Arc<Plan>>,
    local: LocalPoses,
    /// Local pose at the previous plan's stamp.
    previous_local: Option<LocalPose>,
    /// Position of the ego along the route.
    place: LineTracker,
    changes: Changes,
}

impl PlannerOperator {
    fn new(config: &Setup, around: &Surroundings) -> anyhow::Result<Self> {
        let (vehicle, planning) = (&config.sim.vehicle, &config.planning);
        let expected = match planning.start_state() {
            StartState::Measured => None,
            StartState::Predicted => Some(Span::from_secs(config.expected_ms() * 1e-3)),
        };
        Ok(Self {
            planner: planning.planner(&config.registry).map_err(|found| wrong(&found))?,
            route: around.route.clone(),
            target_speed_mps: around.scenario.ego.target_speed_mps,
            has_comfort: planning.has_comfort(&config.registry),
            trust: PoseTrust::new(planning.slow_by_sigma_m(), planning.lane_sigmas(), vehicle.shape),
            shape: vehicle.shape,
            limits: vehicle.limits,
            risk_max: (planning.collision() == CollisionMode::Risk).then_some(planning.risk_max),
            expected,
            previous: None,
            local: LocalPoses::default(),
            previous_local: None,
            place: LineTracker::default(),
            changes: Changes::default(),
        })
    }
}

impl PlannerOperator {
    /// Takes the accuracy of the pose, and the local poses.
    fn localized(&mut self, quality: Option<&Latest<PoseQuality>>, local: Option<&Window<LocalPose, POSES>>) {
        self.trust.take(quality);
        self.local.take(local.map_or(&[], |local| local.get()));
    }

    /// Plans from predictions and the pose of the same stamp; the ego will follow the plan from `ahead` on.
    fn plan(
        &mut self,
        cx: &mut Context<'_>,
        predictions: &PredictionList,
        measured: &EgoState,
        ahead: Option<Span>,
        chosen: Option<&mut dyn Planner>,
    ) -> Arc<Plan> {
        let stamp = predictions.stamp;
        let changed_lately = self.changes.take(stamp, &predictions.predictions);
        let local = self.local.at(stamp);
        let measured = &self.local.state(measured, local);
        let moved = self.previous.as_deref().and_then(|plan| carried(plan, self.previous_local, local));
        let previous = moved.as_ref().or(self.previous.as_deref());
        let start = match ahead {
            None => *measured,
            Some(ahead) => predicted_start(measured, previous, ahead),
        };
        let here = self.place.locate(self.route.line(), measured.pose);
        let reach_m = measured.pose.point().distance(start.pose.point()) + 1.0;
        let place = self.route.project_near(start.pose.point(), here.s_m, reach_m);
        let predictions = match predictions.predictions.iter().all(Prediction::is_plausible) {
            true => Cow::Borrowed(&predictions.predictions),
            false => {
                let plausible = predictions.predictions.iter().filter(|p| p.is_plausible());
                Cow::Owned(plausible.cloned().collect())
            }
        };
        let on_route = Here { ego: measured, place: here, route: &self.route };
        let stop = self.trust.stop(on_route);
        let target_speed_mps = self.trust.target_speed_mps(self.target_speed_mps, on_route, &predictions);
        let walled: Option<Vec<Prediction>> =
            stop.as_ref().map(|stop| predictions.iter().chain([&stop.wall]).cloned().collect());
        let overtake_max_m = self.trust.overtake_max_m(on_route);
        let ground = self.trust.ground(on_route);
        let request = Request {
            stamp,
            start,
            route: ground,
            along_m: Some(place.s_m),
            target_speed_mps,
            overtake_max_m,
            changed_lately: &changed_lately,
            predictions: walled.as_ref().unwrap_or(&predictions),
            shape: &self.shape,
            limits: &self.limits,
            previous,
            seed: cx.rng().bits(),
        };
        let (mut unlimited, mut metered) = (Unlimited::default(), Metered(cx));
        let (planner, budget): (&mut dyn Planner, &mut dyn Budget) = match chosen {
            // The rung's run time is already spent.
            Some(planner) => (planner, &mut unlimited),
            None => (&mut *self.planner, &mut metered),
        };
        let mut plan_once = |request: &Request<'_>| match self.risk_max {
            Some(risk_max) => plan_within_risk(planner, request, risk_max, budget),
            None => planner.plan(request, budget),
        };
        let is_comfortable = |plan: &Plan| plan.status == PlanStatus::Comfortable;
        let mut plan_for = |request: &Request<'_>| {
            let plan = plan_once(request);
            let is_poor = plan.status.is_fallback() || (self.has_comfort && !is_comfortable(&plan));
            if is_poor && !core::ptr::eq(ground, &self.route) {
                // Plans on the whole ground if the deviations leave no comfortable plan, or none at all.
                let whole = plan_once(&Request { route: &self.route, ..*request });
                if is_comfortable(&whole) || plan.status.is_fallback() {
                    return whole;
                }
            }
            plan
        };
        let mut plan = plan_for(&request);
        if stop.is_some_and(|stop| !stop.is_fit(&plan, on_route, &self.shape)) {
            // A stop that begins now would end in the other lane or brake too hard: the ego first drives on.
            let free = plan_for(&Request { predictions: &predictions, ..request });
            if Stop::is_worse_than(&plan, &free) {
                plan = free;
                self.trust.postpone();
            }
        }
        let plan = Arc::new(self.trust.explained(plan));
        (self.previous, self.previous_local) = (Some(plan.clone()), local);
        plan
    }
}

/// State measured at the frame's stamp: predictions do not match later ones.
fn measured_at(stamp: Time, poses: &Window<EgoState, POSES>) -> Option<&EgoState> {
    let mut poses = poses.get().iter().filter(|p| p.is_plausible());
    let first = poses.next()?;
    let at_stamp = poses.rev().find(|p| p.header().stamp <= stamp);
    Some(at_stamp.unwrap_or(first))
}

impl Operator for PlannerOperator {
    type In = In;
    type Out = Port<Plan>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        let measured = measured_at(cx.stamp(), &input.poses);
        let (Some(predictions), Some(measured)) = (input.predictions.get(), measured) else { return };
        let expected = self.expected;
        self.localized(input.quality.as_ref(), input.local.as_ref());
        out.forward(self.plan(cx, predictions, measured, expected, None));
    }
}

/// A planner in several discretisations, of which it uses the one that fits the time left.
struct LadderPlanner {
    operator: PlannerOperator,
    rungs: Vec<Rung<Box<dyn Planner>>>,
}

impl Operator for LadderPlanner {
    type In = In;
    type Out = LadderOut;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut LadderOut) {
        let measured = measured_at(cx.stamp(), &input.poses);
        let (Some(predictions), Some(measured)) = (input.predictions.get(), measured) else { return };
        let (planner, taken) = take(&mut self.rungs, cx);
        self.operator.localized(input.quality.as_ref(), input.local.as_ref());
        // The time since the frame is known, and so is the run time of the rung.
        let ahead = self.operator.expected.map(|_| cx.now() - measured.stamp + taken.run_time);
        out.plan.forward(self.operator.plan(cx, predictions, measured, ahead, Some(&mut **planner)));
        out.rung.send(taken);
    }
}

/// A planner that runs on a timer, on the newest predictions and the newest pose.
struct PeriodicPlanner {
    operator: PlannerOperator,
    /// Its rung, if a ladder defines its run time.
    rung: Option<Rung<Box<dyn Planner>>>,
    /// Run time otherwise.
    usual: Span,
}

impl Operator for PeriodicPlanner {
    type In = PeriodicIn;
    type Out = LadderOut;

    fn step(&mut self, cx: &mut Context<'_>, input: &PeriodicIn, out: &mut LadderOut) {
        let Some(predictions) = input.predictions.get() else { return };
        let Some(measured) = input.ego.get().filter(|ego| ego.is_plausible()) else { return };
        let taken = self.rung.as_mut().map(|rung| take(core::slice::from_mut(rung), cx));
        let (planner, taken) = taken.map_or((None, None), |(planner, taken)| (Some(planner), Some(taken)));
        self.operator.localized(input.quality.as_ref(), input.local.as_ref());
        let lasts = taken.as_ref().map_or(self.usual, |taken| taken.run_time);
        let ahead = self.operator.expected.map(|_| cx.now() - measured.stamp + lasts);
        let planner = planner.map(|planner| &mut **planner as &mut dyn Planner);
        out.plan.forward(self.operator.plan(cx, predictions, measured, ahead, planner));
        if let Some(taken) = taken {
            out.rung.send(taken);
        }
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
