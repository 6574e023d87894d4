//! Handles of streams and of feedback edges, by which a graph is connected.

use core::fmt;
use core::marker::PhantomData;

use crate::payload::{Payload, PayloadType};

/// A stream of messages of type `T`, to be connected to any number of readers.
pub struct Stream<T> {
    pub(crate) id: usize,
    payload: PhantomData<fn() -> T>,
}

/// An edge that closes a loop: read by [`Latest`](crate::Latest) or [`Window`](crate::Window), it contains the messages
/// visible strictly before the current instant. Connected to its stream by [`Graph::connect`](crate::Graph::connect).
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

/// Source of a `Latest` or `Window` port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Edge {
    Stream(usize),
    Feedback(usize),
}

/// A stream or a feedback edge, for uses that accept both: a `Vec` of [`Latest`](crate::Latest) ports, the policy of a deadline.
#[derive(Clone, Copy, Debug)]
pub struct Source<T> {
    pub(crate) edge: Edge,
    payload: PhantomData<fn() -> T>,
}

impl<T> From<Stream<T>> for Source<T> {
    fn from(stream: Stream<T>) -> Self {
        Self { edge: Edge::Stream(stream.id), payload: PhantomData }
    }
}

impl<T> From<Feedback<T>> for Source<T> {
    fn from(feedback: Feedback<T>) -> Self {
        Self { edge: Edge::Feedback(feedback.id), payload: PhantomData }
    }
}

/// A [`Stream`] whose type is known at run time only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AnyStream {
    pub(crate) id: usize,
    pub(crate) payload: PayloadType,
}

/// A [`Feedback`] edge whose type is known at run time only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AnyFeedback {
    pub(crate) id: usize,
    pub(crate) payload: PayloadType,
}

macro_rules! any_handle {
    ($any:ident, $typed:ident) => {
        impl $any {
            /// Type of its messages.
            pub fn payload(self) -> PayloadType {
                self.payload
            }

            /// Returns the typed handle, if the type is `T`.
            pub fn typed<T: Payload>(self) -> Option<$typed<T>> {
                (self.payload == PayloadType::of::<T>()).then(|| $typed::new(self.id))
            }
        }

        impl<T: Payload> From<$typed<T>> for $any {
            fn from(handle: $typed<T>) -> Self {
                Self { id: handle.id, payload: PayloadType::of::<T>() }
            }
        }
    };
}

any_handle!(AnyStream, Stream);
any_handle!(AnyFeedback, Feedback);
