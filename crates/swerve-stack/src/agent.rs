//! External agents that replace a part of the stack. An operator publishes the agent's decisions into the graph, under
//! the name of the operator that it replaces and with the run time, delay and faults configured for that one.

use std::sync::{Arc, Mutex, PoisonError};

use anyhow::Context as _;
use swerve_core::Span;
use swerve_flow::{
    Context, Every, Inputs, Latest, NamedInputs, NamedOutputs, Operator, OutputInfo, Payload, Port, PortInfo,
    RuntimeModel, every,
};
use swerve_geom::{FrenetPoint, Pose2, math};
use swerve_msg::{Command, EgoState, Plan, PlanPoint, PlanStatus, Route};
use swerve_vehicle::Limits;

use crate::assembly::{Assembly, Placed};
use crate::config::execution::span_of_ms;
use crate::kind::{Heavy, Node, OperatorKind, Settings};
use crate::setup::Setup;
use crate::site::Site;

/// An external agent, by the operator that it replaces.
#[derive(Clone)]
pub enum Agent {
    /// Pedals and steering in place of the controller, once a control period.
    Command(Seat<Command>),
    /// A plan in place of the planner, once a frame of the obstacle sensor.
    Plan(Seat<Plan>),
    /// A target speed and lateral offset from which a plan is made, in place of the planner.
    Target(Seat<Target>),
}

/// Target speed and lateral offset from the route.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Target {
    /// Target speed, m/s.
    pub speed_mps: f64,
    /// Target distance to the left of the route's centre line, metres.
    pub offset_m: f64,
}

/// Slot for the agent's newest decision. The operator repeats it until there is a newer one.
pub struct Seat<T>(Arc<Mutex<Option<T>>>);

impl<T> Clone for Seat<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T> Default for Seat<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<T: Clone> Seat<T> {
    /// Stores a decision, replacing the one before.
    pub fn set(&self, decision: T) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(decision);
    }

    fn get(&self) -> Option<T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Agent {
    /// Name of the operator that the agent replaces: the publisher of its message type.
    ///
    /// # Errors
    /// The pipeline has no such operator, or the configuration makes no pipeline.
    pub fn operator(&self, setup: &Setup) -> anyhow::Result<String> {
        let assembly = Assembly::new(setup)?;
        Ok(self.place(&assembly)?.name.clone())
    }

    fn place<'a>(&self, assembly: &'a Assembly) -> anyhow::Result<&'a Placed> {
        let name = match self {
            Self::Command(_) => assembly.publisher::<Command>(),
            Self::Plan(_) | Self::Target(_) => assembly.publisher::<Plan>(),
        };
        name.and_then(|name| assembly.operator(name))
            .context("no operator of the pipeline makes what an agent decides")
    }

    /// Time between two decisions.
    pub fn period(&self, setup: &Setup) -> Span {
        span_of_ms(match self {
            Self::Command(_) => setup.control.period_ms,
            Self::Plan(_) | Self::Target(_) => setup.sensing.period_ms,
        })
    }

    /// The configuration with the agent in place of its operator, and without the planner if that has no use then.
    ///
    /// # Errors
    /// The safety gate is enabled and the agent decides pedals: the gate takes motion.
    pub(crate) fn placed_in(&self, setup: &Setup) -> anyhow::Result<Setup> {
        anyhow::ensure!(
            !(setup.gate.enabled && matches!(self, Self::Command(_))),
            "gate.enabled: the gate takes motion, an agent in the place of the controller gives pedals; \
             expected false, or an agent in the place of the planner"
        );
        let assembly = Assembly::new(setup)?;
        let place = self.place(&assembly)?;
        let mut setup = setup.clone();
        let kind = AgentKind { agent: self.clone(), in_place_of: place.kind.clone() };
        setup.registry = setup.registry.clone().with_kind(kind);
        setup.operator.entry(place.name.clone()).or_default().kind = Some(KIND.to_owned());
        // Plans have no reader where the agent replaces the controller.
        if let (Self::Command(_), Some(planner)) = (self, assembly.publisher::<Plan>()) {
            setup.operator.entry(planner.to_owned()).or_default().enabled = Some(false);
        }
        Ok(setup)
    }
}

/// Kind of the operator that an agent provides.
pub(crate) const KIND: &str = "agent";

/// Operator kind of an agent, for the assembly.
struct AgentKind {
    agent: Agent,
    in_place_of: Arc<dyn OperatorKind>,
}

/// Trigger of the agent's decisions.
#[derive(Inputs)]
struct DecidedIn {
    /// Period of the decisions.
    tick: Every,
}

/// Trigger and ego state for an agent that decides targets.
#[derive(Inputs)]
struct TargetIn {
    /// Period of the decisions.
    tick: Every,
    /// State of the ego.
    ego: Latest<EgoState>,
    /// Route to follow.
    route: Latest<Route>,
}

impl OperatorKind for AgentKind {
    fn node(&self) -> Node {
        Node::new(KIND, "an agent outside, in the place of a part of the stack")
            .stays("it is asked from outside")
            .heavy(Heavy::No)
    }

    fn outputs(&self, _: &Settings<'_>) -> Vec<OutputInfo> {
        match self.agent {
            Agent::Command(_) => <Port<Command> as NamedOutputs>::ports(),
            Agent::Plan(_) | Agent::Target(_) => <Port<Plan> as NamedOutputs>::ports(),
        }
    }

    fn inputs(&self, _: &Settings<'_>) -> Vec<PortInfo> {
        match self.agent {
            Agent::Command(_) | Agent::Plan(_) => DecidedIn::ports(),
            Agent::Target(_) => TargetIn::ports(),
        }
    }

    fn runtime(&self, settings: &Settings<'_>) -> Result<RuntimeModel, String> {
        self.in_place_of.runtime(settings)
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let timer = Some(every(self.agent.period(site.setup())));
        match &self.agent {
            Agent::Command(seat) => site.add(Decided(seat.clone()), timer),
            Agent::Plan(seat) => site.add(Decided(seat.clone()), timer),
            Agent::Target(seat) => {
                let limits = site.setup().sim.vehicle.limits;
                site.add(TargetPlanner { seat: seat.clone(), limits }, timer)
            }
        }
    }
}

/// Publishes the agent's latest decision.
struct Decided<T>(Seat<T>);

impl<T: Payload + Clone> Operator for Decided<T> {
    type In = DecidedIn;
    type Out = Port<T>;

    fn step(&mut self, _: &mut Context<'_>, _: &DecidedIn, out: &mut Port<T>) {
        if let Some(decision) = self.0.get() {
            out.send(decision);
        }
    }
}

/// Makes a plan from a target: along the route, across to the offset, with the speed changed to the target speed.
struct TargetPlanner {
    seat: Seat<Target>,
    limits: Limits,
}

impl TargetPlanner {
    /// Horizon of a plan, and time between its points.
    const HORIZON: Span = Span::from_ms(3000);
    const STEP: Span = Span::from_ms(100);
    /// Duration of a change of offset, s.
    const SWERVE_S: f64 = 1.5;
    /// Share of the limits of acceleration and braking that a change of speed uses.
    const EASE: f64 = 0.6;

    fn plan(&self, ego: &EgoState, route: &Route, target: Target) -> Plan {
        let line = route.line();
        let start = line.project_pose(ego.pose);
        let accel = if target.speed_mps >= ego.speed_mps {
            Self::EASE * self.limits.accel_max_mps2
        } else {
            -Self::EASE * self.limits.brake_max_mps2
        };
        let step_s = Self::STEP.as_secs();
        let (mut speed, mut s_m) = (ego.speed_mps.max(0.0), start.s_m);
        let mut points: Vec<PlanPoint> = Vec::new();
        for i in 0..=Self::HORIZON.ns() / Self::STEP.ns() {
            let t = i as f64 * step_s;
            let d_m = start.d_m + (target.offset_m - start.d_m) * blend(t / Self::SWERVE_S);
            let point = line.to_map(FrenetPoint { s_m, d_m });
            let along = line.at(s_m);
            let next = clamp_towards(speed, accel * step_s, target.speed_mps.max(0.0));
            points.push(PlanPoint {
                at: ego.stamp + Self::STEP * i,
                pose: Pose2::new(point.x_m, point.y_m, along.pose.heading_rad),
                curvature_1pm: along.curvature_1pm,
                speed_mps: speed,
                accel_mps2: (next - speed) / step_s,
            });
            s_m += 0.5 * (speed + next) * step_s;
            speed = next;
        }
        turn_along(&mut points);
        Plan { stamp: ego.stamp, status: PlanStatus::Found, points, work: 0 }
    }
}

/// Smooth step from 0 to 1, with first and second derivatives of zero at both ends.
fn blend(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * t * (10.0 - t * (15.0 - 6.0 * t))
}

fn clamp_towards(from: f64, change: f64, to: f64) -> f64 {
    if change >= 0.0 { (from + change).min(to) } else { (from + change).max(to) }
}

/// Sets headings and curvatures from the path itself where the points are far enough apart; elsewhere the last heading
/// is kept.
fn turn_along(points: &mut [PlanPoint]) {
    const TELLS_M: f64 = 0.05;
    for i in 1..points.len() {
        let between = points[i].pose.point() - points[i - 1].pose.point();
        let length = between.norm();
        if length < TELLS_M {
            points[i].pose.heading_rad = points[i - 1].pose.heading_rad;
            continue;
        }
        points[i].pose.heading_rad = math::atan2(between.y, between.x);
        let turn = swerve_geom::angle_between(points[i - 1].pose.heading_rad, points[i].pose.heading_rad);
        points[i].curvature_1pm = turn / length;
    }
}

impl Operator for TargetPlanner {
    type In = TargetIn;
    type Out = Port<Plan>;

    fn step(&mut self, _: &mut Context<'_>, input: &TargetIn, out: &mut Port<Plan>) {
        let Some(ego) = input.ego.get().filter(|ego| ego.is_plausible()) else { return };
        if let (Some(target), Some(route)) = (self.seat.get(), input.route.get()) {
            out.send(self.plan(ego, route, target));
        }
    }
}
