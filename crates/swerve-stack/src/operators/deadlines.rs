//! Deadline policy: time limits of detector and planner for each frame.

use anyhow::Context as _;
use swerve_core::Span;
use swerve_flow::{
    Anchor, At, Context, Deadline, Inputs, Latest, NamedInputs, NamedOutputs, Operator, OutputInfo, Outputs,
    Port, PortInfo,
};
use swerve_msg::{Detections, EgoState, PredictionList, ResponseBudget, Route};
use swerve_planning::deadline::{
    Overhead, Params, Response, Situation, nearest_hazard, obstacles_near, respond,
};
use swerve_vehicle::VehicleParams;

use crate::config::Config;
use crate::config::model::{ExecutionConfig, Model};
use crate::config::resolved::Resolved;
use crate::kind::{Node, OperatorKind, Scheduled, Settings};
use crate::site::{Site, first_stream};

/// Sets the deadlines of detector and planner under the dynamic model.
///
/// It reads outputs that follow the detector, so its deadlines for the detector apply to later frames; those for the
/// planner apply at once.
///
/// Static deadlines count from a frame's arrival. Dynamic ones count from the start of its step: they become short
/// while a long step still runs, and the frame that waits for it is the one that matters. It is late then, but a late
/// result is better than none.
pub(super) struct DeadlinePolicy;

/// Predictions and state of the ego.
#[derive(Inputs)]
struct In {
    /// Predictions of the other road users.
    predictions: At<PredictionList>,
    /// State of the ego.
    ego: Latest<EgoState>,
    /// Route of the ego.
    route: Latest<Route>,
}

/// Time budget of a frame.
#[derive(Outputs)]
struct Out {
    /// Time from frame to plan, and its reason.
    budget: Port<ResponseBudget>,
    /// Deadline of the detector.
    detector: Port<Span>,
    /// Deadline of the planner.
    planner: Port<Span>,
}

/// Deadline of an operator by `execution.model`: constant, or the newest one of the policy.
pub(crate) fn deadline(site: &mut Site<'_>) -> anyhow::Result<Option<Deadline>> {
    let execution = &site.config().execution;
    let reaction = execution.reaction.into();
    let Some(scheduled) = site.kind().scheduled.filter(|_| execution.model == Model::DynamicDeadlines) else {
        return Ok(site.schedule().deadline.map(|length| Deadline::after(length).reaction(reaction)));
    };
    let policy = first_stream::<ResponseBudget>(site.operators);
    let policy = policy.context("execution.model: no operator sets deadlines")?.0;
    let (setup, resolved) = (policy.settings(site.setup).setup, &*policy.resolved);
    let before = Policy::new(setup, resolved, site).before();
    let (port, before) = match scheduled {
        Scheduled::Detector => ("detector", before.detector_s),
        Scheduled::Planner => ("planner", before.planner_s),
    };
    let length = site.lengths(&format!("{}.{port}", policy.name))?;
    let deadline = Deadline::from_policy(length, Span::from_secs(before));
    Ok(Some(deadline.anchor(Anchor::Start).reaction(reaction)))
}

impl OperatorKind for DeadlinePolicy {
    fn node(&self) -> Node {
        Node::new("deadline_policy", "deadlines of detector and planner by what is ahead")
            .section(&ExecutionConfig::SECTION)
            .only_with("execution.model = \"dynamic_deadlines\"")
            .stays("it sets the deadlines of other operators")
    }

    fn is_there(&self, settings: &Settings<'_>) -> bool {
        settings.setup.execution.model == Model::DynamicDeadlines
    }

    fn outputs(&self, _: &Settings<'_>) -> Vec<OutputInfo> {
        Out::ports()
    }

    fn inputs(&self, _: &Settings<'_>) -> Vec<PortInfo> {
        In::ports()
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        site.add(Policy::new(site.setup(), site.resolved(), site), None)
    }
}

/// Sets deadlines for each frame.
struct Policy {
    params: Params,
    overhead: Overhead,
    vehicle: VehicleParams,
}

impl Policy {
    fn new(config: &Config, resolved: &Resolved, site: &Site<'_>) -> Self {
        let period_s = config.sensing.period_ms * 1e-3;
        let params = &resolved.deadlines;
        // A step longer than a period makes the next frame wait.
        let params = Params {
            detector_max_s: params.detector_max_s.min(period_s).max(params.detector_min_s),
            planner_max_s: params.planner_max_s.min(period_s).max(params.planner_min_s),
            ..*params
        };
        let seen_s = period_s + config.control.period_ms * 1e-3 + config.sim.vehicle.dead_time_s;
        // Frames until a newly visible object is reported.
        let detects = first_stream::<Detections>(site.operators).is_some();
        let confirmed = if detects { resolved.tracker_hits_min.saturating_sub(1) } else { 0 };
        let overhead = Overhead { seen_s, hidden_s: seen_s + confirmed as f64 * period_s };
        Self { params, overhead, vehicle: config.sim.vehicle.clone() }
    }

    /// Deadlines before the first message.
    fn before(&self) -> Response {
        respond(&self.params, None, self.overhead, 0)
    }
}

impl Operator for Policy {
    type In = In;
    type Out = Out;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Out) {
        let Some(predictions) = input.predictions.get() else { return };
        let Some(ego) = input.ego.get().filter(|ego| ego.is_plausible()) else { return };
        let Some(route) = input.route.get() else { return };
        let situation = Situation {
            now: cx.now(),
            ego,
            route,
            shape: &self.vehicle.shape,
            limits: &self.vehicle.limits,
            predictions: &predictions.predictions,
        };
        let hazard = nearest_hazard(&self.params, &situation, self.overhead);
        let obstacles = obstacles_near(&self.params, &situation);
        let answer = respond(&self.params, hazard, self.overhead, obstacles);
        let (response, detector) = (Span::from_secs(answer.total_s), Span::from_secs(answer.detector_s));
        // The rest of the response time after the detector's actual share.
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
        out.budget.send(budget);
        out.detector.send(detector);
        out.planner.send(planner);
    }
}
