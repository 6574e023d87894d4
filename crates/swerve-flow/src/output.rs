//! Output ports: the outputs of an operator's step.

use std::borrow::Cow;
use std::sync::Arc;

use swerve_core::{Digest, digest_of};

use crate::message::Message;
use crate::payload::{Made, Payload, PayloadType};
use crate::pending::Pending;
use crate::sent::Outs;
use crate::stream::Stream;

/// Outputs of an operator: `()`, a [`Port`], a tuple of up to four ports, or a struct of ports with
/// `#[derive(Outputs)]`.
pub trait Outputs: Sized + Send + 'static {
    /// Handles for connecting readers: a [`Stream`] per port.
    type Streams: Copy;
    /// Values that a step sent or offered, by port.
    type Values;

    #[doc(hidden)]
    fn declare(streams: &mut Declaration) -> Self::Streams;
    #[doc(hidden)]
    fn fresh(first: usize) -> Self;
    #[doc(hidden)]
    fn take(&mut self, sent: &mut Outs);
    #[doc(hidden)]
    fn values(outs: Option<&Outs>, first: usize) -> Self::Values;
}

/// Output streams of an operator during their declaration.
pub struct Declaration {
    pub(crate) first: usize,
    pub(crate) types: Vec<Declared>,
}

/// One declared stream.
pub(crate) struct Declared {
    /// Name of its port, if that has one.
    pub(crate) port: Option<Cow<'static, str>>,
    pub(crate) payload: PayloadType,
}

impl Declaration {
    pub(crate) fn stream<T: Payload>(&mut self, port: Option<&'static str>) -> Stream<T> {
        let payload = PayloadType::of::<T>();
        self.types.push(Declared { port: port.map(Cow::Borrowed), payload });
        Stream::new(self.first + self.types.len() - 1)
    }
}

/// One output of an operator: carries at most one message per step.
pub struct Port<T> {
    pub(crate) index: usize,
    sent: Option<Filled<T>>,
}

/// Contents of a port after a step.
enum Filled<T> {
    /// A payload, and its digest if that is already known.
    Here(Arc<T>, Option<Digest>),
    /// A payload that another thread computes.
    Promised(Arc<Pending>),
}

impl<T: Payload> Port<T> {
    /// Loans room for one message. Dropping it publishes nothing.
    pub fn loan(&mut self) -> Loan<'_, T> {
        Loan { port: self }
    }

    /// Publishes `value`; the same as `loan().send(value)`. Of several values sent in a step, the last one is
    /// published.
    pub fn send(&mut self, value: T) {
        self.loan().send(value);
    }

    /// Publishes an existing payload without a copy.
    pub fn forward(&mut self, value: Arc<T>) {
        self.put(value, None);
    }

    /// Publishes the payload of a message without a copy and without computing its digest again, for operators that
    /// pass large payloads on.
    pub fn pass_on(&mut self, message: &Message<T>) {
        self.put(message.shared(), Some(message.digest));
    }

    fn put(&mut self, value: Arc<T>, known: Option<Digest>) {
        self.sent = Some(Filled::Here(value, known));
    }

    pub(crate) fn promise(&mut self, pending: Arc<Pending>) {
        self.sent = Some(Filled::Promised(pending));
    }
}

/// Room for one message of a port; the transport determines its place in memory.
pub struct Loan<'a, T> {
    port: &'a mut Port<T>,
}

impl<T: Payload> Loan<'_, T> {
    /// Fills the room with `value` and publishes it.
    pub fn send(self, value: T) {
        self.port.put(Arc::new(value), None);
    }
}

impl<T: Payload> Outputs for Port<T> {
    type Streams = Stream<T>;
    type Values = Option<Arc<T>>;

    fn declare(streams: &mut Declaration) -> Stream<T> {
        streams.stream(None)
    }

    fn fresh(first: usize) -> Self {
        Self { index: first, sent: None }
    }

    #[inline(always)]
    fn take(&mut self, sent: &mut Outs) {
        match self.sent.take() {
            None => {}
            Some(Filled::Here(payload, known)) => {
                let digest = known.unwrap_or_else(|| digest_of(&*payload));
                sent.set(self.index, Made { payload, digest }.into());
            }
            Some(Filled::Promised(pending)) => sent.set(self.index, pending.into()),
        }
    }

    fn values(outs: Option<&Outs>, first: usize) -> Self::Values {
        outs.and_then(|outs| outs.get(first)).cloned().map(|sent| sent.typed().0)
    }
}

impl Outputs for () {
    type Streams = ();
    type Values = ();

    fn declare(_: &mut Declaration) {}
    fn fresh(_: usize) {}
    fn take(&mut self, _: &mut Outs) {}
    fn values(_: Option<&Outs>, _: usize) {}
}

macro_rules! tuples {
    ($($($port:ident $i:tt),+;)*) => {$(
        impl<$($port: Payload),+> Outputs for ($(Port<$port>,)+) {
            type Streams = ($(Stream<$port>,)+);
            type Values = ($(Option<Arc<$port>>,)+);

            fn declare(streams: &mut Declaration) -> Self::Streams {
                ($(Port::<$port>::declare(streams),)+)
            }

            fn fresh(first: usize) -> Self {
                ($(Port::<$port>::fresh(first + $i),)+)
            }

            fn take(&mut self, sent: &mut Outs) {
                $(self.$i.take(sent);)+
            }

            fn values(outs: Option<&Outs>, first: usize) -> Self::Values {
                ($(Port::<$port>::values(outs, first + $i),)+)
            }
        }
    )*};
}

tuples! {
    A 0;
    A 0, B 1;
    A 0, B 1, C 2;
    A 0, B 1, C 2, D 3;
}
