//! Operators as assembled, and the access of a kind to the graph that it adds its operator to.

use core::any::Any;
use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::Context as _;
use swerve_core::Span;
use swerve_flow::{
    AnyFeedback, AnyOperator, Feedback, Graph, NamedInputs, NamedOutputs, Operator, OperatorRef, OutputInfo,
    Payload, PayloadType, PortInfo, Source, Taken, Timer, Wire,
};
use swerve_map::Map;
use swerve_msg::RungTaken;
use swerve_scenario::Scenario;
use swerve_vehicle::VehicleParams;

use crate::config::resolved::Resolved;
use crate::config::{Config, OperatorConfig};
use crate::kind::{Node, OperatorKind, Settings};
use crate::ladder::{Ladder, RUNG, Schedule};
use crate::namespace::Namespace;
use crate::setup::Setup;
use crate::shot::Shots;
use crate::stage::{SharedStage, StreamMemory};

/// One operator of a pipeline.
#[derive(Clone)]
pub struct Placed {
    /// Name.
    pub name: String,
    /// Kind.
    pub kind: Arc<dyn OperatorKind>,
    /// Its `[operator.NAME]` table, including the pipeline's own text.
    pub own: OperatorConfig,
    /// Inputs, by port.
    pub inputs: Vec<Input>,
    /// Outputs.
    pub outputs: Vec<Output>,
    /// The configuration as changed by the operator's own keys; `None` if they change nothing.
    pub(crate) setup: Option<Arc<Setup>>,
    /// Resolved settings of that configuration.
    pub resolved: Arc<Resolved>,
    pub(crate) schedule: Schedule,
    pub(crate) offered: Arc<[PayloadType]>,
}

/// An input port and the streams that feed it; a timer has none.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// The port.
    pub port: PortInfo,
    /// Streams that it reads.
    pub from: Vec<Edge>,
}

/// A stream as a port reads it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Edge {
    /// Name of the stream.
    pub stream: String,
    /// True for a feedback edge.
    pub feedback: bool,
    /// True if the stream is read before faults are injected.
    pub raw: bool,
}

/// A stream that an operator publishes.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// Name: the operator's, or `operator.port` for an operator with several outputs.
    pub stream: String,
    /// The port.
    pub port: OutputInfo,
    /// True if nothing is published on it under these settings.
    pub silent: bool,
    /// Reason that the stream never carries data; `None` if it does.
    pub empty: Option<String>,
}

impl Placed {
    /// The operator's view of the configuration.
    pub fn settings<'a>(&'a self, setup: &'a Setup) -> Settings<'a> {
        let setup = self.setup.as_deref().unwrap_or(setup);
        Settings { name: &self.name, setup, offered: &self.offered }
    }
}

/// The first stream of messages of this type, with the operator that publishes it.
pub(crate) fn first_stream<T: Payload>(operators: &[Placed]) -> Option<(&Placed, &Output)> {
    let streams =
        operators.iter().flat_map(|placed| placed.outputs.iter().map(move |output| (placed, output)));
    let payload = PayloadType::of::<T>();
    streams.into_iter().find(|(_, output)| output.port.payload == payload)
}

/// Settings of an operator on a rung.
pub(crate) struct OnRung {
    pub(crate) setup: Setup,
    pub(crate) resolved: Arc<Resolved>,
    /// Run time of a step, if the rungs set it.
    pub(crate) run_time: Option<Span>,
}

/// Scenario and vehicle that the operators of a drive are built for.
pub struct Surroundings {
    /// Scenario with the seed's variations.
    pub scenario: Scenario,
    /// The ego vehicle.
    pub vehicle: VehicleParams,
}

/// A graph during assembly, with resources shared by its operators.
#[derive(Default)]
pub(crate) struct Building {
    pub(crate) graph: Graph,
    /// Streams with injected faults, by name in the graph: the faulty stream that readers get.
    pub(crate) befallen: BTreeMap<String, swerve_flow::AnyStream>,
    /// Last fault of each stream with injected faults, by the name of the stream.
    pub(crate) last_fault: BTreeMap<String, String>,
    /// Feedback edges and the streams that they carry, by their names in the graph.
    pub(crate) loops: Vec<(AnyFeedback, Edge)>,
    /// Memory of the images and point clouds of each stream.
    pub(crate) memory: BTreeMap<String, StreamMemory>,
    /// Operators of the ladder that is being added, by rung.
    pub(crate) rungs: Vec<Box<dyn Any>>,
    /// Handles of inputs from outside, by operator.
    pub(crate) sources: BTreeMap<String, Box<dyn Any + Send>>,
    /// Shared resources of cameras and lidars, if there are any.
    pub(crate) stage: Option<SharedStage>,
    /// Frames of all cameras that wait for an adapter.
    pub(crate) shots: Arc<Shots>,
}

/// One operator in a graph during assembly.
pub struct Site<'a> {
    pub(crate) building: &'a mut Building,
    /// All operators of the pipeline, in the order of the graph.
    pub(crate) operators: &'a [Placed],
    pub(crate) placed: &'a Placed,
    pub(crate) setup: &'a Setup,
    pub(crate) surroundings: &'a Surroundings,
    /// Names in the graph.
    pub(crate) names: &'a Namespace,
    /// Settings of the rung that the operator is built for, if it is on a ladder.
    pub(crate) on_rung: Option<OnRung>,
}

impl Site<'_> {
    /// Name of the operator.
    pub fn name(&self) -> &str {
        &self.placed.name
    }

    /// Settings of the operator, on its rung.
    pub fn settings(&self) -> Settings<'_> {
        let settings = self.placed.settings(self.setup);
        let setup = self.on_rung.as_ref().map_or(settings.setup, |on_rung| &on_rung.setup);
        Settings { setup, ..settings }
    }

    /// The setup, with the configuration as it applies to the operator.
    pub fn setup(&self) -> &Setup {
        self.settings().setup
    }

    /// The configuration as it applies to the operator.
    pub fn config(&self) -> &Config {
        self.setup()
    }

    /// Resolved settings of the operator, on its rung.
    pub fn resolved(&self) -> &Resolved {
        self.on_rung.as_ref().map_or(&self.placed.resolved, |on_rung| &on_rung.resolved)
    }

    /// Schedule of the operator.
    pub(crate) fn schedule(&self) -> &Schedule {
        &self.placed.schedule
    }

    /// Run time of a step on the rung that the operator is built for, if the rungs of its ladder set it.
    pub fn run_time(&self) -> Option<Span> {
        self.on_rung.as_ref()?.run_time
    }

    /// Description of the kind.
    pub(crate) fn kind(&self) -> Node {
        self.placed.kind.node()
    }

    /// Stream of deadlines of this name: over a feedback edge, if its operator is added later.
    ///
    /// # Errors
    /// It is not a stream of deadlines.
    pub(crate) fn lengths(&mut self, stream: &str) -> anyhow::Result<Source<Span>> {
        let Building { graph, loops, .. } = &mut *self.building;
        let stream = &*self.names.stream(stream);
        if let Some(known) = graph.stream(stream) {
            let known = known.typed::<Span>();
            return Ok(known.with_context(|| format!("`{stream}` carries no deadlines"))?.into());
        }
        let feedback: Feedback<Span> =
            graph.feedback(self.names.stream(&format!("{}.deadline", self.placed.name)));
        let edge = Edge { stream: stream.to_owned(), feedback: true, raw: true };
        loops.push((feedback.into(), edge));
        Ok(feedback.into())
    }

    /// Scenario and vehicle.
    pub fn surroundings(&self) -> &Surroundings {
        self.surroundings
    }

    /// All lanes of the scenario's road or map; the lanes of a route are in it.
    pub fn map(&self) -> Arc<Map> {
        self.surroundings.scenario.road.map()
    }

    /// Operator that publishes the first stream of one of its ports; `None` if the port is not connected.
    pub fn source_of(&self, port: &str) -> Option<&str> {
        let input = self.placed.inputs.iter().find(|input| input.port.name == port)?;
        input.from.first()?.stream.split('.').next()
    }

    /// Adds the operator with its ports connected as assembled. `timer` drives its [`Every`](swerve_flow::Every) ports.
    ///
    /// # Errors
    /// A stream does not fit its port, or the timer is missing.
    pub fn add<O>(&mut self, operator: O, timer: Option<Timer>) -> anyhow::Result<()>
    where
        O: Operator<In: NamedInputs, Out: NamedOutputs>,
    {
        self.add_carrying(operator, timer, |_, _| {})
    }

    /// As [`add`](Self::add), for an operator that keeps state from step to step: on a ladder, `carry` takes it from the
    /// rung of the step before to that of the next one.
    ///
    /// # Errors
    /// As [`add`](Self::add).
    pub fn add_carrying<O>(
        &mut self,
        operator: O,
        timer: Option<Timer>,
        carry: fn(&mut O, &mut O),
    ) -> anyhow::Result<()>
    where
        O: Operator<In: NamedInputs, Out: NamedOutputs>,
    {
        let Self { building, placed, names, .. } = self;
        let Building { graph, befallen, loops, rungs, .. } = &mut **building;
        let name = names.operator(&placed.name);
        let feed =
            |graph: &mut Graph, port: &PortInfo| feed(graph, befallen, loops, (placed, names, port), timer);
        let Some(ladder) = &placed.schedule.ladder else {
            graph.add_wired(name, operator, feed)?;
            return Ok(());
        };
        rungs.push(Box::new(operator));
        if rungs.len() < ladder.rungs.len() {
            return Ok(());
        }
        let rungs = core::mem::take(rungs).into_iter().map(|rung| rung.downcast().map(|rung| *rung));
        let rungs: Result<Vec<O>, _> = rungs.collect();
        let rungs =
            rungs.map_err(|_| anyhow::anyhow!("operator.{}: its rungs differ in type", placed.name))?;
        graph.add_ladder(&name, on_ladder(ladder, rungs, carry), feed)?;
        Ok(())
    }

    /// As [`add`](Self::add), for an operator with ports declared in the configuration.
    ///
    /// # Errors
    /// As [`add`](Self::add).
    pub fn add_any(&mut self, operator: impl AnyOperator, timer: Option<Timer>) -> anyhow::Result<()> {
        let Self { building, placed, names, .. } = self;
        let Building { graph, befallen, loops, .. } = &mut **building;
        let inputs = placed.kind.inputs(&placed.settings(self.setup));
        let outputs: Vec<OutputInfo> = placed.outputs.iter().map(|output| output.port.clone()).collect();
        graph.add_any_wired(
            &names.operator(&placed.name),
            operator,
            (&inputs, &outputs),
            |graph, port| feed(graph, befallen, loops, (placed, names, port), timer),
        )?;
        Ok(())
    }

    /// Adds a source that is fed from outside; the pipeline provides its handle.
    pub fn add_source<T: Payload>(&mut self) {
        let name = self.names.operator(&self.placed.name);
        let (_, handle) = self.building.graph.source::<T>(name.clone());
        self.building.sources.insert(name, Box::new(handle));
    }

    /// The operator in the graph, once it is added.
    ///
    /// # Errors
    /// If it is not added yet.
    pub fn node(&mut self) -> anyhow::Result<OperatorRef<'_, ()>> {
        Ok(self.building.graph.operator(&self.names.operator(&self.placed.name))?)
    }

    /// Memory for large payloads of one of its outputs, with `arrays` in each message.
    pub(crate) fn memory(&mut self, output: &str, arrays: usize) -> StreamMemory {
        let memory = StreamMemory::new(arrays);
        let stream = self.names.stream(&format!("{}.{output}", self.placed.name));
        self.building.memory.insert(stream, memory.clone());
        memory
    }

    /// Frames of all cameras that wait for an adapter.
    pub(crate) fn shots(&self) -> Arc<Shots> {
        self.building.shots.clone()
    }

    /// Shared resources of cameras and lidars.
    pub(crate) fn stage(&mut self) -> SharedStage {
        self.building.stage.get_or_insert_default().clone()
    }
}

/// Operators of a ladder, with the reports of the rungs that their steps took.
fn on_ladder<O>(
    Ladder { rungs, sets_run_time }: &Ladder,
    operators: Vec<O>,
    carry: fn(&mut O, &mut O),
) -> swerve_flow::Ladder<O, RungTaken> {
    let reported: Vec<(String, Span)> = rungs.iter().map(|rung| (rung.name.clone(), rung.run_time)).collect();
    let run_times = rungs.iter().map(|rung| rung.run_time).chain(core::iter::repeat(Span::ZERO));
    swerve_flow::Ladder {
        rungs: run_times.zip(operators).collect(),
        sets_run_time: *sets_run_time,
        carry,
        output: RUNG,
        report: Box::new(move |Taken { rung, stamp, left }| {
            let (rung, run_time) = reported.get(rung)?.clone();
            Some(RungTaken { stamp, rung, run_time, left })
        }),
    }
}

/// Wire of a port, as assembled.
fn feed(
    graph: &mut Graph,
    befallen: &BTreeMap<String, swerve_flow::AnyStream>,
    loops: &mut Vec<(AnyFeedback, Edge)>,
    (placed, names, port): (&Placed, &Namespace, &PortInfo),
    timer: Option<Timer>,
) -> anyhow::Result<Wire> {
    if port.payload.is_none() {
        let timer = timer.with_context(|| format!("operator.{}: it has no period", placed.name))?;
        return Ok(Wire::Timer(timer));
    }
    let input = placed.inputs.iter().find(|input| input.port.name == port.name);
    let edges = input.map(|input| &input.from[..]).unwrap_or_default();
    let wires: Result<Vec<Wire>, _> =
        edges.iter().map(|edge| wire(graph, befallen, loops, (&placed.name, names, port), edge)).collect();
    let mut wires = wires?;
    Ok(match wires.len() {
        _ if port.many => Wire::Many(wires),
        0 => Wire::None,
        _ => wires.remove(0),
    })
}

/// Wire of a port for an edge.
fn wire(
    graph: &mut Graph,
    befallen: &BTreeMap<String, swerve_flow::AnyStream>,
    loops: &mut Vec<(AnyFeedback, Edge)>,
    (operator, names, port): (&str, &Namespace, &PortInfo),
    edge: &Edge,
) -> anyhow::Result<Wire> {
    if edge.feedback {
        let payload = port.payload.context("a timer closes no loop")?;
        let feedback = graph.feedback_any(names.stream(&format!("{operator}.{}", port.name)), payload);
        loops.push((feedback, Edge { stream: names.stream(&edge.stream), ..*edge }));
        return Ok(feedback.into());
    }
    let name = names.stream(&edge.stream);
    let stream = befallen.get(&name).filter(|_| !edge.raw).copied();
    let stream = stream.or_else(|| graph.stream(&name));
    Ok(stream.with_context(|| format!("operator.{operator}: there is no stream `{}`", edge.stream))?.into())
}
