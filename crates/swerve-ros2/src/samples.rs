//! One sample of every message with every field filled, for tests of decoders and of other implementations.
//!
//! A deserializer without input generates the values: numbers within (0, 1) that differ from field to field, short
//! strings, sequences of two. Fields that must be consistent with each other are set afterwards.

use core::fmt;

use serde::de::value::Error;
use serde::de::{DeserializeSeed, Deserializer, SeqAccess, Visitor};
use serde::forward_to_deserialize_any;

use crate::message::{AnyMessage, Kind};
pub use crate::msg::sensor_msgs::large_cloud;

/// The sample of this kind; it passes its own check.
pub fn sample(kind: Kind) -> AnyMessage {
    let mut message =
        kind.deserialize(&mut Filler { count: 0, field: "" }).expect("the filler refuses nothing");
    message.fit();
    message
}

struct Filler {
    count: u32,
    field: &'static str,
}

impl Filler {
    /// A number in (0, 1) that is exact in single precision.
    fn next(&mut self) -> f64 {
        self.count = self.count % 62 + 1;
        f64::from(self.count) / 64.0
    }
}

impl<'de> Deserializer<'de> for &mut Filler {
    type Error = Error;

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Error> {
        Err(serde::de::Error::custom("messages are made of numbers, texts, structs and sequences"))
    }
    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_bool(true)
    }
    fn deserialize_i8<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_i8(1)
    }
    fn deserialize_u8<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_u8(1)
    }
    fn deserialize_u16<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.count += 1;
        visitor.visit_u16(self.count as u16 + 256)
    }
    fn deserialize_u32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.count += 1;
        visitor.visit_u32(self.count + 1000)
    }
    fn deserialize_i32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.count += 1;
        visitor.visit_i32(if self.field == "action" || self.field == "type" {
            1
        } else {
            self.count as i32 + 70_000
        })
    }
    fn deserialize_f32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_f32(self.next() as f32)
    }
    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_f64(self.next())
    }
    fn deserialize_str<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.count += 1;
        visitor.visit_string(format!("frame_{}", self.count))
    }
    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.deserialize_str(visitor)
    }
    fn deserialize_bytes<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_byte_buf(vec![1, 2, 3, 250, 5])
    }
    fn deserialize_byte_buf<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.deserialize_bytes(visitor)
    }
    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_seq(Elements { filler: self, left: 2, fields: &[] })
    }
    fn deserialize_tuple<V: Visitor<'de>>(self, left: usize, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_seq(Elements { filler: self, left, fields: &[] })
    }
    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        if name == "Quaternion" {
            return visitor
                .visit_seq(serde::de::value::SeqDeserializer::new([0.0, 0.6, 0.0, 0.8].into_iter()));
        }
        visitor.visit_seq(Elements { filler: self, left: fields.len(), fields })
    }

    forward_to_deserialize_any! {
        i16 i64 u64 i128 u128 char option unit unit_struct newtype_struct tuple_struct map enum identifier ignored_any
    }
}

struct Elements<'a> {
    filler: &'a mut Filler,
    left: usize,
    fields: &'static [&'static str],
}

impl<'de> SeqAccess<'de> for Elements<'_> {
    type Error = Error;
    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Error> {
        if self.left == 0 {
            return Ok(None);
        }
        if let Some(at) = self.fields.len().checked_sub(self.left) {
            self.filler.field = self.fields[at];
        }
        self.left -= 1;
        seed.deserialize(&mut *self.filler).map(Some)
    }
}

impl fmt::Debug for Filler {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Filler({})", self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_pass_their_own_check() {
        for &kind in Kind::ALL {
            assert_eq!(sample(kind).check(), Ok(()), "{kind}");
        }
        assert_eq!(AnyMessage::PointCloud2(large_cloud(1000)).check(), Ok(()));
    }
}
