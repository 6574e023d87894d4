//! Input ports: the inputs of an operator's step.

use std::collections::VecDeque;

use swerve_core::{Span, Time};

use crate::message::{Header, Message, Msg};
use crate::payload::Payload;
use crate::stream::{Edge, Feedback, Source, Stream};

/// Inputs of an operator: a port, a tuple of up to twelve inputs (which may be tuples themselves), an `Option` or a
/// `Vec` of ports, or a struct of ports with `#[derive(Inputs)]`.
pub trait Inputs: Sized + Send + 'static {
    /// Number of ports of a `Vec` or an `Option`, as connected in the graph.
    type Layout: Send + 'static;

    /// Reads the inputs of one step from the slots that [`Connect`] declared, in that order.
    fn read(layout: &Self::Layout, slots: &mut Slots<'_>) -> Self;
}

/// Sources of the inputs `I`: a [`Stream`] or [`Feedback`] per port, a [`Timer`] per [`Every`].
pub trait Connect<I: Inputs> {
    /// Declares the ports and their sources, in order.
    fn connect(self, ports: &mut Ports) -> I::Layout;
}

/// A synchronised port: the message with exactly the frame's stamp, if the stream has one.
#[derive(Debug)]
pub struct At<T> {
    message: Option<Message<T>>,
}

/// The newest message that is visible when the step starts; its stamp may be later than the frame's.
#[derive(Debug)]
pub struct Latest<T> {
    message: Option<Message<T>>,
}

/// The newest `N` messages that are visible when the step starts, oldest first.
#[derive(Debug)]
pub struct Window<T, const N: usize> {
    messages: Vec<Message<T>>,
}

/// A timer port, synchronised and without payload; it triggers the operator at `phase + k * period`.
#[derive(Clone, Copy, Debug)]
pub struct Every {
    ticked: bool,
}

/// Period and phase of an [`Every`] port, created by [`every`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timer {
    pub(crate) period: Span,
    pub(crate) phase: Span,
}

/// Creates a timer with this period whose first tick is at instant 0.
pub const fn every(period: Span) -> Timer {
    Timer { period, phase: Span::ZERO }
}

impl Timer {
    /// Sets the instant of the first tick.
    #[must_use]
    pub const fn phase(mut self, phase: Span) -> Self {
        self.phase = phase;
        self
    }
}

impl Every {
    /// True if the frame's stamp is a tick of this timer (always, unless the operator also joins other ports).
    pub fn ticked(&self) -> bool {
        self.ticked
    }
}

impl<T> At<T> {
    /// Returns the message, if the stream has one at this stamp.
    pub fn get(&self) -> Option<&Message<T>> {
        self.message.as_ref()
    }

    /// Header of the message.
    pub fn header(&self) -> Option<&Header> {
        self.get().map(Message::header)
    }
}

impl<T> Latest<T> {
    /// Returns the newest message, if there is one yet.
    pub fn get(&self) -> Option<&Message<T>> {
        self.message.as_ref()
    }

    /// Header of the message.
    pub fn header(&self) -> Option<&Header> {
        self.get().map(Message::header)
    }

    /// Age at `now` of the instant that the message describes.
    pub fn age(&self, now: Time) -> Option<Span> {
        self.header().map(|header| now - header.stamp)
    }
}

impl<T, const N: usize> Window<T, N> {
    /// Returns up to `N` messages, oldest first.
    pub fn get(&self) -> &[Message<T>] {
        &self.messages
    }

    /// Returns the newest message.
    pub fn newest(&self) -> Option<&Message<T>> {
        self.messages.last()
    }
}

/// Contents of one port for one step.
#[derive(Default)]
pub(crate) enum Slot {
    #[default]
    Empty,
    Message(Msg),
    Window(VecDeque<Msg>),
    Tick,
}

/// The filled ports of one step, in the order of their declaration.
pub struct Slots<'a>(pub(crate) core::slice::IterMut<'a, Slot>);

impl Slots<'_> {
    #[inline]
    fn next(&mut self) -> Slot {
        core::mem::take(self.0.next().expect("the layout counts as many ports as were declared"))
    }

    #[inline(always)]
    fn message<T: Payload>(&mut self) -> Option<Message<T>> {
        match self.next() {
            Slot::Message(msg) => Some(msg.typed()),
            _ => None,
        }
    }
}

/// Ports of an operator during their declaration.
#[derive(Default)]
pub struct Ports {
    pub(crate) specs: Vec<PortSpec>,
}

/// One declared port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PortSpec {
    At(usize),
    Latest { edge: Edge, depth: usize, show: Show },
    Timer(Timer),
}

/// Messages of a stream that a port holds at a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Show {
    /// The newest one.
    Newest,
    /// The newest one, unless an earlier step has read it.
    Unread,
    /// All that the port keeps.
    Window,
}

impl<T: Payload> Inputs for At<T> {
    type Layout = ();

    #[inline(always)]
    fn read((): &(), slots: &mut Slots<'_>) -> Self {
        Self { message: slots.message() }
    }
}

impl<T: Payload> Inputs for Latest<T> {
    type Layout = ();

    fn read((): &(), slots: &mut Slots<'_>) -> Self {
        Self { message: slots.message() }
    }
}

impl<T: Payload, const N: usize> Inputs for Window<T, N> {
    type Layout = ();

    fn read((): &(), slots: &mut Slots<'_>) -> Self {
        match slots.next() {
            Slot::Window(msgs) => Self { messages: msgs.into_iter().map(Msg::typed).collect() },
            _ => Self { messages: Vec::new() },
        }
    }
}

impl Inputs for Every {
    type Layout = ();

    fn read((): &(), slots: &mut Slots<'_>) -> Self {
        Self { ticked: matches!(slots.next(), Slot::Tick) }
    }
}

impl<I: Inputs> Inputs for Vec<I> {
    type Layout = Vec<I::Layout>;

    fn read(layout: &Self::Layout, slots: &mut Slots<'_>) -> Self {
        layout.iter().map(|port| I::read(port, slots)).collect()
    }
}

/// A port that may stay unconnected.
impl<I: Inputs> Inputs for Option<I> {
    type Layout = Option<I::Layout>;

    fn read(layout: &Self::Layout, slots: &mut Slots<'_>) -> Self {
        layout.as_ref().map(|port| I::read(port, slots))
    }
}

impl<T: Payload> Connect<At<T>> for Stream<T> {
    fn connect(self, ports: &mut Ports) {
        ports.specs.push(PortSpec::At(self.id));
    }
}

impl<T: Payload> Connect<Latest<T>> for Stream<T> {
    fn connect(self, ports: &mut Ports) {
        ports.specs.push(PortSpec::Latest { edge: Edge::Stream(self.id), depth: 1, show: Show::Newest });
    }
}

impl<T: Payload> Connect<Latest<T>> for Feedback<T> {
    fn connect(self, ports: &mut Ports) {
        ports.specs.push(PortSpec::Latest { edge: Edge::Feedback(self.id), depth: 1, show: Show::Newest });
    }
}

impl<T: Payload, const N: usize> Connect<Window<T, N>> for Stream<T> {
    fn connect(self, ports: &mut Ports) {
        ports.specs.push(PortSpec::Latest { edge: Edge::Stream(self.id), depth: N, show: Show::Window });
    }
}

impl<T: Payload, const N: usize> Connect<Window<T, N>> for Feedback<T> {
    fn connect(self, ports: &mut Ports) {
        ports.specs.push(PortSpec::Latest { edge: Edge::Feedback(self.id), depth: N, show: Show::Window });
    }
}

impl<T: Payload> Connect<Latest<T>> for Source<T> {
    fn connect(self, ports: &mut Ports) {
        ports.specs.push(PortSpec::Latest { edge: self.edge, depth: 1, show: Show::Newest });
    }
}

impl Connect<Every> for Timer {
    fn connect(self, ports: &mut Ports) {
        ports.specs.push(PortSpec::Timer(self));
    }
}

impl<I: Inputs, C: Connect<I>> Connect<Vec<I>> for Vec<C> {
    fn connect(self, ports: &mut Ports) -> Vec<I::Layout> {
        self.into_iter().map(|port| port.connect(ports)).collect()
    }
}

impl<I: Inputs, C: Connect<I>> Connect<Option<I>> for Option<C> {
    fn connect(self, ports: &mut Ports) -> Option<I::Layout> {
        self.map(|port| port.connect(ports))
    }
}

macro_rules! tuples {
    ($($($input:ident $source:ident $i:tt),+;)*) => {$(
        impl<$($input: Inputs),+> Inputs for ($($input,)+) {
            type Layout = ($($input::Layout,)+);

            fn read(layout: &Self::Layout, slots: &mut Slots<'_>) -> Self {
                ($($input::read(&layout.$i, slots),)+)
            }
        }

        impl<$($input: Inputs, $source: Connect<$input>),+> Connect<($($input,)+)> for ($($source,)+) {
            fn connect(self, ports: &mut Ports) -> ($($input::Layout,)+) {
                ($(self.$i.connect(ports),)+)
            }
        }
    )*};
}

tuples! {
    A Sa 0;
    A Sa 0, B Sb 1;
    A Sa 0, B Sb 1, C Sc 2;
    A Sa 0, B Sb 1, C Sc 2, D Sd 3;
    A Sa 0, B Sb 1, C Sc 2, D Sd 3, E Se 4;
    A Sa 0, B Sb 1, C Sc 2, D Sd 3, E Se 4, F Sf 5;
    A Sa 0, B Sb 1, C Sc 2, D Sd 3, E Se 4, F Sf 5, G Sg 6;
    A Sa 0, B Sb 1, C Sc 2, D Sd 3, E Se 4, F Sf 5, G Sg 6, H Sh 7;
    A Sa 0, B Sb 1, C Sc 2, D Sd 3, E Se 4, F Sf 5, G Sg 6, H Sh 7, I Si 8;
    A Sa 0, B Sb 1, C Sc 2, D Sd 3, E Se 4, F Sf 5, G Sg 6, H Sh 7, I Si 8, J Sj 9;
    A Sa 0, B Sb 1, C Sc 2, D Sd 3, E Se 4, F Sf 5, G Sg 6, H Sh 7, I Si 8, J Sj 9, K Sk 10;
    A Sa 0, B Sb 1, C Sc 2, D Sd 3, E Se 4, F Sf 5, G Sg 6, H Sh 7, I Si 8, J Sj 9, K Sk 10, L Sl 11;
}
