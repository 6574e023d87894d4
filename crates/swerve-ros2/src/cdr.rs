//! Serialization in OMG's common data representation (CDR): plain, version 1, as in ROS 2.
//!
//! A payload has a header of four bytes with the byte order, then the fields in order, each number aligned to its
//! size. [`decode`] accepts both byte orders and validates everything. [`encode`] writes little-endian and pads to
//! a multiple of four bytes: readers ignore bytes after the last field, but some (Cyclone DDS 0.10) drop an
//! unpadded last fragment, and RustDDS does not pad.

use std::io;

use byteorder::{BigEndian, ByteOrder, LittleEndian};
use cdr_encoding::{CdrDeserializer, CdrSerializer, to_vec_with_size_hint};
use serde::de::DeserializeSeed;
use serde::ser::SerializeTuple;
use serde::{Serialize, Serializer};

use crate::check::Invalid;
use crate::message::{AnyMessage, Kind, RosMessage};

/// Length of the header of a payload: the representation and its options, bytes.
pub const HEADER_BYTES: usize = 4;
/// Maximum number of bytes after the last field of a payload: padding to a multiple of four, or of eight.
const TRAILING_BYTES_MAX: usize = 7;
const CDR_BIG_ENDIAN: [u8; 2] = [0, 0];
const CDR_LITTLE_ENDIAN: [u8; 2] = [0, 1];

/// A payload cannot be decoded.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum DecodeError {
    /// Shorter than the header.
    #[error("a payload of {0} bytes has no header")]
    TooShort(usize),
    /// Not plain CDR.
    #[error("the payload is in representation {0:02x?}, not in plain CDR")]
    Representation([u8; 2]),
    /// Fields are missing or malformed.
    #[error("the payload is not a {kind}: {reason}")]
    Malformed {
        /// Expected type.
        kind: Kind,
        /// Error of the decoder.
        reason: String,
    },
    /// Trailing bytes: another message, or a newer version of it.
    #[error("{bytes} bytes are left behind the last field of {kind}")]
    Trailing {
        /// Expected type.
        kind: Kind,
        /// Number of trailing bytes.
        bytes: usize,
    },
    /// The fields are present but implausible.
    #[error("a {kind} is refused: {invalid}")]
    Invalid {
        /// Type of the message.
        kind: Kind,
        /// The invalid field.
        invalid: Invalid,
    },
}

/// Decodes and validates a message of this kind.
///
/// # Errors
/// If the payload is malformed or implausible in any way. Never panics, and never allocates more than a small
/// multiple of the payload.
pub fn decode_any(kind: Kind, payload: &[u8]) -> Result<AnyMessage, DecodeError> {
    let Some((header, body)) = payload.split_at_checked(HEADER_BYTES) else {
        return Err(DecodeError::TooShort(payload.len()));
    };
    let decoded = match [header[0], header[1]] {
        CDR_LITTLE_ENDIAN => fields::<LittleEndian>(kind, body),
        CDR_BIG_ENDIAN => fields::<BigEndian>(kind, body),
        other => return Err(DecodeError::Representation(other)),
    };
    let (message, used) = decoded.map_err(|e| DecodeError::Malformed { kind, reason: e.to_string() })?;
    if body.len() - used > TRAILING_BYTES_MAX {
        return Err(DecodeError::Trailing { kind, bytes: body.len() - used });
    }
    message.check().map_err(|invalid| DecodeError::Invalid { kind, invalid })?;
    Ok(message)
}

/// Decodes a message of this kind that this program wrote, without validation.
///
/// # Errors
/// If the payload is malformed.
pub(crate) fn decode_unchecked(kind: Kind, payload: &[u8]) -> Result<AnyMessage, DecodeError> {
    let body = payload.get(HEADER_BYTES..).ok_or(DecodeError::TooShort(payload.len()))?;
    let decoded = fields::<LittleEndian>(kind, body);
    let (message, _) = decoded.map_err(|e| DecodeError::Malformed { kind, reason: e.to_string() })?;
    Ok(message)
}

/// Decodes the fields; returns the message and the number of bytes read.
fn fields<BO: ByteOrder>(kind: Kind, body: &[u8]) -> cdr_encoding::Result<(AnyMessage, usize)> {
    let mut deserializer = CdrDeserializer::<BO>::new(body);
    let message = kind.deserialize(&mut deserializer)?;
    Ok((message, deserializer.bytes_consumed()))
}

/// As [`decode_any`], for a single type.
///
/// # Errors
/// As [`decode_any`].
pub fn decode<T: RosMessage>(payload: &[u8]) -> Result<T, DecodeError> {
    let any = decode_any(T::KIND, payload)?;
    Ok(T::from_any(any).expect("a seed gives the message of its kind"))
}

/// Encodes a message, little-endian, padded to a multiple of four bytes.
///
/// # Panics
/// Never: ROS messages consist of structs, sequences, numbers and strings, all supported by CDR.
pub fn encode<T: Serialize>(message: &T) -> Vec<u8> {
    let mut payload = vec![CDR_LITTLE_ENDIAN[0], CDR_LITTLE_ENDIAN[1], 0, 0];
    let body = to_vec_with_size_hint::<T, LittleEndian>(message, encoded_bytes(message))
        .expect("CDR has all that ROS messages are made of");
    payload.extend_from_slice(&body);
    payload.resize(payload.len().next_multiple_of(4), 0);
    payload
}

/// Encoded length of a message, without header and padding, bytes.
pub fn encoded_bytes<T: Serialize>(message: &T) -> usize {
    let mut count = Count(0);
    let mut serializer = CdrSerializer::<_, LittleEndian>::new(&mut count);
    message.serialize(&mut serializer).expect("CDR has all that ROS messages are made of");
    count.0
}

struct Count(usize);

impl io::Write for Count {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 += bytes.len();
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A message that serializes with padding to a multiple of four bytes.
#[derive(Debug)]
pub(crate) struct Padded(pub(crate) AnyMessage);

impl Serialize for Padded {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let padding = encoded_bytes(&self.0).wrapping_neg() % 4;
        let mut tuple = serializer.serialize_tuple(1 + padding)?;
        tuple.serialize_element(&self.0)?;
        for _ in 0..padding {
            tuple.serialize_element(&0_u8)?;
        }
        tuple.end()
    }
}

#[cfg(test)]
mod tests;
