use std::borrow::Cow;
use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_flow::{At, Context, Deadline, Every, Graph, Latest, Operator, Port, Stream, Window};
use swerve_msg::{EgoState, Plan, Prediction, PredictionList, Route, RungTaken};
use swerve_planning::{Budget, Planner, Progress, Request, Unlimited, predicted_start};
use swerve_scenario::Scenario;
use swerve_vehicle::{Limits, Shape};

use super::deadline::{own_timer, take};
use crate::config::model::Rung;
use crate::config::{Config, StartState};

/// Past poses kept to find the one measured at a frame's stamp: as old as frames get, at 100 Hz.
const POSES: usize = 64;

/// Asks a motion planner for a plan, frame by frame.
pub(super) struct PlannerOperator {
    planner: Box<dyn Planner>,
    route: Route,
    target_speed_mps: f64,
    shape: Shape,
    limits: Limits,
    /// Moved on by this where the start is predicted.
    expected: Option<Span>,
    previous: Option<Arc<Plan>>,
}

impl PlannerOperator {
    pub(super) fn new(config: &Config, scenario: &Scenario, route: &Route) -> anyhow::Result<Self> {
        let vehicle = &config.sim.vehicle;
        let expected = match config.planning.start_state() {
            StartState::Measured => None,
            StartState::Predicted => Some(Span::from_secs(config.expected_ms() * 1e-3)),
        };
        Ok(Self {
            planner: config
                .planning
                .planner()
                .map_err(|message| anyhow::anyhow!("planning.params: {message}"))?,
            route: route.clone(),
            target_speed_mps: scenario.ego.target_speed_mps,
            shape: vehicle.shape,
            limits: vehicle.limits,
            expected,
            previous: None,
        })
    }
}

impl PlannerOperator {
    /// A plan from predictions and the pose that goes with them, `ahead` of which the ego will take it up.
    fn plan(
        &mut self,
        cx: &mut Context<'_>,
        predictions: &PredictionList,
        (measured, ahead): (&EgoState, Option<Span>),
        chosen: Option<&mut dyn Planner>,
    ) -> Arc<Plan> {
        let start = match ahead {
            None => *measured,
            Some(ahead) => predicted_start(measured, self.previous.as_deref(), ahead),
        };
        let stamp = predictions.stamp;
        let predictions = match predictions.predictions.iter().all(Prediction::is_plausible) {
            true => Cow::Borrowed(&predictions.predictions),
            false => {
                let plausible = predictions.predictions.iter().filter(|p| p.is_plausible());
                Cow::Owned(plausible.cloned().collect())
            }
        };
        let request = Request {
            stamp,
            start,
            route: &self.route,
            target_speed_mps: self.target_speed_mps,
            predictions: &predictions,
            shape: &self.shape,
            limits: &self.limits,
            previous: self.previous.as_deref(),
            seed: cx.rng().bits(),
        };
        let plan = match chosen {
            // What it takes was spent when it was chosen.
            Some(planner) => planner.plan(&request, &mut Unlimited::default()),
            None => self.planner.plan(&request, &mut Metered(cx)),
        };
        let plan = Arc::new(plan);
        self.previous = Some(plan.clone());
        plan
    }
}

/// Measured at the frame's stamp: what came later is not what the predictions go with.
fn measured_at(stamp: Time, poses: &Window<EgoState, POSES>) -> Option<&EgoState> {
    let mut poses = poses.get().iter().filter(|p| p.is_plausible());
    let first = poses.next()?;
    let at_stamp = poses.rev().find(|p| p.header().stamp <= stamp);
    Some(at_stamp.unwrap_or(first))
}

impl Operator for PlannerOperator {
    type In = (At<PredictionList>, Window<EgoState, POSES>);
    type Out = Port<Plan>;

    fn step(&mut self, cx: &mut Context<'_>, (predictions, poses): &Self::In, out: &mut Self::Out) {
        let (Some(predictions), Some(measured)) = (predictions.get(), measured_at(cx.stamp(), poses)) else {
            return;
        };
        let expected = self.expected;
        out.forward(self.plan(cx, predictions, (measured, expected), None));
    }
}

/// A planner in several discretisations: the one that fits is taken.
struct LadderPlanner {
    operator: PlannerOperator,
    rungs: Vec<Rung<Box<dyn Planner>>>,
}

impl Operator for LadderPlanner {
    type In = (At<PredictionList>, Window<EgoState, POSES>);
    type Out = (Port<Plan>, Port<RungTaken>);

    fn step(&mut self, cx: &mut Context<'_>, (predictions, poses): &Self::In, out: &mut Self::Out) {
        let (Some(predictions), Some(measured)) = (predictions.get(), measured_at(cx.stamp(), poses)) else {
            return;
        };
        let (planner, taken) = take(&mut self.rungs, cx);
        // What passed since the frame is known, and so is what the rung takes.
        let ahead = self.operator.expected.map(|_| cx.now() - measured.stamp + taken.run_time);
        out.0.forward(self.operator.plan(cx, predictions, (measured, ahead), Some(&mut **planner)));
        out.1.send(taken);
    }
}

/// A planner that runs on a timer, on the newest predictions and the newest pose.
struct PeriodicPlanner {
    operator: PlannerOperator,
    /// What it takes, where a ladder says that.
    rung: Option<Rung<Box<dyn Planner>>>,
    /// What it takes else.
    usual: Span,
}

impl Operator for PeriodicPlanner {
    type In = (Every, Latest<PredictionList>, Latest<EgoState>);
    type Out = (Port<Plan>, Port<RungTaken>);

    fn step(&mut self, cx: &mut Context<'_>, (_, predictions, ego): &Self::In, out: &mut Self::Out) {
        let Some(predictions) = predictions.get() else { return };
        let Some(measured) = ego.get().filter(|ego| ego.is_plausible()) else { return };
        let taken = self.rung.as_mut().map(|rung| take(core::slice::from_mut(rung), cx));
        let (planner, taken) = taken.map_or((None, None), |(planner, taken)| (Some(planner), Some(taken)));
        let lasts = taken.as_ref().map_or(self.usual, |taken| taken.run_time);
        let ahead = self.operator.expected.map(|_| cx.now() - measured.stamp + lasts);
        let planner = planner.map(|planner| &mut **planner as &mut dyn Planner);
        out.0.forward(self.operator.plan(cx, predictions, (measured, ahead), planner));
        if let Some(taken) = taken {
            out.1.send(taken);
        }
    }
}

/// Adds the planner, as the model of execution has it.
pub(super) fn planner(
    graph: &mut Graph,
    config: &Config,
    operator: PlannerOperator,
    (predictions, pose, deadline): (Stream<PredictionList>, Stream<EgoState>, Option<Deadline>),
) -> anyhow::Result<Stream<Plan>> {
    const OUTPUTS: [&str; 2] = ["plan", "rung"];
    let wrong = |(key, message): (&str, String)| anyhow::anyhow!("planning.{key}: {message}");
    let make = |Rung { name, run_time, what }| {
        let what = config.planning.planner_with(&what).map_err(|message| wrong(("params", message)))?;
        Ok(Rung { name, run_time, what })
    };
    let rungs = config.planner_rungs().map_err(wrong)?;
    let mut rungs = rungs.into_iter().map(make).collect::<anyhow::Result<Vec<_>>>()?;
    let plan = if let Some(timer) = own_timer(config, "planner")? {
        let usual = Span::from_secs(config.planning.expected_ms() * 1e-3);
        let periodic = PeriodicPlanner { operator, rung: rungs.pop(), usual };
        graph.add("planner", periodic, (timer, predictions, pose)).outputs(&OUTPUTS).out().0
    } else if rungs.is_empty() {
        graph.add("planner", operator, (predictions, pose)).out()
    } else {
        let on_ladder = LadderPlanner { operator, rungs };
        graph.add("planner", on_ladder, (predictions, pose)).outputs(&OUTPUTS).out().0
    };
    if let Some(deadline) = deadline {
        let _configured = graph.operator("planner")?.deadline(deadline);
    }
    Ok(plan)
}

/// The engine's meter, as a planner knows it.
struct Metered<'a, 'b>(&'a mut Context<'b>);

impl Budget for Metered<'_, '_> {
    fn spend(&mut self, units: u64) -> Progress {
        match self.0.spend(units) {
            swerve_flow::Progress::Continue => Progress::Continue,
            swerve_flow::Progress::Stop => Progress::Stop,
        }
    }
}
