//! Ports as data: what an operator reads and publishes, by name, for whoever wires it without knowing its type.

use std::borrow::Cow;

use crate::graph::{AnyFeedback, AnyStream, Feedback, Stream};
use crate::input::{At, Every, Inputs, Latest, Timer, Window};
use crate::output::{Declaration, Outputs, Port};
use crate::payload::{Payload, PayloadType};

/// Inputs whose ports have names: a struct with `#[derive(Inputs)]`.
pub trait NamedInputs: Inputs {
    /// The ports, in the order of the fields.
    fn ports() -> Vec<PortInfo>;

    #[doc(hidden)]
    fn layout(wires: &[Wire]) -> Self::Layout;
}

/// Outputs whose ports have names: a struct with `#[derive(Outputs)]`; a single [`Port`], named `out`; `()`.
pub trait NamedOutputs: Outputs {
    /// The ports, in the order of the fields.
    fn ports() -> Vec<OutputInfo>;
}

/// An input port of an operator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortInfo {
    /// The name of the field, or the one that was declared for it at run time.
    pub name: Cow<'static, str>,
    /// The doc comment of the field, in one line.
    pub doc: &'static str,
    /// How it reads.
    pub mode: PortMode,
    /// The type of the messages; none for a timer.
    pub payload: Option<PayloadType>,
    /// Whether it takes any number of streams, none included: a `Vec`.
    pub many: bool,
    /// Whether it may stay unconnected: an `Option`.
    pub optional: bool,
    /// Whether it closes a loop, unless somebody wires it otherwise: `#[port(feedback)]`.
    pub feedback: bool,
    /// Whether it reads its stream before faults are put on it: `#[port(raw)]`.
    pub raw: bool,
}

/// How a port reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PortMode {
    /// The message stamped as the frame: [`At`].
    At,
    /// The newest message: [`Latest`].
    Latest,
    /// The newest so many messages: [`Window`].
    Window(usize),
    /// A timer: [`Every`].
    Every,
}

/// An output port of an operator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputInfo {
    /// The name of the field, or the one that was declared for it at run time.
    pub name: Cow<'static, str>,
    /// The doc comment of the field, in one line.
    pub doc: &'static str,
    /// The type of the messages.
    pub payload: PayloadType,
}

/// What feeds an input port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Wire {
    /// A stream.
    Stream(AnyStream),
    /// A feedback edge.
    Feedback(AnyFeedback),
    /// The period of a timer.
    Timer(Timer),
    /// Any number of wires, for a port that takes as many.
    Many(Vec<Wire>),
    /// Nothing, for a port that may stay unconnected.
    None,
}

impl Wire {
    /// The wires that make it up.
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
    /// Whether a feedback edge may be read in this way.
    pub const fn reads_feedback(self) -> bool {
        matches!(self, Self::Latest | Self::Window(_))
    }
}

/// A field of a struct with `#[derive(Inputs)]`: one port, an `Option` or a `Vec` of it.
pub trait InputPort: Inputs {
    /// How it reads.
    const MODE: PortMode;
    /// Whether it takes any number of streams.
    const MANY: bool = false;
    /// Whether it may stay unconnected.
    const OPTIONAL: bool = false;

    /// The type of its messages; none for a timer.
    fn payload() -> Option<PayloadType>;

    #[doc(hidden)]
    fn layout(wire: &Wire) -> Self::Layout;
}

/// A field of a struct with `#[derive(Outputs)]`: a [`Port`].
pub trait OutputPort: Outputs {
    /// The type of its messages.
    fn payload() -> PayloadType;

    #[doc(hidden)]
    fn declare_named(streams: &mut Declaration, name: &'static str) -> Self::Streams;
}

impl PortInfo {
    /// The port `P`, neither closing a loop nor raw.
    pub fn new<P: InputPort>(name: &'static str, doc: &'static str) -> Self {
        Self { many: P::MANY, optional: P::OPTIONAL, doc, ..Self::declared(name, P::MODE, P::payload()) }
    }

    /// A port that is declared at run time: one stream or timer, neither closing a loop nor raw.
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
    /// The port `P`.
    pub fn new<P: OutputPort>(name: &'static str, doc: &'static str) -> Self {
        Self { doc, ..Self::declared(name, P::payload()) }
    }

    /// A port that is declared at run time.
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
