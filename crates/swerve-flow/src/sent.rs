//! Sent payloads, made or promised, and the outputs of a step.

use core::any::{Any, TypeId};
use core::fmt;
use std::sync::Arc;

use swerve_core::Digest;

use crate::payload::{ErasedPayload, Made, Payload};
use crate::pending::Pending;

/// A sent payload: made, or [promised](crate::Promise). Its type is known in either case; access to the payload itself
/// waits until it is made.
#[derive(Clone)]
pub struct Sent(Form);

#[derive(Clone)]
enum Form {
    Made(Made),
    Promised(Arc<Pending>),
}

impl From<Made> for Sent {
    #[inline(always)]
    fn from(made: Made) -> Self {
        Self(Form::Made(made))
    }
}

impl From<Arc<Pending>> for Sent {
    fn from(pending: Arc<Pending>) -> Self {
        Self(Form::Promised(pending))
    }
}

impl Sent {
    pub(crate) fn new<T: Payload>(payload: Arc<T>) -> Self {
        Made::new(payload).into()
    }

    /// Returns the promise, if it is one.
    #[inline]
    pub(crate) fn promised(&self) -> Option<&Arc<Pending>> {
        match &self.0 {
            Form::Made(_) => None,
            Form::Promised(pending) => Some(pending),
        }
    }

    /// True if it is a promise, kept or not: operations that are cheap for other payloads may then take long.
    pub fn is_promised(&self) -> bool {
        self.promised().is_some()
    }

    /// Returns the payload once it is made; `None` if a promise was broken, which ends the run.
    #[inline]
    pub(crate) fn made(&self) -> Option<&Made> {
        match &self.0 {
            Form::Made(made) => Some(made),
            Form::Promised(pending) => pending.wait().ok(),
        }
    }

    /// Returns the payload; `None` if a promise was broken, which ends the run.
    pub fn payload(&self) -> Option<&dyn ErasedPayload> {
        self.made().map(|made| &*made.payload)
    }

    /// Digest of the payload, which enters the run's digest.
    pub fn digest(&self) -> Digest {
        self.made().map_or(Digest(0), |made| made.digest)
    }

    /// Type of the payload, within this process; does not wait.
    pub fn type_id(&self) -> TypeId {
        match &self.0 {
            Form::Made(made) => made.payload.as_any().type_id(),
            Form::Promised(pending) => pending.payload.id,
        }
    }

    /// True if the payload is of type `T`; does not wait.
    pub fn is<T: Payload>(&self) -> bool {
        self.type_id() == TypeId::of::<T>()
    }

    /// Returns the payload, if it is of type `T`.
    pub fn downcast_ref<T: Payload>(&self) -> Option<&T> {
        if self.is::<T>() { self.payload()?.as_any().downcast_ref() } else { None }
    }

    /// Rust type of the payload, for error messages and listings; does not wait.
    pub fn type_name(&self) -> &'static str {
        match &self.0 {
            Form::Made(made) => made.payload.type_name(),
            Form::Promised(pending) => pending.payload.full_name,
        }
    }

    /// Schema of the payload in CDDL, as [`ErasedPayload::cddl`]; does not wait.
    pub fn cddl(&self) -> String {
        match &self.0 {
            Form::Made(made) => made.payload.cddl(),
            Form::Promised(pending) => (pending.cddl)(),
        }
    }

    /// Appends the payload in CBOR; nothing if a promise was broken.
    pub fn to_cbor(&self, out: &mut Vec<u8>) {
        if let Some(payload) = self.payload() {
            payload.to_cbor(out);
        }
    }

    /// Appends the payload as sent to other processes; nothing if a promise was broken.
    pub fn to_wire(&self, out: &mut Vec<u8>) {
        if let Some(payload) = self.payload() {
            payload.to_wire(out);
        }
    }

    /// Payload in the memory that all readers share, with its digest.
    #[inline]
    pub(crate) fn into_made(self) -> Made {
        match self.0 {
            Form::Made(made) => made,
            Form::Promised(pending) => pending.wait().expect("the engine looked before it was read").clone(),
        }
    }

    #[inline]
    pub(crate) fn typed<T: Payload>(self) -> (Arc<T>, Digest) {
        let Made { payload, digest } = self.into_made();
        let any: Arc<dyn Any + Send + Sync> = payload;
        (any.downcast().expect("the graph's check compared the types of both ends"), digest)
    }
}

impl fmt::Debug for Sent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}({})", self.type_name(), self.digest())
    }
}

/// Outputs of one step, by port. Most steps fill only one port, which takes no allocation.
#[derive(Clone, Debug, Default)]
pub struct Outs {
    first: Option<Sent>,
    /// Filled ports above 0, in their order.
    others: Vec<(usize, Sent)>,
}

impl Outs {
    /// Fills a port, replacing earlier contents.
    #[inline(always)]
    pub(crate) fn set(&mut self, port: usize, sent: Sent) {
        if port == 0 {
            // An assignment would first build the value elsewhere, because the old value is dropped before.
            drop(self.first.replace(sent));
        } else {
            self.set_other(port, sent);
        }
    }

    #[inline(never)]
    fn set_other(&mut self, port: usize, sent: Sent) {
        match self.others.binary_search_by_key(&port, |(port, _)| *port) {
            Ok(index) => self.others[index].1 = sent,
            Err(index) => self.others.insert(index, (port, sent)),
        }
    }

    /// Contents of a port.
    pub(crate) fn get(&self, port: usize) -> Option<&Sent> {
        if port == 0 {
            return self.first.as_ref();
        }
        let index = self.others.binary_search_by_key(&port, |(port, _)| *port).ok()?;
        Some(&self.others[index].1)
    }

    /// Filled ports, in their order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (usize, &Sent)> {
        let others = self.others.iter().map(|(port, sent)| (*port, sent));
        self.first.iter().map(|sent| (0, sent)).chain(others)
    }

    /// Empties port 0; returns its contents.
    #[inline]
    pub(crate) fn take_first(&mut self) -> Option<Sent> {
        self.first.take()
    }

    /// Empties the ports above 0; returns the filled ones, in their order.
    #[inline]
    pub(crate) fn take_others(&mut self) -> impl Iterator<Item = (usize, Sent)> {
        self.others.drain(..)
    }

    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        self.first.is_none() && self.others.is_empty()
    }

    pub(crate) fn len(&self) -> usize {
        usize::from(self.first.is_some()) + self.others.len()
    }
}
