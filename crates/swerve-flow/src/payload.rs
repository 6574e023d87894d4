//! Payloads of messages, with their types erased for the engine and for observers.

use core::any::{Any, TypeId};
use core::fmt;
use std::sync::Arc;

use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_core::{Digest, digest_of};

use crate::cbor;
use crate::cddl::cddl;
use crate::promise::Pending;

/// A type that a stream can carry: anything that can be serialized, deserialized and shared.
pub trait Payload: Serialize + DeserializeOwned + Send + Sync + 'static {}

impl<T: Serialize + DeserializeOwned + Send + Sync + 'static> Payload for T {}

/// A payload whose type is unknown to its holder.
pub trait ErasedPayload: Any + Send + Sync {
    /// Appends the payload in CBOR (RFC 8949), as stored in logs.
    fn to_cbor(&self, out: &mut Vec<u8>);
    /// Appends the payload as sent to other processes (postcard).
    fn to_wire(&self, out: &mut Vec<u8>);
    /// Digest of the payload, which enters the run's digest.
    fn digest(&self) -> Digest;
    /// Rust type, for error messages and listings.
    fn type_name(&self) -> &'static str;
    /// Schema of `to_cbor` in CDDL (RFC 8610), its first rule `payload`; `any` if the type cannot be traced.
    fn cddl(&self) -> String;
    /// Payload to be downcast by an observer that knows the type.
    fn as_any(&self) -> &dyn Any;
}

impl<T: Payload> ErasedPayload for T {
    fn to_cbor(&self, out: &mut Vec<u8>) {
        cbor::write(self, out);
    }

    fn to_wire(&self, out: &mut Vec<u8>) {
        *out = postcard::to_extend(self, core::mem::take(out))
            .expect("message types serialize without fail, and memory takes all");
    }

    fn digest(&self) -> Digest {
        digest_of(self)
    }

    fn type_name(&self) -> &'static str {
        core::any::type_name::<T>()
    }

    fn cddl(&self) -> String {
        cddl::<T>()
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

impl fmt::Debug for dyn ErasedPayload {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}({})", self.type_name(), self.digest())
    }
}

/// A shared payload with its digest, which is computed once, where the payload is made.
#[derive(Clone, Debug)]
pub(crate) struct Made {
    pub(crate) payload: Arc<dyn ErasedPayload>,
    pub(crate) digest: Digest,
}

impl Made {
    pub(crate) fn new<T: Payload>(payload: Arc<T>) -> Self {
        let digest = digest_of(&*payload);
        Self { payload, digest }
    }
}

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

/// Type of a payload, within this process.
#[derive(Clone, Copy, Debug)]
pub struct PayloadType {
    /// Identifier of the type, unique in this process.
    pub id: TypeId,
    /// Name of the type with its module paths.
    pub full_name: &'static str,
    pub(crate) decode: Decode,
    pub(crate) from_wire: FromWire,
}

impl PartialEq for PayloadType {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id
    }
}

impl Eq for PayloadType {}

impl PayloadType {
    /// Returns the type `T`.
    pub fn of<T: Payload>() -> Self {
        Self {
            id: TypeId::of::<T>(),
            full_name: core::any::type_name::<T>(),
            decode: decode::<T>,
            from_wire: from_wire::<T>,
        }
    }

    /// Name of the type without its module paths.
    pub fn name(&self) -> String {
        self.to_string()
    }
}

impl fmt::Display for PayloadType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        for part in self.full_name.split_inclusive(|c| !is_word(c)) {
            if !part.ends_with(':') {
                f.write_str(part)?;
            }
        }
        Ok(())
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

/// Decoder of a stream's payloads from their logged form.
pub(crate) type Decode = fn(&[u8]) -> Result<Sent, String>;

pub(crate) fn decode<T: Payload>(bytes: &[u8]) -> Result<Sent, String> {
    let value: T = cbor::read(bytes)?;
    Ok(Sent::new(Arc::new(value)))
}

/// Decoder of a stream's payloads from the form in which another process sent them.
pub(crate) type FromWire = fn(&[u8]) -> Result<Arc<dyn ErasedPayload>, String>;

pub(crate) fn from_wire<T: Payload>(bytes: &[u8]) -> Result<Arc<dyn ErasedPayload>, String> {
    match postcard::take_from_bytes::<T>(bytes) {
        Ok((value, [])) => Ok(Arc::new(value)),
        Ok((_, rest)) => Err(format!("{} bytes too many", rest.len())),
        Err(error) => Err(error.to_string()),
    }
}
