//! Where a kind adds its operator to the graph.

use core::any::Any;
use std::collections::BTreeMap;

use anyhow::Context as _;
use swerve_flow::{
    AnyFeedback, AnyOperator, Deadline, Graph, NamedInputs, NamedOutputs, Operator, OperatorRef, OutputInfo,
    Payload, PortInfo, Timer, Wire,
};
use swerve_msg::Route;
use swerve_scenario::Scenario;
use swerve_vehicle::VehicleParams;

use crate::assembly::{Assembly, Placed};
use crate::config::Config;
use crate::config::model::Model;
use crate::config::resolved::Resolved;
use crate::kind::Settings;
use crate::stage::{SharedStage, StreamMemory};

/// What the operators of a drive are built around.
pub struct Surroundings {
    /// The scenario as the seed varies it.
    pub scenario: Scenario,
    /// Where to go and what ground may be used.
    pub route: Route,
    /// The ego vehicle.
    pub vehicle: VehicleParams,
}

/// The graph as it is being assembled, beside what its operators share.
#[derive(Default)]
pub(crate) struct Building {
    pub(crate) graph: Graph,
    /// Of each stream that faults befall, by its name, the stream that its readers get.
    pub(crate) befallen: BTreeMap<String, swerve_flow::AnyStream>,
    /// Of each stream that faults befall, by its name, the last fault.
    pub(crate) last_fault: BTreeMap<String, String>,
    /// Feedback edges and the streams that they show.
    pub(crate) loops: Vec<(AnyFeedback, crate::assembly::Edge)>,
    /// Where the images and point clouds of each stream lie.
    pub(crate) memory: BTreeMap<String, StreamMemory>,
    /// The handles of what is fed from outside, by operator.
    pub(crate) sources: BTreeMap<String, Box<dyn Any + Send>>,
    /// What cameras and lidars share, where there are any.
    pub(crate) stage: Option<SharedStage>,
}

/// The place of one operator in a graph that is being assembled.
pub struct Site<'a> {
    pub(crate) building: &'a mut Building,
    pub(crate) assembly: &'a Assembly,
    pub(crate) placed: &'a Placed,
    pub(crate) config: &'a Config,
    pub(crate) surroundings: &'a Surroundings,
}

impl Site<'_> {
    /// The operator's name.
    pub fn name(&self) -> &str {
        &self.placed.name
    }

    /// What the configuration says of it.
    pub fn settings(&self) -> Settings<'_> {
        self.placed.settings(self.config)
    }

    /// The configuration as it stands for it.
    pub fn config(&self) -> &Config {
        self.settings().config
    }

    /// What its settings come to.
    pub fn resolved(&self) -> &Resolved {
        &self.placed.resolved
    }

    /// Its timer under the periodic model of execution.
    pub(crate) fn own_timer(&self) -> Option<Timer> {
        let settings = self.settings();
        let length = self.placed.length.filter(|_| settings.config.execution.model == Model::Periodic);
        length.map(|length| settings.drawn_timer(length))
    }

    /// The deadline that the model of execution gives it by itself; a policy's is set by the policy, or where its stream
    /// is known.
    pub(crate) fn own_deadline(&self) -> Option<Deadline> {
        let execution = &self.config().execution;
        let length = self.placed.length.filter(|_| execution.model == Model::StaticDeadlines);
        length.map(|length| Deadline::after(length).reaction(execution.reaction))
    }

    /// What it is built around.
    pub fn surroundings(&self) -> &Surroundings {
        self.surroundings
    }

    /// The operator that publishes what one of its ports reads, where that is one.
    pub fn source_of(&self, port: &str) -> Option<&str> {
        let input = self.placed.inputs.iter().find(|input| input.port.name == port)?;
        input.from.first()?.stream.split('.').next()
    }

    /// Adds the operator, its ports connected as the assembly has found. `timer` is that of its
    /// [`Every`](swerve_flow::Every) ports.
    ///
    /// # Errors
    /// A stream that does not fit its port, or a timer that is not there.
    pub fn add<O>(&mut self, operator: O, timer: Option<Timer>) -> anyhow::Result<()>
    where
        O: Operator<In: NamedInputs, Out: NamedOutputs>,
    {
        let Self { building, placed, .. } = self;
        let Building { graph, befallen, loops, .. } = &mut **building;
        let origin = placed.kind.node().origin;
        let node = graph.add_wired(placed.name.clone(), operator, |graph, port| {
            feed(graph, befallen, loops, (placed, port), timer)
        })?;
        if origin {
            let _origin = node.origin();
        }
        Ok(())
    }

    /// The same for an operator whose ports are those that its kind has found in the configuration.
    ///
    /// # Errors
    /// As [`add`](Self::add).
    pub fn add_any(&mut self, operator: impl AnyOperator, timer: Option<Timer>) -> anyhow::Result<()> {
        let Self { building, placed, .. } = self;
        let Building { graph, befallen, loops, .. } = &mut **building;
        let inputs: Vec<PortInfo> = placed.inputs.iter().map(|input| input.port.clone()).collect();
        let outputs: Vec<OutputInfo> = placed.outputs.iter().map(|output| output.port.clone()).collect();
        graph.add_any_wired(&placed.name, operator, (&inputs, &outputs), |graph, port| {
            feed(graph, befallen, loops, (placed, port), timer)
        })?;
        Ok(())
    }

    /// Adds a source that is fed from outside; the pipeline hands its handle out.
    pub fn add_source<T: Payload>(&mut self) {
        let (_, handle) = self.building.graph.source::<T>(self.placed.name.clone());
        self.building.sources.insert(self.placed.name.clone(), Box::new(handle));
    }

    /// The operator in the graph, once it is added.
    ///
    /// # Errors
    /// When it is not.
    pub fn node(&mut self) -> anyhow::Result<OperatorRef<'_, ()>> {
        Ok(self.building.graph.operator(&self.placed.name)?)
    }

    /// The graph so far.
    pub(crate) fn graph(&mut self) -> &mut Graph {
        &mut self.building.graph
    }

    /// Where the big payloads of one of its outputs lie, `arrays` in each message.
    pub(crate) fn memory(&mut self, output: &str, arrays: usize) -> StreamMemory {
        let memory = StreamMemory::new(arrays);
        self.building.memory.insert(format!("{}.{output}", self.placed.name), memory.clone());
        memory
    }

    /// What cameras and lidars share.
    pub(crate) fn stage(&mut self) -> SharedStage {
        self.building.stage.get_or_insert_default().clone()
    }
}

/// What feeds a port, as the assembly has found.
fn feed(
    graph: &mut Graph,
    befallen: &BTreeMap<String, swerve_flow::AnyStream>,
    loops: &mut Vec<(AnyFeedback, crate::assembly::Edge)>,
    (placed, port): (&Placed, &PortInfo),
    timer: Option<Timer>,
) -> anyhow::Result<Wire> {
    if port.payload.is_none() {
        let timer = timer.with_context(|| format!("operator.{}: it has no period", placed.name))?;
        return Ok(Wire::Timer(timer));
    }
    let input = placed.inputs.iter().find(|input| input.port.name == port.name);
    let edges = input.map(|input| &input.from[..]).unwrap_or_default();
    let wires: Result<Vec<Wire>, _> =
        edges.iter().map(|edge| wire(graph, befallen, loops, (&placed.name, port), edge)).collect();
    let mut wires = wires?;
    Ok(match wires.len() {
        _ if port.many => Wire::Many(wires),
        0 => Wire::None,
        _ => wires.remove(0),
    })
}

/// What feeds a port, as its edge says.
fn wire(
    graph: &mut Graph,
    befallen: &BTreeMap<String, swerve_flow::AnyStream>,
    loops: &mut Vec<(AnyFeedback, crate::assembly::Edge)>,
    (operator, port): (&str, &PortInfo),
    edge: &crate::assembly::Edge,
) -> anyhow::Result<Wire> {
    if edge.feedback {
        let payload = port.payload.context("a timer closes no loop")?;
        let feedback = graph.feedback_any(format!("{operator}.{}", port.name), payload);
        loops.push((feedback, edge.clone()));
        return Ok(feedback.into());
    }
    let stream = befallen.get(&edge.stream).filter(|_| !edge.raw).copied();
    let stream = stream.or_else(|| graph.stream(&edge.stream));
    Ok(stream.with_context(|| format!("operator.{operator}: there is no stream `{}`", edge.stream))?.into())
}
