//! Deadline policy: time limits of detector and planner for each frame.

use anyhow::Context as _;
use swerve_core::Span;
use swerve_flow::{
    Anchor, At, Context, Deadline, Feedback, Inputs, Latest, NamedInputs, NamedOutputs, Operator, OutputInfo,
    Outputs, Port, PortInfo,
};
use swerve_msg::{Detections, EgoState, PredictionList, ResponseBudget, Route};
use swerve_planning::deadline::{Overhead, Params, Situation, nearest_hazard, obstacles_near, respond};
use swerve_vehicle::VehicleParams;

use crate::assembly::Placed;
use crate::config::model::{ExecutionConfig, Model};
use crate::kind::{Node, OperatorKind, Scheduled, Settings};
use crate::site::Site;

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

/// Deadline of the planner under the dynamic model, once the policy is in the graph.
pub(super) fn planner_deadline(site: &mut Site<'_>) -> anyhow::Result<Option<Deadline>> {
    let execution = &site.config().execution;
    let (reaction, is_dynamic) = (execution.reaction, execution.model == Model::DynamicDeadlines);
    if !is_dynamic {
        return Ok(site.own_deadline());
    }
    let policy = Policy::new(site);
    let before = respond(&policy.params, None, policy.overhead, 0);
    let name =
        site.assembly.publisher::<ResponseBudget>().context("execution.model: no operator sets deadlines")?;
    let name = format!("{name}.planner");
    let stream = site.graph().stream(&name).and_then(|stream| stream.typed::<Span>());
    let stream = stream.with_context(|| format!("there is no stream `{name}`"))?;
    let deadline = Deadline::from_policy(stream, Span::from_secs(before.planner_s));
    Ok(Some(deadline.anchor(Anchor::Start).reaction(reaction.into())))
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
        let policy = Policy::new(site);
        let before = respond(&policy.params, None, policy.overhead, 0);
        let reaction = site.config().execution.reaction;
        site.add(policy, None)?;
        let name = format!("{}.detector", site.name());
        let graph = site.graph();
        let stream = graph.stream(&name).and_then(|stream| stream.typed::<Span>());
        let behind: Feedback<Span> = graph.feedback("detector deadline");
        graph.connect(behind, stream.context("the policy was just added")?);
        let deadline = Deadline::from_policy(behind, Span::from_secs(before.detector_s));
        let scheduled = |placed: &&Placed| placed.kind.node().scheduled == Some(Scheduled::Detector);
        for detector in site.assembly.operators().iter().filter(scheduled) {
            let deadline = deadline.anchor(Anchor::Start).reaction(reaction.into());
            let _configured = site.graph().operator(&detector.name)?.deadline(deadline);
        }
        Ok(())
    }
}

/// Sets deadlines for each frame.
struct Policy {
    params: Params,
    overhead: Overhead,
    route: Route,
    vehicle: VehicleParams,
}

impl Policy {
    fn new(site: &Site<'_>) -> Self {
        let (config, resolved) = (site.config(), site.resolved());
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
        let detects = site.assembly.publisher::<Detections>().is_some();
        let confirmed = if detects { resolved.tracker_hits_min.saturating_sub(1) } else { 0 };
        let overhead = Overhead { seen_s, hidden_s: seen_s + confirmed as f64 * period_s };
        let route = site.surroundings().route.clone();
        Self { params, overhead, route, vehicle: config.sim.vehicle.clone() }
    }
}

impl Operator for Policy {
    type In = In;
    type Out = Out;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Out) {
        let Some(predictions) = input.predictions.get() else { return };
        let Some(ego) = input.ego.get().filter(|ego| ego.is_plausible()) else { return };
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
