//! What the model of execution adds: the deadline policy, rungs that fit a deadline, detector and planner on timers.

use anyhow::anyhow;
use swerve_core::{Span, Time};
use swerve_flow::{
    Anchor, At, Context, Deadline, Every, Feedback, Graph, Latest, Operator, Port, RuntimeModel, Stream,
    Timer,
};
use swerve_msg::truth::Surroundings;
use swerve_msg::{Detections, EgoState, PredictionList, ResponseBudget, Route, RungTaken};
use swerve_perception::detector::Detector;
use swerve_perception::tracker;
use swerve_planning::deadline::{Overhead, Params, Situation, nearest_hazard, obstacles_near, respond};
use swerve_vehicle::VehicleParams;

use crate::config::Config;
use crate::config::model::{Model, Rung};

/// What a unit of work of an operator on a ladder lasts.
const UNIT_NS: i64 = 1000;

/// An operator on a ladder takes what its rung takes.
pub(super) fn on_ladder() -> RuntimeModel {
    RuntimeModel::Work { base: Span::ZERO, per_unit_ns: UNIT_NS as f64 }
}

/// The finest rung that is done by the deadline, the fastest where none is; its time is spent.
pub(super) fn take<'a, T>(rungs: &'a mut [Rung<T>], cx: &mut Context<'_>) -> (&'a mut T, RungTaken) {
    let left = cx.deadline().map(|deadline| deadline - cx.now());
    let fits = rungs.iter().rposition(|rung| left.is_none_or(|left| rung.run_time <= left)).unwrap_or(0);
    let Rung { name, run_time, what } = &mut rungs[fits];
    // In two parts: one that does not fit is not cut, it is late.
    let units = run_time.ns().unsigned_abs().div_ceil(UNIT_NS.unsigned_abs());
    cx.spend(units.saturating_sub(1));
    cx.spend(1);
    let taken = RungTaken { stamp: cx.stamp(), rung: name.clone(), run_time: *run_time, left };
    (what, taken)
}

/// Sets deadlines from frame to frame.
struct Policy {
    params: Params,
    overhead: Overhead,
    route: Route,
    vehicle: VehicleParams,
}

impl Policy {
    fn new(config: &Config, route: &Route) -> anyhow::Result<Self> {
        let wrong = |message| anyhow!("execution.params: {message}");
        let period_s = config.sensing.period_ms * 1e-3;
        let params = config.deadline_params().map_err(wrong)?;
        // What takes longer than a period makes the next frame wait.
        let params = Params {
            detector_max_s: params.detector_max_s.min(period_s).max(params.detector_min_s),
            planner_max_s: params.planner_max_s.min(period_s).max(params.planner_min_s),
            ..params
        };
        let seen_s = period_s + config.control.period_ms * 1e-3 + config.sim.vehicle.dead_time_s;
        let confirmed = frames_to_confirm(config)?.saturating_sub(1);
        let overhead = Overhead { seen_s, hidden_s: seen_s + confirmed as f64 * period_s };
        Ok(Self { params, overhead, route: route.clone(), vehicle: config.sim.vehicle.clone() })
    }
}

/// Frames until something that comes into sight is reported.
fn frames_to_confirm(config: &Config) -> anyhow::Result<usize> {
    let wrong = |(key, message): (&str, String)| anyhow!("perception.{key}: {message}");
    let Some(emulated) = config.perception.emulated().map_err(wrong)? else { return Ok(1) };
    let tracker: tracker::Params =
        config.perception.tracker(&emulated.params, config.prediction.past_steps).map_err(wrong)?;
    Ok(tracker.hits_min)
}

impl Operator for Policy {
    type In = (At<PredictionList>, Latest<EgoState>);
    type Out = (Port<ResponseBudget>, Port<Span>, Port<Span>);

    fn step(&mut self, cx: &mut Context<'_>, (predictions, ego): &Self::In, out: &mut Self::Out) {
        let Some(predictions) = predictions.get() else { return };
        let Some(ego) = ego.get().filter(|ego| ego.is_plausible()) else { return };
        let situation = Situation {
            now: cx.now(),
            ego,
            route: &self.route,
            shape: &self.vehicle.shape,
            limits: &self.vehicle.limits,
            predictions: &predictions.predictions,
        };
        let hazard = nearest_hazard(&self.params, &situation, self.overhead);
        let obstacles = obstacles_near(&self.params, &situation);
        let answer = respond(&self.params, hazard, self.overhead, obstacles);
        let (response, detector) = (Span::from_secs(answer.total_s), Span::from_secs(answer.detector_s));
        // What the detector left of it, or took beyond its part.
        let left = response - (cx.now() - predictions.stamp);
        let most = Span::from_secs(self.params.planner_max_s);
        let planner = left.min(most).max(Span::from_secs(self.params.planner_min_s));
        let budget = ResponseBudget {
            stamp: predictions.stamp,
            left_s: hazard.map(|hazard| hazard.left_s),
            hazard: hazard.map(|hazard| hazard.id),
            hidden: hazard.is_some_and(|hazard| hazard.hidden),
            obstacles: u32::try_from(obstacles).unwrap_or(u32::MAX),
            response,
            detector,
            planner,
        };
        out.0.send(budget);
        out.1.send(detector);
        out.2.send(planner);
    }
}

/// Adds the deadline policy where the model has one, and gives detector and planner their deadlines. The policy reads
/// what lies behind the detector, so that its word is for frames to come; the planner hears it at once.
///
/// Static deadlines count from a frame's arrival. Dynamic ones count from the start of its step: they become short
/// while a long step still runs, and the frame that waits for it is the one that matters; it is late then, but an answer
/// that is late is better than none.
pub(super) fn set_deadlines(
    graph: &mut Graph,
    config: &Config,
    (predictions, pose, route): (Stream<PredictionList>, Stream<EgoState>, &Route),
) -> anyhow::Result<Option<Deadline>> {
    let execution = &config.execution;
    let react = |deadline: Deadline| deadline.reaction(execution.reaction);
    let set = |graph: &mut Graph, deadline: Deadline| {
        if let Ok(detector) = graph.operator("detector") {
            let _configured = detector.deadline(react(deadline));
        }
    };
    match execution.model {
        Model::Periodic | Model::DataDriven => Ok(None),
        Model::StaticDeadlines => {
            let length = |name: &str| config.length_of(name).map_err(|m| anyhow!("execution.{name}_ms: {m}"));
            if let Some(detector) = length("detector")? {
                set(graph, Deadline::after(detector));
            }
            Ok(length("planner")?.map(|planner| react(Deadline::after(planner))))
        }
        Model::DynamicDeadlines => {
            let policy = Policy::new(config, route)?;
            let before = respond(&policy.params, None, policy.overhead, 0);
            let node = graph.add("deadlines", policy, (predictions, pose));
            let (_, detector, planner) = node.outputs(&["budget", "detector", "planner"]).out();
            let behind: Feedback<Span> = graph.feedback("detector deadline");
            graph.connect(behind, detector);
            let (before_detector, before_planner) =
                (Span::from_secs(before.detector_s), Span::from_secs(before.planner_s));
            set(graph, Deadline::from_policy(behind, before_detector).anchor(Anchor::Start));
            Ok(Some(react(Deadline::from_policy(planner, before_planner).anchor(Anchor::Start))))
        }
    }
}

/// The timer of an operator under the periodic model.
pub(super) fn own_timer(config: &Config, operator: &str) -> anyhow::Result<Option<Timer>> {
    let period = config.period_of(operator).map_err(|m| anyhow!("execution.{operator}_ms: {m}"))?;
    Ok(period.map(|period| super::timer(config, operator, period.as_ms())))
}

/// An emulated detector that takes the rung that fits.
pub(super) struct LadderDetector(pub(super) Vec<Rung<Detector>>);

impl Operator for LadderDetector {
    type In = (At<Surroundings>,);
    type Out = (Port<Detections>, Port<RungTaken>);

    fn step(&mut self, cx: &mut Context<'_>, (seen,): &Self::In, out: &mut Self::Out) {
        let Some(seen) = seen.get() else { return };
        let (detector, taken) = take(&mut self.0, cx);
        out.0.loan().send(detector.detect(seen));
        out.1.send(taken);
    }
}

/// An emulated detector that runs on a timer, on the newest frame there is; on none twice.
pub(super) struct PeriodicDetector {
    pub(super) detector: Detector,
    /// What it takes, where a ladder says that.
    pub(super) rung: Option<Rung<()>>,
    pub(super) last: Option<Time>,
}

impl Operator for PeriodicDetector {
    type In = (Every, Latest<Surroundings>);
    type Out = (Port<Detections>, Port<RungTaken>);

    fn step(&mut self, cx: &mut Context<'_>, (_, seen): &Self::In, out: &mut Self::Out) {
        let Some(seen) = seen.get().filter(|seen| self.last != Some(seen.stamp)) else { return };
        self.last = Some(seen.stamp);
        if let Some(rung) = &mut self.rung {
            let (_, taken) = take(core::slice::from_mut(rung), cx);
            out.1.send(taken);
        }
        out.0.loan().send(self.detector.detect(seen));
    }
}
