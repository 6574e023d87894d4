//! Ports whose types are known at run time only: operators written in another language.

use std::sync::Arc;

use swerve_core::Digest;
use thiserror::Error;

use crate::graph::{AnyStream, Graph, GraphError};
use crate::input::{Edge, PortSpec, Slot, Timer};
use crate::message::{Header, Msg};
use crate::operator::{Body, Context};
use crate::payload::{ErasedPayload, Outs, PayloadType};

/// How an operator of any types reads one input.
#[derive(Clone, Copy, Debug)]
pub enum AnySource {
    /// The message of the frame's stamp: [`At`](crate::At).
    At(AnyStream),
    /// The newest message: [`Latest`](crate::Latest).
    Latest(AnyStream),
    /// The newest so many messages: [`Window`](crate::Window).
    Window(AnyStream, usize),
    /// A timer: [`Every`](crate::Every).
    Every(Timer),
}

/// A message of whatever type.
#[derive(Clone, Debug)]
pub struct AnyMessage {
    /// Stamp, visibility and descent.
    pub header: Header,
    /// What it carries.
    pub payload: Arc<dyn ErasedPayload>,
}

/// What one port holds for one step.
#[derive(Clone, Debug)]
pub enum AnyInput {
    /// No message, or no tick.
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
    /// Answers one frame; `inputs` in the order of the ports.
    fn step(&mut self, cx: &mut Context<'_>, inputs: Vec<AnyInput>, out: &mut AnyOutputs<'_>);
}

/// The outputs of an operator of any types.
pub struct AnyOutputs<'a> {
    types: &'a [PayloadType],
    outs: &'a mut Outs,
}

/// Why a message was not published.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum AnyOutputError {
    /// There is no such output.
    #[error("there is no output {0}")]
    Port(usize),
    /// The bytes are no message of the output's type.
    #[error("this is no {expected}: {why}")]
    Payload {
        /// What it should be.
        expected: String,
        /// What is wrong.
        why: String,
    },
}

impl AnyOutputs<'_> {
    /// The types of the outputs, in order.
    pub fn types(&self) -> &[PayloadType] {
        self.types
    }

    /// Publishes a message from its CBOR form. The last one sent in a step counts.
    ///
    /// # Errors
    /// When there is no such output, or the bytes are no message of its type.
    pub fn send_cbor(&mut self, port: usize, cbor: &[u8]) -> Result<Digest, AnyOutputError> {
        let payload = self.types.get(port).ok_or(AnyOutputError::Port(port))?;
        let sent = (payload.decode)(cbor)
            .map_err(|why| AnyOutputError::Payload { expected: payload.name(), why })?;
        let digest = sent.digest();
        self.outs.set(port, sent);
        Ok(digest)
    }
}

/// Erases the types of an operator that has none.
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
    /// The types of what an operator publishes, in the order of its outputs.
    ///
    /// # Errors
    /// When there is no operator of that name.
    pub fn output_types(&self, operator: &str) -> Result<Vec<PayloadType>, GraphError> {
        let streams = &self.operators[self.index_of(operator)?].streams;
        Ok(streams.iter().map(|id| self.streams[*id].payload).collect())
    }

    /// Adds an operator whose ports are declared at run time; gives its streams, named `name.output` as
    /// [`outputs`](crate::OperatorRef::outputs) does (a single one: `name`).
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
                PortSpec::Latest { edge: Edge::Stream(stream.id), depth: 1, window: false }
            }
            AnySource::Window(stream, depth) => {
                PortSpec::Latest { edge: Edge::Stream(stream.id), depth, window: true }
            }
            AnySource::Every(timer) => PortSpec::Timer(timer),
        });
        self.push_any(name, ports.collect(), operator, outputs)
    }

    /// Adds an operator whose ports are declared already.
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

    /// Has the steps of an operator taken by another one, which reads and publishes the same.
    ///
    /// # Errors
    /// When there is no operator of that name, or it is none that has steps.
    pub fn replace(&mut self, name: &str, operator: impl AnyOperator) -> Result<(), GraphError> {
        let types = self.output_types(name)?;
        self.set_body(name, Box::new(AnyBody { operator, types }))
    }
}
