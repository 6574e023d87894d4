//! A pipeline: the operators of an assembly in a graph, ready to run.

mod stacks;

use core::any::Any;
use std::collections::BTreeMap;

use anyhow::{Context as _, anyhow};
use swerve_core::{Rng, Span, Time};
use swerve_flow::{Graph, Payload, SourceHandle};
use swerve_msg::truth::WorldState;
use swerve_msg::{ActorId, Route};
use swerve_scenario::Scenario;
use swerve_sim::with_traffic;
use swerve_vehicle::VehicleParams;

use crate::agent::Agent;
use crate::assembly::{Assembly, Placed};
use crate::base::on_road;
use crate::config::clock::Clock;
use crate::config::execution::span_of_ms;
use crate::kind::{Node, Role};
use crate::namespace::Namespace;
use crate::setup::Setup;
use crate::site::{Building, Surroundings};
use crate::stage::{self, Rendered, SharedStage, StreamMemory};
use crate::unseen::Unseen;

use stacks::assemble;

pub use crate::controllers::controller;

/// A pipeline ready to run.
pub struct Pipeline {
    /// The graph.
    pub graph: Graph,
    /// Operators of the pipeline; of the first ego's stack, if there are several egos.
    pub assembly: Assembly,
    /// Scenario with the seed's variations.
    pub scenario: Scenario,
    /// First route, with the ground that may be used.
    pub route: Route,
    /// Names of the first ego's stack in the graph.
    pub names: Namespace,
    /// Stacks of the other egos, ordered by identity.
    pub others: Vec<OtherStack>,
    /// The ego vehicle.
    pub vehicle: VehicleParams,
    /// End of the scenario at the latest.
    pub until: Time,
    /// Memory of the images and point clouds of each stream.
    pub memory: BTreeMap<String, StreamMemory>,
    /// Clock of the run.
    pub clock: Clock,
    /// World and sensors that the caller of a [`Session`](swerve_flow::Session) feeds under `sim.guest`; else empty.
    pub fed: Vec<String>,
    /// Handles of inputs from outside, by operator.
    sources: BTreeMap<String, Box<dyn Any + Send>>,
    /// Shared resources of cameras and lidars, if there are any.
    stage: Option<SharedStage>,
    /// Last fault of each stream with injected faults, by the name of the stream.
    last_fault: BTreeMap<String, String>,
}

/// Stack of one ego.
#[derive(Clone, Copy)]
pub struct Stack<'a> {
    /// Names in the graph.
    pub names: &'a Namespace,
    /// Operators.
    pub assembly: &'a Assembly,
    /// Scenario in the view of the ego.
    pub scenario: &'a Scenario,
    /// First route.
    pub route: &'a Route,
    last_fault: &'a BTreeMap<String, String>,
}

impl Stack<'_> {
    /// Operator whose messages of this type are read: the last fault of their first stream, else its publisher.
    pub fn publisher_after_faults<T: Payload>(&self) -> Option<&str> {
        let (placed, output) = self.assembly.first_stream::<T>()?;
        let fault = self.last_fault.get(&self.names.stream(&output.stream));
        Some(fault.and_then(|fault| self.names.own(fault)).unwrap_or(&placed.name))
    }
}

/// Stack of an ego beside the first.
pub struct OtherStack {
    /// Names of the stack in the graph.
    pub names: Namespace,
    /// Configuration: that of the run, with a seed of its own.
    pub setup: Setup,
    /// Operators of the stack.
    pub assembly: Assembly,
    /// Scenario in the view of this ego.
    pub scenario: Scenario,
    /// Its first route.
    pub route: Route,
}

impl OtherStack {
    /// Stacks of all egos of a scenario but the first, by the configuration of each.
    fn all(of_ego: impl Fn(usize) -> Setup, scenario: &Scenario) -> anyhow::Result<Vec<Self>> {
        let egos = scenario.egos().into_iter().enumerate().skip(1);
        egos.map(|(k, ego)| Self::new(&of_ego(k), scenario, ego)).collect()
    }

    fn new(setup: &Setup, scenario: &Scenario, (id, ego): (ActorId, &str)) -> anyhow::Result<Self> {
        let scenario = scenario.of_ego(id).context("there is no such ego")?;
        let setup = on_road(&setup_of_ego(setup, id), &scenario.road).into_owned();
        let assembly = Assembly::new(&setup)?;
        let names = Namespace::new(ego, false, world_of(&assembly)?);
        let route = scenario.road.route();
        Ok(Self { names, setup, assembly, scenario, route })
    }
}

/// Configuration of the stack of an ego: each ego but the first has a seed of its own, for the noise of its sensors.
pub fn setup_of_ego(setup: &Setup, ego: ActorId) -> Setup {
    let mut setup = setup.clone();
    if ego != ActorId::EGO {
        setup.seed = Rng::keyed(setup.seed, "ego", &[i64::from(ego.0)]).bits() >> 1;
        setup.course = None;
    }
    setup
}

/// Operator of the simulated world.
fn world_of(assembly: &Assembly) -> anyhow::Result<&str> {
    assembly.publisher::<WorldState>().context("several egos need a simulated world")
}

impl Pipeline {
    /// Builds the pipeline of `config` around the world of `scenario`, around the vehicle of `[live]`, or under
    /// `sim.guest` without a world: its caller feeds world and sensors.
    ///
    /// # Errors
    /// If the configuration requests something unavailable.
    pub fn build(setup: &Setup, scenario: &Scenario) -> anyhow::Result<Self> {
        Self::build_without_stage(setup, scenario)?.with_stage(setup)
    }

    /// Initialises the scene of rendered sensors, if there are any.
    fn with_stage(self, setup: &Setup) -> anyhow::Result<Self> {
        if let Some(stage) = self.stage.as_ref().filter(|_| self.fed.is_empty()) {
            stage.raise(setup, &self.scenario).context("building the pipeline")?;
        }
        Ok(self)
    }

    /// As [`build`](Self::build), with an external agent in place of a part of the stack.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn build_for(setup: &Setup, scenario: &Scenario, agent: &Agent) -> anyhow::Result<Self> {
        let egos = scenario.egos().len();
        anyhow::ensure!(egos == 1, "an external agent drives one ego: the scenario has {egos}");
        Self::build(&agent.placed_in(setup)?, scenario)
    }

    /// As [`build_for`](Self::build_for), with an agent for each ego, in the order of their identities. All agents
    /// replace the same operator; their turns at an instant come after those of everything before it in all stacks.
    ///
    /// # Errors
    /// As [`build`](Self::build); or the numbers of agents and egos differ.
    pub fn build_for_each(setup: &Setup, scenario: &Scenario, agents: &[Agent]) -> anyhow::Result<Self> {
        let egos = scenario.egos().len();
        anyhow::ensure!(
            egos == agents.len(),
            "expected an agent for each of {egos} egos, found {}",
            agents.len()
        );
        let placed: Vec<Setup> =
            agents.iter().map(|agent| agent.placed_in(setup)).collect::<Result<_, _>>()?;
        Self::build_of(|k| placed[k].clone(), scenario)?.with_stage(&placed[0])
    }

    /// As [`build`](Self::build), for a process that steps no cameras and lidars.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn build_without_stage(setup: &Setup, scenario: &Scenario) -> anyhow::Result<Self> {
        Self::build_of(|_| setup.clone(), scenario)
    }

    /// Builds the pipeline without its scene; `of_ego` gives the configuration of each ego's stack, by its place among
    /// the egos.
    fn build_of(of_ego: impl Fn(usize) -> Setup, scenario: &Scenario) -> anyhow::Result<Self> {
        let given = &of_ego(0);
        let setup = &*on_road(given, &scenario.road);
        let scenario = drawn(setup, scenario);
        let assembly = Assembly::new(setup)?;
        let (route, vehicle) = (scenario.road.route(), setup.sim.vehicle.clone());
        if !scenario.other_egos.is_empty() {
            problem_of_several(setup).map_or(Ok(()), |problem| Err(anyhow!(problem)))?;
        }
        if setup.live.is_none() {
            Unseen::new(&setup.sensing, &scenario)?;
        }
        let others = OtherStack::all(of_ego, &scenario)?;
        let names = match others.is_empty() {
            true => Namespace::default(),
            false => Namespace::new(&scenario.ego_name, true, world_of(&assembly)?),
        };
        let around =
            |scenario: &Scenario| Surroundings { scenario: scenario.clone(), vehicle: vehicle.clone() };
        let all_around = core::iter::once(&scenario).chain(others.iter().map(|other| &other.scenario));
        let all_around: Vec<Surroundings> = all_around.map(around).collect();
        let of_others = others.iter().map(|other| (&other.setup, &other.assembly, &other.names));
        let stacks: Vec<_> = core::iter::once((setup, &assembly, &names)).chain(of_others).collect();
        let Building { mut graph, memory, sources, stage, last_fault, .. } =
            assemble(&stacks, &all_around).context("building the pipeline")?;
        let fed = if setup.sim.guest { feed_outside(&mut graph, &assembly)? } else { Vec::new() };
        let until = last_step(Span::from_secs(scenario.end.timeout_s), span_of_ms(setup.sim.dt_ms));
        let clock = setup.clock.source;
        Ok(Self {
            graph,
            assembly,
            scenario,
            route,
            names,
            others,
            vehicle,
            until,
            memory,
            clock,
            fed,
            sources,
            stage,
            last_fault,
        })
    }

    /// Takes the handle that feeds the operator of this name from outside, if there is one for messages of this type.
    /// The operator's stream closes when the handle is dropped.
    pub fn take_source<T: Payload>(&mut self, operator: &str) -> Option<SourceHandle<T>> {
        self.sources.get(operator)?.is::<SourceHandle<T>>().then_some(())?;
        self.sources.remove(operator)?.downcast().ok().map(|handle| *handle)
    }

    /// As [`take_source`](Self::take_source), for the first operator with messages of this type.
    pub fn take_source_of<T: Payload>(&mut self) -> Option<SourceHandle<T>> {
        let takes = |(_, source): &(&String, &Box<dyn Any + Send>)| source.is::<SourceHandle<T>>();
        let operator = self.sources.iter().find(takes)?.0.clone();
        self.take_source(&operator)
    }

    /// Stack of the first ego.
    pub fn stack(&self) -> Stack<'_> {
        let Self { names, assembly, scenario, route, last_fault, .. } = self;
        Stack { names, assembly, scenario, route, last_fault }
    }

    /// Stacks of all egos, ordered by the identity of the ego.
    pub fn stacks(&self) -> Vec<Stack<'_>> {
        let last_fault = &self.last_fault;
        let others = self.others.iter().map(|OtherStack { names, assembly, scenario, route, .. }| Stack {
            names,
            assembly,
            scenario,
            route,
            last_fault,
        });
        core::iter::once(self.stack()).chain(others).collect()
    }

    /// Description of an operator; `None` for additional operators such as faults.
    pub fn node(&self, operator: &str) -> Option<Node> {
        self.assembly.operator(operator).map(|placed| placed.kind.node())
    }

    /// Returns a function that, once the pipeline has run, gives the device that computed its images, if any.
    pub fn rendered(&self) -> impl FnOnce() -> Option<Rendered> + use<> {
        let stage = self.stage.clone();
        move || stage.map(|stage| stage::rendered(&stage))
    }
}

/// Replaces the world and its sensors by sources with the same streams, delays and faults; returns their names.
fn feed_outside(graph: &mut Graph, assembly: &Assembly) -> anyhow::Result<Vec<String>> {
    let is_outside = |placed: &&Placed| matches!(placed.kind.node().role, Role::World | Role::Sensor);
    let outside = assembly.operators().iter().filter(is_outside);
    outside
        .map(|placed| {
            graph.feed_outside(&placed.name)?;
            Ok(placed.name.clone())
        })
        .collect()
}

/// First step of the world at which the scenario's time is over.
fn last_step(timeout: Span, dt: Span) -> Time {
    let steps = (timeout.ns() + dt.ns() - 1) / dt.ns();
    Time::from_ns(steps * dt.ns())
}

/// The scenario with the configuration's speed, as its seed varies it, with its traffic.
pub fn drawn(setup: &Setup, scenario: &Scenario) -> Scenario {
    let mut scenario = scenario.clone();
    if let Some(speed) = setup.ego.speed_mps {
        let egos = core::iter::once(&mut scenario.ego);
        let egos = egos.chain(scenario.other_egos.iter_mut().map(|other| &mut other.start));
        egos.for_each(|ego| ego.target_speed_mps = speed);
    }
    if setup.is_driven_over_ros2() {
        // The other stack is not connected yet.
        scenario.ego.start_speed_mps = Some(0.0);
    }
    if setup.live.is_some() {
        return scenario;
    }
    let scenario = if setup.sim.draws { scenario.drawn(setup.seed) } else { scenario };
    with_traffic(scenario, &setup.sim.vehicle.shape, setup.seed)
}

/// Problem of a run with several egos: each stack is in this process, in virtual time.
fn problem_of_several(setup: &Setup) -> Option<&'static str> {
    if setup.live.is_some() || setup.is_driven_over_ros2() {
        return Some("the scenario has several egos: expected one to drive over ROS 2 or on a vehicle");
    }
    (!setup.process.is_empty()).then_some("the scenario has several egos: expected no [process.NAME]")
}
