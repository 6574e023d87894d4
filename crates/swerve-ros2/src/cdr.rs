//! Messages as bytes: the common data representation (CDR) of OMG, plain, version 1, as ROS 2 has it.
//!
//! A payload is four bytes that say the byte order, then the fields in order, each number aligned to its size.
//! [`decode`] takes both byte orders and believes nothing; [`encode`] writes little-endian, and fills up to a
//! multiple of four bytes: readers ignore what is behind the last field, but some (Cyclone DDS 0.10) drop the
//! last fragment of what is not filled up, which RustDDS does not do itself.

use std::io;

use byteorder::{BigEndian, ByteOrder, LittleEndian};
use cdr_encoding::{CdrDeserializer, CdrSerializer, to_vec_with_size_hint};
use serde::de::DeserializeSeed;
use serde::ser::SerializeTuple;
use serde::{Serialize, Serializer};

use crate::check::Invalid;
use crate::message::{AnyMessage, Kind, RosMessage};

/// Bytes in front of a payload: the representation and its options.
pub const HEADER_BYTES: usize = 4;
/// Bytes behind the last field of a payload: padding to a multiple of four, of eight at most.
const TRAILING_BYTES_MAX: usize = 7;
const CDR_BIG_ENDIAN: [u8; 2] = [0, 0];
const CDR_LITTLE_ENDIAN: [u8; 2] = [0, 1];

/// Why bytes are no message.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum DecodeError {
    /// Not even the four bytes in front.
    #[error("a payload of {0} bytes has no header")]
    TooShort(usize),
    /// Another representation than plain CDR.
    #[error("the payload is in representation {0:02x?}, not in plain CDR")]
    Representation([u8; 2]),
    /// The fields are not there.
    #[error("the payload is no {kind}: {reason}")]
    Malformed {
        /// The form that was expected.
        kind: Kind,
        /// The form that was found.
        reason: String,
    },
    /// Bytes are left: another message, or a newer version of it.
    #[error("{bytes} bytes are left behind the last field of {kind}")]
    Trailing {
        /// The form that was expected.
        kind: Kind,
        /// How many are left.
        bytes: usize,
    },
    /// The fields are there, but cannot be true.
    #[error("a {kind} is refused: {invalid}")]
    Invalid {
        /// Its type.
        kind: Kind,
        /// The mistake in it.
        invalid: Invalid,
    },
}

/// The message of this kind in a payload, checked.
///
/// # Errors
/// Anything is possible in what comes from outside; never panics, and never takes more memory than a small
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

/// The message of this kind in a payload that this program wrote: it is not checked, ours to answer for.
///
/// # Errors
/// Bytes that are none.
pub(crate) fn decode_unchecked(kind: Kind, payload: &[u8]) -> Result<AnyMessage, DecodeError> {
    let body = payload.get(HEADER_BYTES..).ok_or(DecodeError::TooShort(payload.len()))?;
    let decoded = fields::<LittleEndian>(kind, body);
    let (message, _) = decoded.map_err(|e| DecodeError::Malformed { kind, reason: e.to_string() })?;
    Ok(message)
}

/// The message and how many bytes it took.
fn fields<BO: ByteOrder>(kind: Kind, body: &[u8]) -> cdr_encoding::Result<(AnyMessage, usize)> {
    let mut deserializer = CdrDeserializer::<BO>::new(body);
    let message = kind.deserialize(&mut deserializer)?;
    Ok((message, deserializer.bytes_consumed()))
}

/// As [`decode_any`], for one type.
///
/// # Errors
/// As [`decode_any`].
pub fn decode<T: RosMessage>(payload: &[u8]) -> Result<T, DecodeError> {
    let any = decode_any(T::KIND, payload)?;
    Ok(T::from_any(any).expect("a seed gives the message of its kind"))
}

/// The payload of a message, little-endian, filled up to a multiple of four bytes.
///
/// # Panics
/// Never: ROS messages are structs, sequences, numbers and texts, all of which CDR has.
pub fn encode<T: Serialize>(message: &T) -> Vec<u8> {
    let mut payload = vec![CDR_LITTLE_ENDIAN[0], CDR_LITTLE_ENDIAN[1], 0, 0];
    let body = to_vec_with_size_hint::<T, LittleEndian>(message, encoded_bytes(message))
        .expect("CDR has all that ROS messages are made of");
    payload.extend_from_slice(&body);
    payload.resize(payload.len().next_multiple_of(4), 0);
    payload
}

/// How many bytes a message takes, without header and padding.
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

/// A message that serializes with the bytes behind it that make it a multiple of four long.
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
