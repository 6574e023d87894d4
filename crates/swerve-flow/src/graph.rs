//! The graph: operators, the streams between them, and how long, how often and on what they run.

mod check;
mod describe;
mod wire;

use core::fmt;
use core::marker::PhantomData;
use std::sync::Arc;

use swerve_core::{Span, Time};

pub use check::GraphError;
pub(crate) use check::ranks;
pub use describe::{GraphInfo, InputInfo, InputKind, OperatorInfo};
pub use wire::{AnyFeedback, AnyStream};

use crate::deadline::{Deadline, Length};
use crate::input::{Connect, Edge, PortSpec, Ports};
use crate::operator::{Body, OnDeadline, Operator, Typed, on_deadline};
use crate::output::{Declaration, Declared, Outputs};
use crate::payload::{Decode, FromWire, Payload, PayloadType};
use crate::playback::PlaybackRecord;
use crate::policy::Policy;
use crate::remote::{Remote, RemoteExecutor, Worker, WorkerOperator};
use crate::runtime::RuntimeModel;
use crate::wall::{Inbox, SourceHandle, StopHandle};

/// A stream of messages of type `T`, to be connected to any number of readers.
pub struct Stream<T> {
    pub(crate) id: usize,
    payload: PhantomData<fn() -> T>,
}

/// An edge that closes a loop: read by [`Latest`](crate::Latest) or [`Window`](crate::Window), shows what
/// was visible strictly before the present instant. Connected to its stream by [`Graph::connect`].
pub struct Feedback<T> {
    pub(crate) id: usize,
    payload: PhantomData<fn() -> T>,
}

macro_rules! handle {
    ($handle:ident) => {
        impl<T> $handle<T> {
            pub(crate) const fn new(id: usize) -> Self {
                Self { id, payload: PhantomData }
            }
        }
        impl<T> Copy for $handle<T> {}
        impl<T> Clone for $handle<T> {
            fn clone(&self) -> Self {
                *self
            }
        }
        impl<T> PartialEq for $handle<T> {
            fn eq(&self, other: &Self) -> bool {
                self.id == other.id
            }
        }
        impl<T> Eq for $handle<T> {}
        impl<T> fmt::Debug for $handle<T> {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, concat!(stringify!($handle), "({})"), self.id)
            }
        }
    };
}

handle!(Stream);
handle!(Feedback);

/// A resource that steps of several operators share, such as a GPU: at most `slots` of them at once.
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
    /// The operators that are fed from outside.
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
    /// When steps that are played back held slots of the resource.
    pub(crate) held: Vec<(Time, Time)>,
    pub(crate) body: BodySpec,
    /// Bodies in their first state, for steps before which the operator was restarted in the run that is repeated.
    pub(crate) spares: Vec<Box<dyn Body>>,
}

pub(crate) enum BodySpec {
    Operator(Box<dyn Body>, OnDeadline),
    /// Publishes what others report: a source outside, or the records of an earlier run.
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
    /// An empty graph.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds an operator that reads `inputs`: a stream, feedback edge or timer per input port.
    ///
    /// By default it takes no run time, skips to the latest frame and has no deadline; the returned
    /// builder changes that, and its [`out`](OperatorRef::out) gives the streams.
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

    /// The names of the operators that are fed from outside.
    pub fn sources(&self) -> impl Iterator<Item = &str> {
        self.sources.iter().map(|source| &*self.operators[*source].name)
    }

    /// Ends a wall-clock run of this graph from another thread.
    pub fn stop_handle(&self) -> StopHandle {
        StopHandle(self.inbox.clone())
    }

    /// Adds an operator that publishes `records` on one stream: a part of an earlier run, or a script.
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

    /// Adds an operator whose types are known at run time only; gives the first of its streams.
    pub(crate) fn push_body(
        &mut self,
        name: &str,
        ports: Vec<PortSpec>,
        body: Box<dyn Body>,
        types: &[PayloadType],
    ) -> usize {
        let first = self.streams.len();
        let types = types.iter().map(|payload| Declared { port: None, payload: *payload }).collect();
        // Nothing is offered without a type, so a reaction of its own has nothing to choose from.
        let body = BodySpec::Operator(body, |_, _| {});
        self.push_declared(name.into(), ports, body, Declaration { first, types });
        first
    }

    /// Gives an operator that has steps another body.
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

    /// A feedback edge, to be given to its reader now and connected to its stream later.
    pub fn feedback<T: Payload>(&mut self, name: impl Into<String>) -> Feedback<T> {
        Feedback::new(self.feedback_any(name, PayloadType::of::<T>()).id)
    }

    /// Connects a feedback edge to the stream that it shows; the check of the graph says if that was wrong.
    pub fn connect<T: Payload>(&mut self, feedback: Feedback<T>, stream: Stream<T>) {
        let connected = self.connect_any(feedback.into(), stream.into());
        self.problems.extend(connected.err());
    }

    /// A resource with this many slots.
    pub fn resource(&mut self, name: impl Into<String>, slots: usize) -> Resource {
        self.resources.push(ResourceSpec { name: name.into(), slots });
        Resource { id: self.resources.len() - 1 }
    }

    /// The builder of an operator by its name, to change what it was added with.
    pub fn operator(&mut self, name: &str) -> Result<OperatorRef<'_, ()>, GraphError> {
        let index = self.index_of(name)?;
        Ok(OperatorRef { graph: self, index, streams: () })
    }

    /// Replaces an operator by what it published in an earlier run: its step never runs, its inputs are not read.
    ///
    /// # Errors
    /// When there is no operator of that name, or a record names a port that it does not have or holds a
    /// payload of another type.
    pub fn playback(&mut self, name: &str, mut records: Vec<PlaybackRecord>) -> Result<(), GraphError> {
        let index = self.index_of(name)?;
        let operator = &self.operators[index];
        for record in &mut records {
            let stream = operator.streams.get(record.port).map(|stream| &self.streams[*stream]);
            let Some(stream) = stream else {
                return Err(GraphError::PlaybackPort { operator: name.into(), port: record.port });
            };
            record.take_in(stream).map_err(|(at, reason)| GraphError::PlaybackPayload {
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

    /// Tells when the steps of an operator that is played back held the slots of its resource (start, end), so
    /// that others wait for them as they did.
    ///
    /// # Errors
    /// When there is no operator of that name.
    pub fn playback_steps(&mut self, name: &str, mut steps: Vec<(Time, Time)>) -> Result<(), GraphError> {
        let index = self.index_of(name)?;
        steps.retain(|(start, end)| start < end);
        steps.sort_unstable();
        self.operators[index].held = steps;
        Ok(())
    }

    /// The operators of these names, to be stepped by hand: what another process does for a graph that has the
    /// same ones [`remote`](OperatorRef::remote).
    ///
    /// # Errors
    /// When there is no operator of a name, or it is none that has steps.
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

    /// Takes the operators of `other`, the same graph built once more, as what operators start from that began
    /// restarted in the run to be repeated ([`Decision::Restarted`](crate::Decision::Restarted)); one graph for each time.
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

    /// Checks the graph whole, as a run does before its first step.
    ///
    /// # Errors
    /// The first error found, naming the operators.
    pub fn check(&self) -> Result<(), GraphError> {
        ranks(self).map(|_| ())
    }

    /// What the graph consists of.
    ///
    /// # Errors
    /// As [`check`](Self::check): a faulty graph has no ranks.
    pub fn describe(&self) -> Result<GraphInfo, GraphError> {
        Ok(describe::describe(self, &ranks(self)?))
    }

    /// The stream that an edge shows.
    pub(crate) fn stream_of(&self, edge: Edge) -> Option<usize> {
        match edge {
            Edge::Stream(id) => Some(id),
            Edge::Feedback(id) => self.feedbacks.get(id).and_then(|edge| edge.stream),
        }
    }

    /// The operators that have to take their turn before `operator`, in the order of its ports.
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

    /// How long its steps take; no time by default.
    #[must_use]
    pub fn runtime(self, model: RuntimeModel) -> Self {
        self.with(|operator| operator.runtime = model)
    }

    /// What happens to frames that find it busy; the latest is next by default.
    #[must_use]
    pub fn policy(self, policy: Policy) -> Self {
        self.with(|operator| operator.policy = policy)
    }

    /// Until when its stamps have to be answered; no limit by default.
    #[must_use]
    pub fn deadline(self, deadline: Deadline) -> Self {
        self.with(|operator| operator.deadline = Some(deadline))
    }

    /// Its steps need a slot of `resource`.
    #[must_use]
    pub fn uses(self, resource: Resource) -> Self {
        self.with(|operator| operator.uses = Some(resource.id))
    }

    /// It is a sensor: its messages derive from their own stamp.
    #[must_use]
    pub fn origin(self) -> Self {
        self.with(|operator| operator.origin = true)
    }

    /// Its steps take long on this host (30 microseconds and more): worth a worker thread.
    #[must_use]
    pub fn heavy(self) -> Self {
        self.with(|operator| operator.heavy = true)
    }

    /// Its steps are taken by another process that has built the same graph; counts as
    /// [`heavy`](Self::heavy). Its own state here stays as it is.
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

    /// Its messages reach their readers this much after publication.
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

    /// The streams that it publishes.
    pub fn out(self) -> Out::Streams {
        self.streams
    }
}

/// The newest instant of a stamp list, for lists of what a step read.
pub(crate) fn newest(a: Option<Time>, b: Option<Time>) -> Option<Time> {
    a.max(b)
}
