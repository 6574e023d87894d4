//! Payloads of messages, with their types erased for the engine and for observers.

use core::any::{Any, TypeId};
use core::fmt;
use std::sync::Arc;

use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_core::{Digest, digest_of};

use crate::cbor;
use crate::cddl::cddl;

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

/// Decoder of a stream's payloads from their logged form.
pub(crate) type Decode = fn(&[u8]) -> Result<Made, String>;

pub(crate) fn decode<T: Payload>(bytes: &[u8]) -> Result<Made, String> {
    let value: T = cbor::read(bytes)?;
    Ok(Made::new(Arc::new(value)))
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
