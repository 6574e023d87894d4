//! Ports whose types are known at run time only: operators written in another language.

use std::sync::Arc;

use swerve_core::Digest;
use thiserror::Error;

use crate::error::GraphError;
use crate::graph::Graph;
use crate::input::{PortSpec, Show, Slot, Timer};
use crate::message::{Header, Msg};
use crate::operator::{Body, Context};
use crate::payload::{ErasedPayload, Payload, PayloadType};
use crate::sent::{Outs, Sent};
use crate::stream::{AnyStream, Edge};

/// One input of an operator whose types are known at run time only.
#[derive(Clone, Copy, Debug)]
pub enum AnySource {
    /// The message of the frame's stamp: [`At`](crate::At).
    At(AnyStream),
    /// The newest message: [`Latest`](crate::Latest).
    Latest(AnyStream),
    /// The newest messages, up to this number: [`Window`](crate::Window).
    Window(AnyStream, usize),
    /// A timer: [`Every`](crate::Every).
    Every(Timer),
}

/// A message with its type erased.
#[derive(Clone, Debug)]
pub struct AnyMessage {
    /// Stamp, visibility and origin.
    pub header: Header,
    /// Payload of the message.
    pub payload: Arc<dyn ErasedPayload>,
}

impl AnyMessage {
    /// The payload, if it is of this type.
    pub fn downcast_ref<T: Payload>(&self) -> Option<&T> {
        self.payload.as_any().downcast_ref()
    }
}

/// Contents of one port for one step.
#[derive(Clone, Debug)]
pub enum AnyInput {
    /// Neither a message nor a tick.
    Nothing,
    /// A tick of the timer.
    Tick,
    /// The message.
    Message(AnyMessage),
    /// The messages, oldest first.
    Window(Vec<AnyMessage>),
}

/// An operator whose ports are declared at run time.
pub trait AnyOperator: Send + 'static {
    /// Answers one frame; `inputs` are in the order of the ports.
    fn step(&mut self, cx: &mut Context<'_>, inputs: Vec<AnyInput>, out: &mut AnyOutputs<'_>);
}

/// Outputs of an [`AnyOperator`].
pub struct AnyOutputs<'a> {
    types: &'a [PayloadType],
    outs: &'a mut Outs,
}

/// Reason why a message was not published.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum AnyOutputError {
    /// The output does not exist.
    #[error("there is no output {0}")]
    Port(usize),
    /// The bytes do not decode to a message of the output's type.
    #[error("this is no {expected}: {why}")]
    Payload {
        /// Name of the output's type.
        expected: String,
        /// Decoding error.
        why: String,
    },
}

impl AnyOutputs<'_> {
    /// Publishes a message. Of several messages sent on a port in one step, the last one is published.
    ///
    /// # Errors
    /// If the output does not exist, or is of another type.
    pub fn send<T: Payload>(&mut self, port: usize, payload: T) -> Result<(), AnyOutputError> {
        let (own, found) = (self.types.get(port).ok_or(AnyOutputError::Port(port))?, PayloadType::of::<T>());
        if *own != found {
            let why = format!("it is a {}", found.name());
            return Err(AnyOutputError::Payload { expected: own.name(), why });
        }
        self.outs.set(port, Sent::new(Arc::new(payload)));
        Ok(())
    }

    /// Types of the outputs, in order.
    pub fn types(&self) -> &[PayloadType] {
        self.types
    }

    /// Publishes a message from its CBOR form. Of several messages sent on a port in one step, the last one is
    /// published.
    ///
    /// # Errors
    /// If the output does not exist, or the bytes do not decode to a message of its type.
    pub fn send_cbor(&mut self, port: usize, cbor: &[u8]) -> Result<Digest, AnyOutputError> {
        let payload = self.types.get(port).ok_or(AnyOutputError::Port(port))?;
        let made = (payload.decode)(cbor)
            .map_err(|why| AnyOutputError::Payload { expected: payload.name(), why })?;
        let digest = made.digest;
        self.outs.set(port, made.into());
        Ok(digest)
    }
}

/// Adapter from an [`AnyOperator`] to a [`Body`].
struct AnyBody<O> {
    operator: O,
    types: Vec<PayloadType>,
}

impl<O: AnyOperator> Body for AnyBody<O> {
    fn step(&mut self, cx: &mut Context<'_>, slots: &mut [Slot], outs: &mut Outs) {
        let message = |Msg { header, sent }: Msg| AnyMessage { header, payload: sent.into_made().payload };
        let input = |slot: &mut Slot| match core::mem::take(slot) {
            Slot::Empty => AnyInput::Nothing,
            Slot::Tick => AnyInput::Tick,
            Slot::Message(one) => AnyInput::Message(message(one)),
            Slot::Window(all) => AnyInput::Window(all.into_iter().map(message).collect()),
        };
        let inputs = slots.iter_mut().map(input).collect();
        self.operator.step(cx, inputs, &mut AnyOutputs { types: &self.types, outs });
    }
}

impl Graph {
    /// Types of an operator's output streams, in the order of its outputs.
    ///
    /// # Errors
    /// If there is no operator of this name.
    pub fn output_types(&self, operator: &str) -> Result<Vec<PayloadType>, GraphError> {
        let streams = &self.operators[self.index_of(operator)?].streams;
        Ok(streams.iter().map(|id| self.streams[*id].payload).collect())
    }

    /// Adds an operator whose ports are declared at run time. Returns its streams, named `name.output` as by
    /// [`outputs`](crate::OperatorRef::outputs) (a single one: `name`).
    pub fn add_any(
        &mut self,
        name: &str,
        operator: impl AnyOperator,
        inputs: &[AnySource],
        outputs: &[(&str, PayloadType)],
    ) -> Vec<AnyStream> {
        let ports = inputs.iter().map(|input| match *input {
            AnySource::At(stream) => PortSpec::At(stream.id),
            AnySource::Latest(stream) => {
                PortSpec::Latest { edge: Edge::Stream(stream.id), depth: 1, show: Show::Newest }
            }
            AnySource::Window(stream, depth) => {
                PortSpec::Latest { edge: Edge::Stream(stream.id), depth, show: Show::Window }
            }
            AnySource::Every(timer) => PortSpec::Timer(timer),
        });
        self.push_any(name, ports.collect(), operator, outputs)
    }

    /// Adds an operator whose ports have already been declared.
    pub(crate) fn push_any(
        &mut self,
        name: &str,
        ports: Vec<PortSpec>,
        operator: impl AnyOperator,
        outputs: &[(&str, PayloadType)],
    ) -> Vec<AnyStream> {
        let types: Vec<_> = outputs.iter().map(|(_, payload)| *payload).collect();
        let body = Box::new(AnyBody { operator, types: types.clone() });
        let first = self.push_body(name, ports, body, &types);
        for (i, (output, _)) in outputs.iter().enumerate().filter(|_| outputs.len() > 1) {
            self.streams[first + i].name = format!("{name}.{output}").into();
        }
        types.into_iter().enumerate().map(|(i, payload)| AnyStream { id: first + i, payload }).collect()
    }

    /// Replaces an operator by another one with the same inputs and outputs.
    ///
    /// # Errors
    /// If there is no operator of this name, or it has no steps.
    pub fn replace(&mut self, name: &str, operator: impl AnyOperator) -> Result<(), GraphError> {
        let types = self.output_types(name)?;
        self.set_body(name, Box::new(AnyBody { operator, types }))
    }
}
