//! The graph: operators, the streams between them, their run times, policies and resources.

mod check;
mod describe;
mod wire;

use std::sync::Arc;

use swerve_core::{Span, Time};

pub(crate) use check::ranks;
pub use describe::{GraphInfo, InputInfo, InputKind, OperatorInfo};

use crate::deadline::{Deadline, Length};
use crate::error::GraphError;
use crate::inbox::{Inbox, SourceHandle, StopHandle};
use crate::input::{Connect, PortSpec, Ports, Show, Timer};
use crate::operator::{Body, OnDeadline, Operator, Typed, on_deadline};
use crate::output::{Declaration, Declared, Outputs};
use crate::payload::{Decode, FromWire, Payload, PayloadType};
use crate::playback::PlaybackRecord;
use crate::policy::Policy;
use crate::remote::{Remote, RemoteExecutor, Worker, WorkerOperator};
use crate::runtime::RuntimeModel;
use crate::stream::{Edge, Feedback, Stream};

/// A resource shared by steps of several operators, such as a GPU: used by at most `slots` steps at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resource {
    pub(crate) id: usize,
}

/// A dataflow graph, to be built, checked, described and run once.
#[derive(Default)]
pub struct Graph {
    pub(crate) operators: Vec<OperatorSpec>,
    pub(crate) streams: Vec<StreamSpec>,
    pub(crate) feedbacks: Vec<FeedbackSpec>,
    pub(crate) resources: Vec<ResourceSpec>,
    pub(crate) inbox: Arc<Inbox>,
    /// Operators that are fed from outside.
    pub(crate) sources: Vec<usize>,
    pub(crate) problems: Vec<GraphError>,
}

pub(crate) struct OperatorSpec {
    pub(crate) name: Arc<str>,
    pub(crate) ports: Vec<PortSpec>,
    pub(crate) streams: Vec<usize>,
    pub(crate) runtime: RuntimeModel,
    pub(crate) policy: Policy,
    pub(crate) deadline: Option<Deadline>,
    pub(crate) uses: Option<usize>,
    pub(crate) origin: bool,
    pub(crate) heavy: bool,
    pub(crate) delay: Span,
    /// Intervals in which steps that are played back held slots of the resource.
    pub(crate) held: Vec<(Time, Time)>,
    pub(crate) body: BodySpec,
    /// Bodies in their initial state, for steps before which the operator was restarted in the run that is repeated.
    pub(crate) spares: Vec<Box<dyn Body>>,
}

pub(crate) enum BodySpec {
    Operator(Box<dyn Body>, OnDeadline),
    /// Publishes external reports: an outside source, or the records of an earlier run.
    Feed(Vec<PlaybackRecord>),
}

pub(crate) struct StreamSpec {
    pub(crate) name: Arc<str>,
    pub(crate) payload: PayloadType,
    pub(crate) decode: Decode,
    pub(crate) from_wire: FromWire,
    pub(crate) producer: usize,
}

pub(crate) struct FeedbackSpec {
    pub(crate) name: String,
    pub(crate) payload: PayloadType,
    pub(crate) stream: Option<usize>,
}

pub(crate) struct ResourceSpec {
    pub(crate) name: String,
    pub(crate) slots: usize,
}

impl Graph {
    /// Creates an empty graph.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds an operator that reads `inputs`: a stream, feedback edge or timer per input port.
    ///
    /// By default it takes no run time, skips to the latest frame and has no deadline; the returned builder changes
    /// these properties, and its [`out`](OperatorRef::out) returns the streams.
    pub fn add<O: Operator>(
        &mut self,
        name: impl Into<String>,
        operator: O,
        inputs: impl Connect<O::In>,
    ) -> OperatorRef<'_, O::Out> {
        let mut ports = Ports::default();
        let layout = inputs.connect(&mut ports);
        let body = BodySpec::Operator(Box::new(Typed::new(operator, layout)), on_deadline::<O>);
        self.push(name.into(), ports.specs, body)
    }

    /// Adds a source that is fed from outside, under wall clock, through the returned handle.
    pub fn source<T: Payload>(&mut self, name: impl Into<String>) -> (Stream<T>, SourceHandle<T>) {
        self.sources.push(self.operators.len());
        let handle = SourceHandle::new(self.inbox.clone(), self.operators.len());
        let stream =
            self.push::<crate::Port<T>>(name.into(), Vec::new(), BodySpec::Feed(Vec::new())).origin().out();
        (stream, handle)
    }

    /// Names of the operators that are fed from outside.
    pub fn sources(&self) -> impl Iterator<Item = &str> {
        self.sources.iter().map(|source| &*self.operators[*source].name)
    }

    /// Returns a handle that ends a wall-clock run of this graph from another thread.
    pub fn stop_handle(&self) -> StopHandle {
        StopHandle(self.inbox.clone())
    }

    /// Adds an operator that publishes `records` on one stream: part of an earlier run, or a script.
    pub fn script<T: Payload>(&mut self, name: impl Into<String>, records: Vec<PlaybackRecord>) -> Stream<T> {
        self.push::<crate::Port<T>>(name.into(), Vec::new(), BodySpec::Feed(records)).out()
    }

    fn push<Out: Outputs>(
        &mut self,
        name: String,
        ports: Vec<PortSpec>,
        body: BodySpec,
    ) -> OperatorRef<'_, Out> {
        let name: Arc<str> = name.into();
        let index = self.operators.len();
        let mut declared = Declaration { first: self.streams.len(), types: Vec::new() };
        let streams = Out::declare(&mut declared);
        self.push_declared(name, ports, body, declared);
        OperatorRef { graph: self, index, streams }
    }

    /// Adds an operator whose types are known at run time only; returns the index of its first stream.
    pub(crate) fn push_body(
        &mut self,
        name: &str,
        ports: Vec<PortSpec>,
        body: Box<dyn Body>,
        types: &[PayloadType],
    ) -> usize {
        let first = self.streams.len();
        let types = types.iter().map(|payload| Declared { port: None, payload: *payload }).collect();
        // Without types nothing is offered, so an operator-specific reaction has nothing to choose from.
        let body = BodySpec::Operator(body, |_, _| {});
        self.push_declared(name.into(), ports, body, Declaration { first, types });
        first
    }

    /// Replaces the body of an operator that has steps.
    pub(crate) fn set_body(&mut self, name: &str, new: Box<dyn Body>) -> Result<(), GraphError> {
        let index = self.index_of(name)?;
        match &mut self.operators[index].body {
            BodySpec::Operator(body, _) => *body = new,
            BodySpec::Feed(_) => return Err(GraphError::UnknownOperator { operator: name.into() }),
        }
        Ok(())
    }

    fn push_declared(&mut self, name: Arc<str>, ports: Vec<PortSpec>, body: BodySpec, declared: Declaration) {
        let index = self.operators.len();
        let n = declared.types.len();
        for (i, Declared { port, payload }) in declared.types.into_iter().enumerate() {
            let PayloadType { decode, from_wire, .. } = payload;
            let name = match port {
                _ if n == 1 => name.clone(),
                Some(port) => format!("{name}.{port}").into(),
                None => format!("{name}.{i}").into(),
            };
            self.streams.push(StreamSpec { name, payload, decode, from_wire, producer: index });
        }
        self.operators.push(OperatorSpec {
            name,
            ports,
            streams: (declared.first..declared.first + n).collect(),
            runtime: RuntimeModel::Zero,
            policy: Policy::SkipToLatest,
            deadline: None,
            uses: None,
            origin: false,
            heavy: false,
            delay: Span::ZERO,
            held: Vec::new(),
            body,
            spares: Vec::new(),
        });
    }

    /// Creates a feedback edge, to be passed to its reader now and connected to its stream later.
    pub fn feedback<T: Payload>(&mut self, name: impl Into<String>) -> Feedback<T> {
        Feedback::new(self.feedback_any(name, PayloadType::of::<T>()).id)
    }

    /// Connects a feedback edge to its stream; the check of the graph reports errors.
    pub fn connect<T: Payload>(&mut self, feedback: Feedback<T>, stream: Stream<T>) {
        let connected = self.connect_any(feedback.into(), stream.into());
        self.problems.extend(connected.err());
    }

    /// Creates a resource with this many slots.
    pub fn resource(&mut self, name: impl Into<String>, slots: usize) -> Resource {
        self.resources.push(ResourceSpec { name: name.into(), slots });
        Resource { id: self.resources.len() - 1 }
    }

    /// Returns the builder of an existing operator, to change its properties.
    pub fn operator(&mut self, name: &str) -> Result<OperatorRef<'_, ()>, GraphError> {
        let index = self.index_of(name)?;
        Ok(OperatorRef { graph: self, index, streams: () })
    }

    /// Replaces an operator by its publications in an earlier run: its steps are not executed, its inputs are not read.
    ///
    /// # Errors
    /// If there is no operator of this name, or a record names a port that the operator does not have or contains a
    /// payload of another type.
    pub fn playback(&mut self, name: &str, mut records: Vec<PlaybackRecord>) -> Result<(), GraphError> {
        let index = self.index_of(name)?;
        let operator = &self.operators[index];
        for record in &mut records {
            let stream = operator.streams.get(record.port).map(|stream| &self.streams[*stream]);
            let Some(stream) = stream else {
                return Err(GraphError::PlaybackPort { operator: name.into(), port: record.port });
            };
            record.take_in(&stream.payload).map_err(|(at, reason)| GraphError::PlaybackPayload {
                operator: name.into(),
                at,
                reason,
            })?;
        }
        self.sources.retain(|source| *source != index);
        let operator = &mut self.operators[index];
        operator.ports.clear();
        operator.deadline = None;
        operator.heavy = false;
        operator.body = BodySpec::Feed(records);
        Ok(())
    }

    /// Replaces an operator by a source that a [`Session`](crate::Session) feeds, with the same streams: its steps are
    /// not executed, its inputs are not read. It stays an [`origin`](OperatorRef::origin) if it was one.
    ///
    /// # Errors
    /// If there is no operator of this name.
    pub fn feed_outside(&mut self, name: &str) -> Result<(), GraphError> {
        self.playback(name, Vec::new())?;
        self.sources.push(self.index_of(name)?);
        Ok(())
    }

    /// Sets the intervals (start, end) in which the steps of a played-back operator held slots of its resource, so that
    /// other operators wait for them as before.
    ///
    /// # Errors
    /// If there is no operator of this name.
    pub fn playback_steps(&mut self, name: &str, mut steps: Vec<(Time, Time)>) -> Result<(), GraphError> {
        let index = self.index_of(name)?;
        steps.retain(|(start, end)| start < end);
        steps.sort_unstable();
        self.operators[index].held = steps;
        Ok(())
    }

    /// Extracts the operators of these names as a worker, for a process that executes steps for a graph in which they
    /// are [`remote`](OperatorRef::remote).
    ///
    /// # Errors
    /// If there is no operator of a name, or it has no steps.
    pub fn into_worker(mut self, names: &[String]) -> Result<Worker, GraphError> {
        let mut operators = Vec::new();
        for name in names {
            let index = self.index_of(name)?;
            let body = core::mem::replace(&mut self.operators[index].body, BodySpec::Feed(Vec::new()));
            let BodySpec::Operator(body, _) = body else {
                return Err(GraphError::UnknownOperator { operator: name.clone() });
            };
            let operator = &self.operators[index];
            let ports = operator.ports.iter().map(|port| match *port {
                PortSpec::At(id) => Some(id),
                PortSpec::Latest { edge, .. } => self.stream_of(edge),
                PortSpec::Timer(_) => None,
            });
            let ports = ports.map(|id| Some(self.streams.get(id?)?.from_wire)).collect();
            operators.push(WorkerOperator { name: operator.name.clone(), body, ports });
        }
        Ok(Worker { operators })
    }

    /// Adds the operators of `other`, the same graph built once more, as initial states for operators that were
    /// restarted in the run to be repeated ([`Decision::Restarted`](crate::Decision::Restarted)); one graph for each
    /// restart.
    pub fn spare(&mut self, other: Self) {
        for spec in other.operators {
            let own = self.operators.iter_mut().find(|own| own.name == spec.name);
            if let (Some(own), BodySpec::Operator(body, _)) = (own, spec.body) {
                own.spares.push(body);
            }
        }
    }

    pub(crate) fn index_of(&self, name: &str) -> Result<usize, GraphError> {
        self.operators
            .iter()
            .position(|operator| &*operator.name == name)
            .ok_or_else(|| GraphError::UnknownOperator { operator: name.into() })
    }

    /// Checks the whole graph, as a run does before its first step.
    ///
    /// # Errors
    /// The first error found, naming the operators.
    pub fn check(&self) -> Result<(), GraphError> {
        ranks(self).map(|_| ())
    }

    /// Describes the parts of the graph.
    ///
    /// # Errors
    /// As for [`check`](Self::check): a graph with errors has no ranks.
    pub fn describe(&self) -> Result<GraphInfo, GraphError> {
        Ok(describe::describe(self, &ranks(self)?))
    }

    /// Stream that an edge reads.
    pub(crate) fn stream_of(&self, edge: Edge) -> Option<usize> {
        match edge {
            Edge::Stream(id) => Some(id),
            Edge::Feedback(id) => self.feedbacks.get(id).and_then(|edge| edge.stream),
        }
    }

    /// Operators that have to take their turn before `operator`, in the order of its ports.
    pub(crate) fn upstream<'a>(&'a self, operator: &'a OperatorSpec) -> impl Iterator<Item = usize> + 'a {
        let ports = operator.ports.iter().filter_map(|port| match *port {
            PortSpec::At(id) | PortSpec::Latest { edge: Edge::Stream(id), .. } => Some(id),
            PortSpec::Latest { edge: Edge::Feedback(_), .. } | PortSpec::Timer(_) => None,
        });
        let policy = operator.deadline.and_then(|deadline| match deadline.length {
            Length::Policy(Edge::Stream(id), _) => Some(id),
            Length::Policy(Edge::Feedback(_), _) | Length::Static(_) => None,
        });
        ports.chain(policy).filter_map(|id| self.streams.get(id).map(|stream| stream.producer))
    }
}

/// An operator of a graph under construction.
pub struct OperatorRef<'g, Out: Outputs> {
    graph: &'g mut Graph,
    index: usize,
    streams: Out::Streams,
}

impl<Out: Outputs> OperatorRef<'_, Out> {
    fn with(self, change: impl FnOnce(&mut OperatorSpec)) -> Self {
        change(&mut self.graph.operators[self.index]);
        self
    }

    /// Sets the run time of its steps; default: zero.
    #[must_use]
    pub fn runtime(self, model: RuntimeModel) -> Self {
        self.with(|operator| operator.runtime = model)
    }

    /// Sets the handling of frames that arrive while the operator is busy; by default, the latest is started next.
    #[must_use]
    pub fn policy(self, policy: Policy) -> Self {
        self.with(|operator| operator.policy = policy)
    }

    /// Sets the deadline for answering a stamp; default: none.
    #[must_use]
    pub fn deadline(self, deadline: Deadline) -> Self {
        self.with(|operator| operator.deadline = Some(deadline))
    }

    /// Runs its steps at the ticks of a timer instead of at the arrival of frames. A synchronised port then holds the
    /// newest message, unless an earlier step has read it.
    #[must_use]
    pub fn on_timer(self, timer: Timer) -> Self {
        self.with(|operator| {
            for port in &mut operator.ports {
                if let PortSpec::At(id) = *port {
                    *port = PortSpec::Latest { edge: Edge::Stream(id), depth: 1, show: Show::Unread };
                }
            }
            // Behind the ports that its steps read: they do not see the tick.
            operator.ports.push(PortSpec::Timer(timer));
        })
    }

    /// Makes its steps require a slot of `resource`.
    #[must_use]
    pub fn uses(self, resource: Resource) -> Self {
        self.with(|operator| operator.uses = Some(resource.id))
    }

    /// Marks the operator as a sensor: its messages derive from their own stamp.
    #[must_use]
    pub fn origin(self) -> Self {
        self.with(|operator| operator.origin = true)
    }

    /// Marks its steps as slow on this host (30 microseconds and more), so that worker threads can execute them.
    #[must_use]
    pub fn heavy(self) -> Self {
        self.with(|operator| operator.heavy = true)
    }

    /// Executes its steps in another process that has built the same graph; implies [`heavy`](Self::heavy). The
    /// operator's state in this process does not change.
    #[must_use]
    pub fn remote(self, executor: Box<dyn RemoteExecutor>) -> Self {
        let streams = &self.graph.operators[self.index].streams;
        let decoders = streams.iter().map(|id| self.graph.streams[*id].from_wire).collect();
        self.heavy().with(|operator| {
            if let BodySpec::Operator(body, _) = &mut operator.body {
                *body = Box::new(Remote::new(executor, decoders));
            }
        })
    }

    /// Delays the arrival of its messages at readers by `delay` after publication.
    #[must_use]
    pub fn delay(self, delay: Span) -> Self {
        self.with(|operator| operator.delay = delay)
    }

    /// Names its streams `operator.name` instead of `operator.0`, `operator.1`; for several outputs.
    #[must_use]
    pub fn outputs(self, names: &[&str]) -> Self {
        let operator = &self.graph.operators[self.index];
        debug_assert!(names.len() <= operator.streams.len());
        for (stream, output) in operator.streams.iter().zip(names) {
            self.graph.streams[*stream].name = format!("{}.{output}", operator.name).into();
        }
        self
    }

    /// Streams that it publishes.
    pub fn out(self) -> Out::Streams {
        self.streams
    }
}

/// The newer of two instants, for the origins of a step's inputs.
pub(crate) fn newest(a: Option<Time>, b: Option<Time>) -> Option<Time> {
    a.max(b)
}
