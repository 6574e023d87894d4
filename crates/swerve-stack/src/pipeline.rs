//! A pipeline: the operators of an assembly in a graph, ready to run.

use core::any::Any;
use std::collections::BTreeMap;

use anyhow::{Context as _, anyhow};
use swerve_core::{Span, Time};
use swerve_flow::{Graph, Payload, Policy, RuntimeModel, SourceHandle};
use swerve_msg::Route;
use swerve_scenario::Scenario;
use swerve_text::in_one_line;
use swerve_vehicle::VehicleParams;

use crate::agent::Agent;
use crate::assembly::{Assembly, Placed};
use crate::base::on_road;
use crate::config::clock::Clock;
use crate::config::execution::{parse_policy, span_ms, span_of_ms};
use crate::kind::{Heavy, Node};
use crate::operators::deadlines;
use crate::problems::KeyProblems;
use crate::setup::Setup;
use crate::site::{Building, OnRung, Site, Surroundings};
use crate::stage::{self, Rendered, SharedStage, StreamMemory};

pub use crate::controllers::controller;

/// A pipeline ready to run.
pub struct Pipeline {
    /// The graph.
    pub graph: Graph,
    /// Operators of the pipeline.
    pub assembly: Assembly,
    /// Scenario with the seed's variations.
    pub scenario: Scenario,
    /// First route, with the ground that may be used.
    pub route: Route,
    /// The ego vehicle.
    pub vehicle: VehicleParams,
    /// End of the scenario at the latest.
    pub until: Time,
    /// Memory of the images and point clouds of each stream.
    pub memory: BTreeMap<String, StreamMemory>,
    /// Clock of the run.
    pub clock: Clock,
    /// Handles of inputs from outside, by operator.
    sources: BTreeMap<String, Box<dyn Any + Send>>,
    /// Shared resources of cameras and lidars, if there are any.
    stage: Option<SharedStage>,
    /// Last fault of each stream with injected faults, by the name of the stream.
    last_fault: BTreeMap<String, String>,
}

impl Pipeline {
    /// Builds the pipeline of `config` around the world of `scenario`, or around the vehicle of `[live]`.
    ///
    /// # Errors
    /// If the configuration requests something unavailable.
    pub fn build(setup: &Setup, scenario: &Scenario) -> anyhow::Result<Self> {
        let pipeline = Self::build_without_stage(setup, scenario)?;
        if let Some(stage) = &pipeline.stage {
            stage.raise(setup, &pipeline.scenario).context("building the pipeline")?;
        }
        Ok(pipeline)
    }

    /// As [`build`](Self::build), with an external agent in place of a part of the stack.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn build_for(setup: &Setup, scenario: &Scenario, agent: &Agent) -> anyhow::Result<Self> {
        Self::build(&agent.placed_in(setup)?, scenario)
    }

    /// As [`build`](Self::build), for a process that steps no cameras and lidars.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn build_without_stage(setup: &Setup, scenario: &Scenario) -> anyhow::Result<Self> {
        let setup = on_road(setup, &scenario.road);
        let setup = &*setup;
        let scenario = drawn(setup, scenario);
        let assembly = Assembly::new(setup)?;
        let (route, vehicle) = (scenario.road.route(), setup.sim.vehicle.clone());
        let around = Surroundings { scenario, vehicle };
        let Building { graph, memory, sources, stage, last_fault, .. } =
            assemble(setup, &assembly, &around).context("building the pipeline")?;
        let Surroundings { scenario, vehicle } = around;
        let until = last_step(Span::from_secs(scenario.end.timeout_s), span_of_ms(setup.sim.dt_ms));
        let clock = setup.clock.source;
        Ok(Self {
            graph,
            assembly,
            scenario,
            route,
            vehicle,
            until,
            memory,
            clock,
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

    /// Operator whose messages of this type are read: the last fault of their first stream, else its publisher.
    pub fn publisher_after_faults<T: Payload>(&self) -> Option<&str> {
        let (placed, output) = self.assembly.first_stream::<T>()?;
        Some(self.last_fault.get(&output.stream).unwrap_or(&placed.name))
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

/// First step of the world at which the scenario's time is over.
fn last_step(timeout: Span, dt: Span) -> Time {
    let steps = (timeout.ns() + dt.ns() - 1) / dt.ns();
    Time::from_ns(steps * dt.ns())
}

/// The scenario with the configuration's speed, as its seed varies it.
pub fn drawn(setup: &Setup, scenario: &Scenario) -> Scenario {
    let mut scenario = scenario.clone();
    if let Some(speed) = setup.ego.speed_mps {
        scenario.ego.target_speed_mps = speed;
    }
    if setup.is_driven_over_ros2() {
        // The other stack is not connected yet.
        scenario.ego.start_speed_mps = Some(0.0);
    }
    if setup.sim.draws && setup.live.is_none() { scenario.drawn(setup.seed) } else { scenario }
}

/// Adds every operator with its `[operator.NAME]` settings and the faults on its streams, in the order of the assembly.
fn assemble(setup: &Setup, assembly: &Assembly, surroundings: &Surroundings) -> anyhow::Result<Building> {
    let mut building = Building::default();
    let resources: BTreeMap<&str, swerve_flow::Resource> = setup
        .resource
        .iter()
        .map(|(name, resource)| (name.as_str(), building.graph.resource(name, resource.slots)))
        .collect();
    for placed in assembly.operators() {
        let mut site = Site {
            building: &mut building,
            operators: assembly.operators(),
            placed,
            setup,
            surroundings,
            on_rung: None,
        };
        let wrong = |found: KeyProblems| anyhow!("operator.{}: {}", placed.name, in_one_line(&found));
        for rung in placed.schedule.rungs() {
            site.on_rung = rung.map(|rung| OnRung::new(placed, setup, rung)).transpose().map_err(wrong)?;
            placed.kind.add(&mut site)?;
        }
        site.on_rung = None;
        let resource = placed.own.uses.as_deref().and_then(|name| resources.get(name)).copied();
        configure(&mut site, resource)?;
        put_faults(&mut building, setup, placed)?;
    }
    for (feedback, edge) in core::mem::take(&mut building.loops) {
        let befallen = building.befallen.get(&edge.stream).filter(|_| !edge.raw).copied();
        let stream = befallen.or_else(|| building.graph.stream(&edge.stream));
        let stream = stream.with_context(|| format!("there is no stream `{}`", edge.stream))?;
        building.graph.connect_any(feedback, stream)?;
    }
    Ok(building)
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
fn put_faults(building: &mut Building, setup: &Setup, placed: &Placed) -> anyhow::Result<()> {
    for (k, output) in placed.outputs.iter().enumerate() {
        let on_it = |name: &str| name == output.stream || (k == 0 && name == placed.name);
        for (name, fault) in setup.fault.iter().filter(|(_, fault)| on_it(&fault.stream)) {
            let corruptible = setup.registry.corruptible(output.port.payload);
            let corruptible = corruptible
                .with_context(|| format!("fault.{name}: no fault befalls `{}`", output.port.payload))?;
            let stream = building.befallen.get(&output.stream).copied();
            let stream = stream.or_else(|| building.graph.stream(&output.stream));
            let stream = stream.with_context(|| format!("there is no stream `{}`", output.stream))?;
            let befallen = corruptible.put_on(&mut building.graph, stream, (name, fault), setup.seed)?;
            building.befallen.insert(output.stream.clone(), befallen);
            building.last_fault.insert(output.stream.clone(), name.clone());
        }
    }
    Ok(())
}
