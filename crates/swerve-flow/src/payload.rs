//! What messages carry, with its type erased for the engine and for observers.

use core::any::{Any, TypeId};
use core::fmt;
use std::sync::Arc;

use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_core::{Digest, digest_of};

use crate::cbor;
use crate::cddl::cddl;
use crate::promise::Pending;

/// A type that a stream may carry: anything that can be written, read back and shared.
pub trait Payload: Serialize + DeserializeOwned + Send + Sync + 'static {}

impl<T: Serialize + DeserializeOwned + Send + Sync + 'static> Payload for T {}

/// A payload whose type the holder does not know.
pub trait ErasedPayload: Any + Send + Sync {
    /// Appends the payload in CBOR (RFC 8949), the form in which logs hold it.
    fn to_cbor(&self, out: &mut Vec<u8>);
    /// Appends the payload in the form in which it goes to another process (postcard).
    fn to_wire(&self, out: &mut Vec<u8>);
    /// The payload's fingerprint, as it enters the run's digest.
    fn digest(&self) -> Digest;
    /// The Rust type, for error messages and listings.
    fn type_name(&self) -> &'static str;
    /// The form of `to_cbor` in CDDL (RFC 8610), its first rule `payload`; `any` where the type does not show it.
    fn cddl(&self) -> String;
    /// The payload for a downcast, by an observer that knows the type.
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

/// A payload, shared, with its digest taken once, where it was made.
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

/// A payload on its way: made, or [promised](crate::Promise). Its type is known either way; who asks for more waits
/// until it is made.
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

    /// The promise, if it is one.
    #[inline]
    pub(crate) fn promised(&self) -> Option<&Arc<Pending>> {
        match &self.0 {
            Form::Made(_) => None,
            Form::Promised(pending) => Some(pending),
        }
    }

    /// Whether it is a promise, kept or not: what is cheap to ask of other payloads may take long.
    pub fn is_promised(&self) -> bool {
        self.promised().is_some()
    }

    /// What was made; none where a promise was broken, which ends the run.
    #[inline]
    pub(crate) fn made(&self) -> Option<&Made> {
        match &self.0 {
            Form::Made(made) => Some(made),
            Form::Promised(pending) => pending.wait().ok(),
        }
    }

    /// The payload; none where a promise was broken, which ends the run.
    pub fn payload(&self) -> Option<&dyn ErasedPayload> {
        self.made().map(|made| &*made.payload)
    }

    /// The payload's fingerprint, as it enters the run's digest.
    pub fn digest(&self) -> Digest {
        self.made().map_or(Digest(0), |made| made.digest)
    }

    /// The payload's type, while the program runs; nobody waits for that.
    pub fn type_id(&self) -> TypeId {
        match &self.0 {
            Form::Made(made) => made.payload.as_any().type_id(),
            Form::Promised(pending) => pending.payload.id,
        }
    }

    /// Whether the payload is of this type; nobody waits for that.
    pub fn is<T: Payload>(&self) -> bool {
        self.type_id() == TypeId::of::<T>()
    }

    /// The payload, if it is of this type.
    pub fn downcast_ref<T: Payload>(&self) -> Option<&T> {
        if self.is::<T>() { self.payload()?.as_any().downcast_ref() } else { None }
    }

    /// The payload's Rust type, for error messages and listings; nobody waits for that.
    pub fn type_name(&self) -> &'static str {
        match &self.0 {
            Form::Made(made) => made.payload.type_name(),
            Form::Promised(pending) => pending.payload.full_name,
        }
    }

    /// The form of the payload in CDDL, as [`ErasedPayload::cddl`]; nobody waits for that.
    pub fn cddl(&self) -> String {
        match &self.0 {
            Form::Made(made) => made.payload.cddl(),
            Form::Promised(pending) => (pending.cddl)(),
        }
    }

    /// Appends the payload in CBOR; nothing where a promise was broken.
    pub fn to_cbor(&self, out: &mut Vec<u8>) {
        if let Some(payload) = self.payload() {
            payload.to_cbor(out);
        }
    }

    /// Appends the payload in the form in which it goes to another process; nothing where a promise was broken.
    pub fn to_wire(&self, out: &mut Vec<u8>) {
        if let Some(payload) = self.payload() {
            payload.to_wire(out);
        }
    }

    /// The payload in the memory that all readers share, with its fingerprint.
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

/// The type of a payload, while the program runs.
#[derive(Clone, Copy, Debug)]
pub struct PayloadType {
    /// What tells it from all others in this process.
    pub id: TypeId,
    /// Its name with the paths of its modules.
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
    /// The type `T`.
    pub fn of<T: Payload>() -> Self {
        Self {
            id: TypeId::of::<T>(),
            full_name: core::any::type_name::<T>(),
            decode: decode::<T>,
            from_wire: from_wire::<T>,
        }
    }

    /// Its name without the paths of its modules.
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

/// One step's outputs, by port. Most steps fill one port only, which takes no allocation.
#[derive(Clone, Debug, Default)]
pub struct Outs {
    first: Option<Sent>,
    /// Of the ports above 0 those that are filled, in their order.
    others: Vec<(usize, Sent)>,
}

impl Outs {
    /// Fills a port, or fills it anew.
    #[inline(always)]
    pub(crate) fn set(&mut self, port: usize, sent: Sent) {
        if port == 0 {
            // As an assignment it would be put together elsewhere first: the old value is dropped before.
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

    /// What a port is filled with.
    pub(crate) fn get(&self, port: usize) -> Option<&Sent> {
        if port == 0 {
            return self.first.as_ref();
        }
        let index = self.others.binary_search_by_key(&port, |(port, _)| *port).ok()?;
        Some(&self.others[index].1)
    }

    /// The filled ports, in their order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (usize, &Sent)> {
        let others = self.others.iter().map(|(port, sent)| (*port, sent));
        self.first.iter().map(|sent| (0, sent)).chain(others)
    }

    /// Empties port 0; gives what it was filled with.
    #[inline]
    pub(crate) fn take_first(&mut self) -> Option<Sent> {
        self.first.take()
    }

    /// Empties the ports above 0; gives those that were filled, in their order.
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

/// How the engine makes a payload of one stream from its logged form.
pub(crate) type Decode = fn(&[u8]) -> Result<Sent, String>;

pub(crate) fn decode<T: Payload>(bytes: &[u8]) -> Result<Sent, String> {
    let value: T = cbor::read(bytes)?;
    Ok(Sent::new(Arc::new(value)))
}

/// How the engine makes a payload of one stream from what came from another process.
pub(crate) type FromWire = fn(&[u8]) -> Result<Arc<dyn ErasedPayload>, String>;

pub(crate) fn from_wire<T: Payload>(bytes: &[u8]) -> Result<Arc<dyn ErasedPayload>, String> {
    match postcard::take_from_bytes::<T>(bytes) {
        Ok((value, [])) => Ok(Arc::new(value)),
        Ok((_, rest)) => Err(format!("{} bytes too many", rest.len())),
        Err(error) => Err(error.to_string()),
    }
}
