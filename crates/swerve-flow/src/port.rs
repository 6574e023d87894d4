//! Ports as data: the inputs and outputs of an operator by name, for wiring without knowledge of its type.

use std::borrow::Cow;

use crate::input::{At, Every, Inputs, Latest, Timer, Window};
use crate::output::{Declaration, Outputs, Port};
use crate::payload::{Payload, PayloadType};
use crate::stream::{AnyFeedback, AnyStream, Feedback, Stream};

/// Inputs whose ports have names: a struct with `#[derive(Inputs)]`.
pub trait NamedInputs: Inputs {
    /// Ports, in the order of the fields.
    fn ports() -> Vec<PortInfo>;

    #[doc(hidden)]
    fn layout(wires: &[Wire]) -> Self::Layout;
}

/// Outputs whose ports have names: a struct with `#[derive(Outputs)]`; a single [`Port`], named `out`; `()`.
pub trait NamedOutputs: Outputs {
    /// Ports, in the order of the fields.
    fn ports() -> Vec<OutputInfo>;
}

/// An input port of an operator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortInfo {
    /// Name of the field, or the name declared at run time.
    pub name: Cow<'static, str>,
    /// Doc comment of the field, in one line.
    pub doc: &'static str,
    /// Read mode of the port.
    pub mode: PortMode,
    /// Type of the messages; `None` for a timer.
    pub payload: Option<PayloadType>,
    /// True if it accepts any number of streams, including none: a `Vec`.
    pub many: bool,
    /// True if it may stay unconnected: an `Option`.
    pub optional: bool,
    /// True if it closes a loop, unless wired otherwise: `#[port(feedback)]`.
    pub feedback: bool,
    /// True if it reads its stream before faults are injected: `#[port(raw)]`.
    pub raw: bool,
}

/// Read mode of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PortMode {
    /// The message with the frame's stamp: [`At`].
    At,
    /// The newest message: [`Latest`].
    Latest,
    /// The newest messages, up to this number: [`Window`].
    Window(usize),
    /// A timer: [`Every`].
    Every,
}

/// An output port of an operator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputInfo {
    /// Name of the field, or the name declared at run time.
    pub name: Cow<'static, str>,
    /// Doc comment of the field, in one line.
    pub doc: &'static str,
    /// Type of the messages.
    pub payload: PayloadType,
}

/// Source of an input port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Wire {
    /// A stream.
    Stream(AnyStream),
    /// A feedback edge.
    Feedback(AnyFeedback),
    /// A timer, with its period and phase.
    Timer(Timer),
    /// Any number of wires, for a port that accepts several.
    Many(Vec<Wire>),
    /// No source, for a port that may stay unconnected.
    None,
}

impl Wire {
    /// Single wires that it consists of.
    pub(crate) fn each(&self) -> &[Self] {
        match self {
            Self::Many(wires) => wires,
            Self::None => &[],
            wire => core::slice::from_ref(wire),
        }
    }
}

impl From<AnyStream> for Wire {
    fn from(stream: AnyStream) -> Self {
        Self::Stream(stream)
    }
}

impl From<AnyFeedback> for Wire {
    fn from(feedback: AnyFeedback) -> Self {
        Self::Feedback(feedback)
    }
}

impl<T: Payload> From<Stream<T>> for Wire {
    fn from(stream: Stream<T>) -> Self {
        Self::Stream(stream.into())
    }
}

impl<T: Payload> From<Feedback<T>> for Wire {
    fn from(feedback: Feedback<T>) -> Self {
        Self::Feedback(feedback.into())
    }
}

impl From<Timer> for Wire {
    fn from(timer: Timer) -> Self {
        Self::Timer(timer)
    }
}

impl<W: Into<Self>> From<Vec<W>> for Wire {
    fn from(wires: Vec<W>) -> Self {
        Self::Many(wires.into_iter().map(Into::into).collect())
    }
}

impl<W: Into<Self>> From<Option<W>> for Wire {
    fn from(wire: Option<W>) -> Self {
        wire.map_or(Self::None, Into::into)
    }
}

impl PortMode {
    /// True if a feedback edge can be read in this mode.
    pub const fn reads_feedback(self) -> bool {
        matches!(self, Self::Latest | Self::Window(_))
    }
}

/// A field of a struct with `#[derive(Inputs)]`: one port, an `Option` or a `Vec` of it.
pub trait InputPort: Inputs {
    /// Read mode of the port.
    const MODE: PortMode;
    /// True if it accepts any number of streams.
    const MANY: bool = false;
    /// True if it may stay unconnected.
    const OPTIONAL: bool = false;

    /// Type of its messages; `None` for a timer.
    fn payload() -> Option<PayloadType>;

    #[doc(hidden)]
    fn layout(wire: &Wire) -> Self::Layout;
}

/// A field of a struct with `#[derive(Outputs)]`: a [`Port`].
pub trait OutputPort: Outputs {
    /// Type of its messages.
    fn payload() -> PayloadType;

    #[doc(hidden)]
    fn declare_named(streams: &mut Declaration, name: &'static str) -> Self::Streams;
}

impl PortInfo {
    /// Describes the port `P`, neither closing a loop nor raw.
    pub fn new<P: InputPort>(name: &'static str, doc: &'static str) -> Self {
        Self { many: P::MANY, optional: P::OPTIONAL, doc, ..Self::declared(name, P::MODE, P::payload()) }
    }

    /// Describes a port declared at run time: one stream or timer, neither closing a loop nor raw.
    pub fn declared(
        name: impl Into<Cow<'static, str>>,
        mode: PortMode,
        payload: Option<PayloadType>,
    ) -> Self {
        let name = name.into();
        Self { name, doc: "", mode, payload, many: false, optional: false, feedback: false, raw: false }
    }
}

impl OutputInfo {
    /// Describes the port `P`.
    pub fn new<P: OutputPort>(name: &'static str, doc: &'static str) -> Self {
        Self { doc, ..Self::declared(name, P::payload()) }
    }

    /// Describes a port declared at run time.
    pub fn declared(name: impl Into<Cow<'static, str>>, payload: PayloadType) -> Self {
        Self { name: name.into(), doc: "", payload }
    }
}

impl<T: Payload> InputPort for At<T> {
    const MODE: PortMode = PortMode::At;

    fn payload() -> Option<PayloadType> {
        Some(PayloadType::of::<T>())
    }

    fn layout(_: &Wire) {}
}

impl<T: Payload> InputPort for Latest<T> {
    const MODE: PortMode = PortMode::Latest;

    fn payload() -> Option<PayloadType> {
        Some(PayloadType::of::<T>())
    }

    fn layout(_: &Wire) {}
}

impl<T: Payload, const N: usize> InputPort for Window<T, N> {
    const MODE: PortMode = PortMode::Window(N);

    fn payload() -> Option<PayloadType> {
        Some(PayloadType::of::<T>())
    }

    fn layout(_: &Wire) {}
}

impl InputPort for Every {
    const MODE: PortMode = PortMode::Every;

    fn payload() -> Option<PayloadType> {
        None
    }

    fn layout(_: &Wire) {}
}

impl<P: InputPort> InputPort for Vec<P> {
    const MODE: PortMode = P::MODE;
    const MANY: bool = true;

    fn payload() -> Option<PayloadType> {
        P::payload()
    }

    fn layout(wire: &Wire) -> Vec<P::Layout> {
        wire.each().iter().map(P::layout).collect()
    }
}

impl<P: InputPort> InputPort for Option<P> {
    const MODE: PortMode = P::MODE;
    const MANY: bool = P::MANY;
    const OPTIONAL: bool = true;

    fn payload() -> Option<PayloadType> {
        P::payload()
    }

    fn layout(wire: &Wire) -> Option<P::Layout> {
        (*wire != Wire::None).then(|| P::layout(wire))
    }
}

impl<T: Payload> OutputPort for Port<T> {
    fn payload() -> PayloadType {
        PayloadType::of::<T>()
    }

    fn declare_named(streams: &mut Declaration, name: &'static str) -> Stream<T> {
        streams.stream(Some(name))
    }
}

impl<T: Payload> NamedOutputs for Port<T> {
    fn ports() -> Vec<OutputInfo> {
        vec![OutputInfo::new::<Self>("out", "")]
    }
}

impl NamedOutputs for () {
    fn ports() -> Vec<OutputInfo> {
        Vec::new()
    }
}
