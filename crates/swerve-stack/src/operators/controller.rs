//! Controllers: from plans to commands for the vehicle.

use std::sync::Arc;

use swerve_control::{Controller, Input, Output};
use swerve_core::{Span, Time};
use swerve_flow::{
    Context, Every, Inputs, Latest, NamedInputs, NamedOutputs, Operator, OutputInfo, Port, PortInfo, Window,
    every,
};
use swerve_msg::{Command, EgoState, LocalPose, MotionCommand, Plan, Route, Supervision};
use swerve_pylot::{Follower, Preset, Rules};
use swerve_text::{KeyProblem, in_one_line};
use swerve_vehicle::{VehicleParams, accel_for_pedals};

use super::odom::LocalPoses;
use crate::config::execution::span_of_ms;
use crate::config::{Config, ControlConfig};
use crate::controllers::{NamedController as _, Pid};
use crate::kind::{Node, OperatorKind, Settings};
use crate::setup::Setup;
use crate::site::Site;

/// A controller of pedals, or of motion if a safety gate follows.
pub(super) struct Controllers;

/// Newest inputs, at each tick.
#[derive(Inputs)]
struct In {
    /// Period of the controller.
    tick: Every,
    /// State of the ego.
    ego: Latest<EgoState>,
    /// Plan to follow.
    plan: Latest<Plan>,
    /// Route to follow where there is no plan.
    route: Latest<Route>,
    /// Local poses: ego and plan are compared in the odometry frame.
    local: Option<Window<LocalPose, LOCAL_POSES>>,
    /// Lost processes of the run.
    processes: Vec<Latest<Supervision>>,
}

/// Local poses read at each tick: more than arrive between two.
const LOCAL_POSES: usize = 16;

/// Returns true if the controller publishes motion commands.
fn asks_for_motion(config: &Config) -> bool {
    config.gate.enabled || config.live.is_some()
}

impl OperatorKind for Controllers {
    fn node(&self) -> Node {
        Node::new("controller", "follows the newest plan by the law of `control.controller`")
            .section(&ControlConfig::SECTION)
            .stays("it is the actuation")
    }

    fn outputs(&self, settings: &Settings<'_>) -> Vec<OutputInfo> {
        match asks_for_motion(settings.setup) {
            true => <Port<MotionCommand> as NamedOutputs>::ports(),
            false => <Port<Command> as NamedOutputs>::ports(),
        }
    }

    fn inputs(&self, _: &Settings<'_>) -> Vec<PortInfo> {
        In::ports()
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let config = site.setup();
        let follower = PlanFollower::new(config, &site.resolved().rules)?;
        let timer = every(span_of_ms(config.control.period_ms));
        if asks_for_motion(config) {
            site.add(MotionController(follower), Some(timer))
        } else {
            site.add(PedalController(follower), Some(timer))
        }
    }
}

/// Follows the newest plan, or the route before the first plan. Stops if a process is lost.
struct PlanFollower {
    controller: Box<dyn Controller>,
    /// The original's follower, if configured.
    original: Option<Follower>,
    vehicle: VehicleParams,
    /// Newest plausible state.
    ego: Option<EgoState>,
    /// Newest plausible plan. It expires where no new one follows.
    plan: Option<Arc<Plan>>,
    local: LocalPoses,
    /// Local pose at that plan's stamp.
    plan_local: Option<LocalPose>,
    /// Path of a stop, while one is required.
    stop_along: Option<Plan>,
}

impl PlanFollower {
    fn new(setup: &Setup, rules: &Rules) -> anyhow::Result<Self> {
        let wrong = |found: Vec<KeyProblem>| anyhow::anyhow!("control: {}", in_one_line(&found));
        Ok(Self {
            controller: setup.built_controller().map_err(wrong)?,
            original: original(setup, rules),
            vehicle: setup.sim.vehicle.clone(),
            ego: None,
            plan: None,
            local: LocalPoses::default(),
            plan_local: None,
            stop_along: None,
        })
    }

    /// One step of control: the state used, and the output; `None` before the first state and route.
    fn step(&mut self, now: Time, input: &In) -> Option<(EgoState, Output)> {
        // Ignores implausible states and plans, and states that repeat the last one or are older: the last one is used
        // until it is too old.
        let is_news =
            |ego: &EgoState| self.ego.is_none_or(|before| ego.stamp >= before.stamp && !ego.repeats(&before));
        let ego = input.ego.get().filter(|ego| ego.is_plausible() && is_news(ego));
        self.ego = ego.map(|ego| **ego).or(self.ego);
        let ego = &self.ego?;
        self.local.take(input.local.as_ref().map_or(&[], |local| local.get()));
        if let Some(plan) = input.plan.get().filter(|plan| plan.is_plausible()) {
            if self.plan.as_ref().is_none_or(|known| known.stamp != plan.stamp) {
                self.plan_local = self.local.at(plan.stamp);
            }
            self.plan = Some(plan.shared());
        }
        // In the map as the plan knew it: a correction since then moves neither the ego nor the plan.
        let known = self.plan_local.or_else(|| self.local.at(ego.stamp));
        let ego = &self.local.state(ego, known);
        let plan = self.plan.as_deref();
        let gone = |processes: &Latest<Supervision>| processes.get().is_some_and(|all| !all.gone.is_empty());
        if input.processes.iter().any(gone) {
            // Newer plans are ignored: their inputs may be out of date.
            self.stop_along.get_or_insert_with(|| over(plan, now));
        } else {
            self.stop_along = None;
        }
        if self.stop_along.is_none()
            && let Some(original) = &mut self.original
        {
            return Some((*ego, original.step(now, ego, plan)));
        }
        let plan = self.stop_along.as_ref().or(plan);
        let input = Input { now, ego, plan, route: input.route.get()? };
        let output = self.controller.step(&input);
        Some((*ego, output))
    }
}

/// The original's follower: under the paper's preset, unless another law or another following is configured.
fn original(config: &Config, rules: &Rules) -> Option<Follower> {
    let Config { planning, control, sim, .. } = config;
    let by_pid = config.controller() == Pid::NAME && control.following.is_none();
    (by_pid && planning.preset == Preset::Paper)
        .then(|| Follower::new(rules, &sim.vehicle.shape, &sim.vehicle.limits))
}

/// Publishes pedals, for a vehicle without a gate.
struct PedalController(PlanFollower);

impl Operator for PedalController {
    type In = In;
    type Out = Port<Command>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        if let Some((_, output)) = self.0.step(cx.now(), input) {
            out.loan().send(output.command);
        }
    }
}

/// Publishes motion, for a safety gate. The stamp is that of the state used: without new states the controller counts
/// as silent for the gate.
struct MotionController(PlanFollower);

impl Operator for MotionController {
    type In = In;
    type Out = Port<MotionCommand>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        let Some((ego, output)) = self.0.step(cx.now(), input) else { return };
        let Command { steering_rad, throttle, brake } = output.command;
        // Acceleration of the pedals, for a law that outputs these.
        let by_pedals = || {
            let pedals = swerve_vehicle::Pedals { throttle, brake };
            accel_for_pedals(&self.0.vehicle, ego.speed_mps, pedals)
        };
        let accel_mps2 = output.accel_mps2.unwrap_or_else(by_pedals);
        let speed_mps = output.speed_mps;
        out.loan().send(MotionCommand { stamp: ego.stamp, steering_rad, speed_mps, accel_mps2 });
    }
}

/// The same path with its time over: the controller makes a comfortable stop along it.
fn over(plan: Option<&Plan>, now: Time) -> Plan {
    let mut plan = plan.cloned().unwrap_or_default();
    let since = plan.end() - now + Span::from_ns(1);
    plan.points.iter_mut().for_each(|point| point.at = point.at - since);
    plan
}
