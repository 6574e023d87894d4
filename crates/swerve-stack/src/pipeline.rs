//! A pipeline: the operators of an assembly in a graph, ready to run.

use core::any::Any;
use std::collections::BTreeMap;

use anyhow::{Context as _, anyhow};
use swerve_core::{Rng, Span, Time};
use swerve_flow::{Graph, Payload, Policy, RuntimeModel, SourceHandle};
use swerve_msg::truth::WorldState;
use swerve_msg::{ActorId, Route};
use swerve_scenario::Scenario;
use swerve_sim::with_traffic;
use swerve_text::in_one_line;
use swerve_vehicle::VehicleParams;

use crate::agent::Agent;
use crate::assembly::{Assembly, Placed};
use crate::base::on_road;
use crate::config::clock::Clock;
use crate::config::execution::{parse_policy, span_ms, span_of_ms};
use crate::kind::{Heavy, Node, Role};
use crate::namespace::Namespace;
use crate::operators::{add_shared, deadlines};
use crate::problems::KeyProblems;
use crate::setup::Setup;
use crate::site::{Building, OnRung, Site, Surroundings};
use crate::stage::{self, Rendered, SharedStage, StreamMemory};
use crate::unseen::Unseen;

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
    /// Stacks of all egos of a scenario but the first, for the configuration of the first.
    fn all(setup: &Setup, scenario: &Scenario) -> anyhow::Result<Vec<Self>> {
        scenario.egos().into_iter().skip(1).map(|(id, ego)| Self::new(setup, scenario, (id, ego))).collect()
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
        let pipeline = Self::build_without_stage(setup, scenario)?;
        if let Some(stage) = pipeline.stage.as_ref().filter(|_| pipeline.fed.is_empty()) {
            stage.raise(setup, &pipeline.scenario).context("building the pipeline")?;
        }
        Ok(pipeline)
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

    /// As [`build`](Self::build), for a process that steps no cameras and lidars.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn build_without_stage(setup: &Setup, scenario: &Scenario) -> anyhow::Result<Self> {
        let given = setup;
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
        let others = OtherStack::all(given, &scenario)?;
        let names = match others.is_empty() {
            true => Namespace::default(),
            false => Namespace::new(&scenario.ego_name, true, world_of(&assembly)?),
        };
        let around = Surroundings { scenario, vehicle };
        let Building { mut graph, memory, sources, stage, last_fault, .. } =
            assemble((setup, &assembly, &names), &around, &others).context("building the pipeline")?;
        let fed = if setup.sim.guest { feed_outside(&mut graph, &assembly)? } else { Vec::new() };
        let Surroundings { scenario, vehicle } = around;
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

/// Adds the stacks of all egos, the first with the world.
fn assemble(
    first: (&Setup, &Assembly, &Namespace),
    around: &Surroundings,
    others: &[OtherStack],
) -> anyhow::Result<Building> {
    let mut building = Building::default();
    let all: Vec<&Namespace> =
        core::iter::once(first.2).chain(others.iter().map(|other| &other.names)).collect();
    add_stack(&mut building, first, around, World::Added(&all))?;
    for OtherStack { names, setup, assembly, scenario, .. } in others {
        let around = Surroundings { scenario: scenario.clone(), vehicle: around.vehicle.clone() };
        add_stack(&mut building, (setup, assembly, names), &around, World::There)?;
    }
    for (feedback, edge) in core::mem::take(&mut building.loops) {
        let befallen = building.befallen.get(&edge.stream).filter(|_| !edge.raw).copied();
        let stream = befallen.or_else(|| building.graph.stream(&edge.stream));
        let stream = stream.with_context(|| format!("there is no stream `{}`", edge.stream))?;
        building.graph.connect_any(feedback, stream)?;
    }
    Ok(building)
}

/// The world of a stack that is added.
#[derive(Clone, Copy)]
enum World<'a> {
    /// It is added with this stack, for stacks of these names.
    Added(&'a [&'a Namespace]),
    /// It is there already.
    There,
}

/// Adds every operator with its `[operator.NAME]` settings and the faults on its streams, in the order of the assembly.
fn add_stack(
    building: &mut Building,
    (setup, assembly, names): (&Setup, &Assembly, &Namespace),
    surroundings: &Surroundings,
    world: World<'_>,
) -> anyhow::Result<()> {
    let resources: BTreeMap<&str, swerve_flow::Resource> = setup
        .resource
        .iter()
        .map(|(name, resource)| {
            (name.as_str(), building.graph.resource(names.operator(name), resource.slots))
        })
        .collect();
    for placed in assembly.operators() {
        let mut site = Site {
            building,
            operators: assembly.operators(),
            placed,
            setup,
            surroundings,
            names,
            on_rung: None,
        };
        match (placed.kind.node().role, world) {
            (Role::World, World::Added(stacks)) if stacks.len() > 1 => add_shared(&mut site, stacks)?,
            (Role::World, World::There) => {
                put_faults(building, setup, placed, names)?;
                continue;
            }
            _ => add_rungs(&mut site)?,
        }
        let resource = placed.own.uses.as_deref().and_then(|name| resources.get(name)).copied();
        configure(&mut site, resource)?;
        put_faults(building, setup, placed, names)?;
    }
    Ok(())
}

/// Adds an operator, on each of its rungs.
fn add_rungs(site: &mut Site<'_>) -> anyhow::Result<()> {
    let (placed, setup) = (site.placed, site.setup);
    let wrong = |found: KeyProblems| anyhow!("operator.{}: {}", placed.name, in_one_line(&found));
    for rung in placed.schedule.rungs() {
        site.on_rung = rung.map(|rung| OnRung::new(placed, setup, rung)).transpose().map_err(wrong)?;
        placed.kind.add(site)?;
    }
    site.on_rung = None;
    Ok(())
}

/// Sets timer, run time, policy, deadline, resource and delay of an operator.
fn configure(site: &mut Site<'_>, resource: Option<swerve_flow::Resource>) -> anyhow::Result<()> {
    let (placed, setup) = (site.placed, site.setup);
    let (name, schedule) = (&placed.name, &placed.schedule);
    let wrong = |message: String| anyhow!("operator.{name}: {message}");
    let (own, settings) = (&placed.own, placed.settings(setup));
    let way = placed.kind.on_its_way(&settings);
    let deadline = match &own.deadline {
        Some(deadline) => Some(deadline.deadline().map_err(wrong)?),
        None => deadlines::deadline(site)?,
    };
    let mut node = site.node()?;
    if let Some(period) = schedule.period {
        node = node.on_timer(settings.drawn_timer(period));
    }
    if placed.kind.node().origin {
        node = node.origin();
    }
    node = node.runtime(match (&own.runtime, &way) {
        _ if !own.rungs.is_empty() => RuntimeModel::LADDER,
        (Some(runtime), _) => runtime.model().map_err(wrong)?,
        (None, Some(way)) => RuntimeModel::Fixed(way.after),
        (None, None) => placed.kind.runtime(&settings).map_err(wrong)?,
    });
    if let Some(policy) = &own.policy {
        node = node.policy(parse_policy(policy).map_err(wrong)?);
    } else if let Some(way) = &way {
        node = node.policy(Policy::pipelined(way.frames));
    }
    if let Some(deadline) = deadline {
        node = node.deadline(deadline);
    }
    if let Some(resource) = resource {
        node = node.uses(resource);
    }
    let delay = span_ms(own.delay_ms + placed.kind.added_delay_ms(&settings)).map_err(wrong)?;
    let later = way.filter(|_| own.runtime.is_some()).map_or(Span::ZERO, |way| way.after);
    node = node.delay(delay + later);
    let is_heavy = match placed.kind.node().heavy {
        Heavy::Yes => true,
        Heavy::OnWallClock => settings.on_wall_clock(),
        Heavy::No => false,
    };
    let _configured = if is_heavy || setup.process_of(name).is_some() { node.heavy() } else { node };
    Ok(())
}

/// Adds the configuration's faults between an operator's streams and their readers.
fn put_faults(
    building: &mut Building,
    setup: &Setup,
    placed: &Placed,
    names: &Namespace,
) -> anyhow::Result<()> {
    for (k, output) in placed.outputs.iter().enumerate() {
        let on_it = |name: &str| name == output.stream || (k == 0 && name == placed.name);
        for (name, fault) in setup.fault.iter().filter(|(_, fault)| on_it(&fault.stream)) {
            let corruptible = setup.registry.corruptible(output.port.payload);
            let corruptible = corruptible
                .with_context(|| format!("fault.{name}: no fault befalls `{}`", output.port.payload))?;
            let in_graph = names.stream(&output.stream);
            let stream = building.befallen.get(&in_graph).copied();
            let stream = stream.or_else(|| building.graph.stream(&in_graph));
            let stream = stream.with_context(|| format!("there is no stream `{in_graph}`"))?;
            let operator = names.operator(name);
            let befallen = corruptible.put_on(&mut building.graph, stream, (&operator, fault), setup.seed)?;
            building.befallen.insert(in_graph.clone(), befallen);
            building.last_fault.insert(in_graph, operator);
        }
    }
    Ok(())
}
