//! Wiring by name: untyped handles, and operators whose ports are connected one by one.

use super::{BodySpec, FeedbackSpec, Graph, OperatorRef};
use crate::any::AnyOperator;
use crate::error::GraphError;
use crate::input::{PortSpec, Ports, Show};
use crate::ladder::{Ladder, OnLadder};
use crate::operator::{Operator, Typed, on_deadline};
use crate::output::{Declaration, Outputs as _};
use crate::payload::{Payload, PayloadType};
use crate::port::{NamedInputs, NamedOutputs, OutputInfo, PortInfo, PortMode, Wire};
use crate::stream::{AnyFeedback, AnyStream, Edge};

impl Graph {
    /// Adds an operator whose ports have names. `wire` returns the source of each input port, and may add to the graph
    /// what the source requires.
    ///
    /// The streams are named after the output ports, `operator.port`, or `operator` if there is only one.
    ///
    /// # Errors
    /// Errors of `wire`; [`GraphError::Wire`] if the returned source does not fit the port, and
    /// [`GraphError::ForeignHandle`] if it belongs to another graph.
    pub fn add_wired<O, E>(
        &mut self,
        name: impl Into<String>,
        operator: O,
        mut wire: impl FnMut(&mut Self, &PortInfo) -> Result<Wire, E>,
    ) -> Result<OperatorRef<'_, O::Out>, E>
    where
        O: Operator<In: NamedInputs, Out: NamedOutputs>,
        E: From<GraphError>,
    {
        let name = name.into();
        let (layout, ports) = self.wired::<O::In, E>(&name, &mut wire)?;
        let body = Box::new(Typed::new(operator, layout));
        Ok(self.push(name, ports.specs, BodySpec::Operator(body, on_deadline::<O>)))
    }

    /// As [`add_wired`](Self::add_wired), for an operator on a ladder, whose reports are its last stream. Its run-time
    /// model is [`RuntimeModel::LADDER`](crate::RuntimeModel::LADDER), if its rungs set the run time.
    ///
    /// # Errors
    /// As for [`add_wired`](Self::add_wired).
    pub fn add_ladder<O, T, E>(
        &mut self,
        name: &str,
        ladder: Ladder<O, T>,
        mut wire: impl FnMut(&mut Self, &PortInfo) -> Result<Wire, E>,
    ) -> Result<OperatorRef<'_, ()>, E>
    where
        O: Operator<In: NamedInputs, Out: NamedOutputs>,
        T: Payload,
        E: From<GraphError>,
    {
        let (layout, ports) = self.wired::<O::In, E>(name, &mut wire)?;
        let index = self.operators.len();
        let mut declared = Declaration { first: self.streams.len(), types: Vec::new() };
        O::Out::declare(&mut declared);
        for (stream, port) in declared.types.iter_mut().zip(O::Out::ports()) {
            stream.port = Some(port.name);
        }
        let body = Box::new(OnLadder::new(ladder, layout, &mut declared));
        self.push_declared(name.into(), ports.specs, BodySpec::Operator(body, on_deadline::<O>), declared);
        Ok(OperatorRef { graph: self, index, streams: () })
    }

    /// Declares the ports of `I` with their sources.
    fn wired<I: NamedInputs, E: From<GraphError>>(
        &mut self,
        operator: &str,
        wire: &mut impl FnMut(&mut Self, &PortInfo) -> Result<Wire, E>,
    ) -> Result<(I::Layout, Ports), E> {
        let (mut wires, mut ports) = (Vec::new(), Ports::default());
        for port in I::ports() {
            let wire = wire(self, &port)?;
            self.declare(operator, &port, &wire, &mut ports)?;
            wires.push(wire);
        }
        Ok((I::layout(&wires), ports))
    }

    /// As [`add_wired`](Self::add_wired), for an operator whose ports are declared at run time.
    ///
    /// # Errors
    /// As for [`add_wired`](Self::add_wired).
    pub fn add_any_wired<E: From<GraphError>>(
        &mut self,
        name: &str,
        operator: impl AnyOperator,
        (inputs, outputs): (&[PortInfo], &[OutputInfo]),
        mut wire: impl FnMut(&mut Self, &PortInfo) -> Result<Wire, E>,
    ) -> Result<Vec<AnyStream>, E> {
        let mut ports = Ports::default();
        for port in inputs {
            let wire = wire(self, port)?;
            self.declare(name, port, &wire, &mut ports)?;
        }
        let outputs: Vec<_> = outputs.iter().map(|output| (&*output.name, output.payload)).collect();
        Ok(self.push_any(name, ports.specs, operator, &outputs))
    }

    /// Declares the source of one port of `operator`.
    fn declare(
        &self,
        operator: &str,
        port: &PortInfo,
        wire: &Wire,
        ports: &mut Ports,
    ) -> Result<(), GraphError> {
        let latest = |edge| match port.mode {
            PortMode::Window(depth) => PortSpec::Latest { edge, depth, show: Show::Window },
            _ => PortSpec::Latest { edge, depth: 1, show: Show::Newest },
        };
        let spec = match wire {
            Wire::Stream(stream) => match (self.owns_stream(*stream), port.mode) {
                (false, _) => return Err(GraphError::ForeignHandle { operator: operator.into() }),
                (true, PortMode::At) => Some(PortSpec::At(stream.id)),
                (true, _) => Some(latest(Edge::Stream(stream.id))),
            },
            Wire::Feedback(edge) if self.owns_feedback(*edge) => Some(latest(Edge::Feedback(edge.id))),
            Wire::Feedback(_) => return Err(GraphError::ForeignHandle { operator: operator.into() }),
            Wire::Timer(timer) => Some(PortSpec::Timer(*timer)),
            Wire::Many(_) | Wire::None => None,
        };
        let fits = match wire {
            Wire::Stream(stream) => port.payload == Some(stream.payload),
            Wire::Feedback(edge) => port.payload == Some(edge.payload) && port.mode.reads_feedback(),
            Wire::Timer(_) => port.mode == PortMode::Every,
            Wire::Many(_) => port.many,
            Wire::None => port.many || port.optional,
        };
        if !fits {
            let (operator, name) = (operator.into(), port.name.clone().into_owned());
            let (expected, found) = (expected(port), self.found(wire));
            return Err(GraphError::Wire { operator, port: name, expected, found });
        }
        ports.specs.extend(spec);
        if let Wire::Many(wires) = wire {
            wires.iter().try_for_each(|wire| self.declare(operator, port, wire, ports))?;
        }
        Ok(())
    }

    /// Describes `wire`, for an error.
    fn found(&self, wire: &Wire) -> String {
        match wire {
            Wire::Stream(stream) => {
                format!("stream `{}` of `{}`", self.streams[stream.id].name, stream.payload)
            }
            Wire::Feedback(edge) => {
                format!("feedback edge `{}` of `{}`", self.feedbacks[edge.id].name, edge.payload)
            }
            Wire::Timer(_) => "a timer".into(),
            Wire::Many(_) => "a list".into(),
            Wire::None => "nothing".into(),
        }
    }

    fn owns_stream(&self, stream: AnyStream) -> bool {
        self.streams.get(stream.id).is_some_and(|own| own.payload == stream.payload)
    }

    fn owns_feedback(&self, edge: AnyFeedback) -> bool {
        self.feedbacks.get(edge.id).is_some_and(|own| own.payload == edge.payload)
    }

    /// Streams with their names, in the order in which their operators were added.
    pub fn streams(&self) -> impl Iterator<Item = (&str, AnyStream)> {
        let streams = self.streams.iter().enumerate();
        streams.map(|(id, spec)| (&*spec.name, AnyStream { id, payload: spec.payload }))
    }

    /// Returns the stream of this name.
    pub fn stream(&self, name: &str) -> Option<AnyStream> {
        self.streams().find(|(own, _)| *own == name).map(|(_, stream)| stream)
    }

    /// Streams of an operator, in the order of its output ports.
    ///
    /// # Errors
    /// If there is no operator of this name.
    pub fn streams_of(&self, operator: &str) -> Result<Vec<AnyStream>, GraphError> {
        let operator = &self.operators[self.index_of(operator)?];
        let any = |id: &usize| AnyStream { id: *id, payload: self.streams[*id].payload };
        Ok(operator.streams.iter().map(any).collect())
    }

    /// As [`feedback`](Self::feedback), for a type that is known at run time only.
    pub fn feedback_any(&mut self, name: impl Into<String>, payload: PayloadType) -> AnyFeedback {
        self.feedbacks.push(FeedbackSpec { name: name.into(), payload, stream: None });
        AnyFeedback { id: self.feedbacks.len() - 1, payload }
    }

    /// Connects a feedback edge to its stream.
    ///
    /// # Errors
    /// If the stream has another type, the edge is already connected, or one of them belongs to another graph.
    pub fn connect_any(&mut self, feedback: AnyFeedback, stream: AnyStream) -> Result<(), GraphError> {
        if !self.owns_stream(stream) || !self.owns_feedback(feedback) {
            return Err(GraphError::ForeignHandle { operator: "feedback".into() });
        }
        let found = self.found(&Wire::Stream(stream));
        let edge = &mut self.feedbacks[feedback.id];
        if edge.payload != stream.payload {
            let (feedback, expected) = (edge.name.clone(), edge.payload.name());
            return Err(GraphError::FeedbackType { feedback, expected, found });
        }
        if edge.stream.is_some() {
            return Err(GraphError::FeedbackTwice { feedback: edge.name.clone() });
        }
        edge.stream = Some(stream.id);
        Ok(())
    }
}

/// Describes the sources that `port` accepts, for an error.
fn expected(port: &PortInfo) -> String {
    let one = match &port.payload {
        None => "a timer".to_owned(),
        Some(payload) if port.mode.reads_feedback() => {
            format!("a stream or feedback edge of `{payload}`")
        }
        Some(payload) => format!("a stream of `{payload}`"),
    };
    if port.many { format!("any number of {one}") } else { one }
}
