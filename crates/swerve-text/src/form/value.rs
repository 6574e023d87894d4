//! TOML values as a serde deserializer whose errors contain the path of the value.
//!
//! It is stricter than usual for serde formats: a struct is read from a table only, not from an array in the order of
//! its fields, and an array of a fixed length must have that length.

use std::fmt;

use serde::de::value::{StrDeserializer, StringDeserializer};
use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Expected, IntoDeserializer, MapAccess, SeqAccess, Unexpected,
    VariantAccess, Visitor,
};
use serde::forward_to_deserialize_any;
use toml::{Table, Value};

use crate::words::list;

/// One component of the path to a value in a table.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum Part {
    /// Key of a table.
    Key(String),
    /// Index in an array, starting at 0.
    Index(usize),
}

/// First error of a table for a type.
#[derive(Debug)]
pub(super) struct Fault {
    /// Path of the value, last component first.
    way: Vec<Part>,
    pub(super) kind: Kind,
}

/// Kinds of errors.
#[derive(Debug)]
pub(super) enum Kind {
    /// A missing key.
    Missing(String),
    /// An unknown key.
    UnknownKey { wrong: String, known: &'static [&'static str] },
    /// An unknown name.
    UnknownName { wrong: String, known: &'static [&'static str] },
    /// A value of another kind than expected, in serde's words.
    Expected(String),
    /// An error reported by the type itself.
    Other(String),
}

impl Fault {
    fn new(kind: Kind) -> Self {
        Self { way: Vec::new(), kind }
    }

    fn within(mut self, part: Part) -> Self {
        self.way.push(part);
        self
    }

    /// Path of the value from the top; if the value is missing, where it should be.
    pub(super) fn path(&self) -> Vec<Part> {
        let missing = match &self.kind {
            Kind::Missing(name) => Some(Part::Key(name.clone())),
            _ => None,
        };
        self.way.iter().rev().cloned().chain(missing).collect()
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.kind)
    }
}

impl std::error::Error for Fault {}

impl serde::de::Error for Fault {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self::new(Kind::Other(message.to_string()))
    }

    fn invalid_type(_: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::new(Kind::Expected(expected.to_string()))
    }

    fn invalid_value(_: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::new(Kind::Expected(expected.to_string()))
    }

    fn invalid_length(_: usize, expected: &dyn Expected) -> Self {
        Self::new(Kind::Expected(expected.to_string()))
    }

    fn unknown_variant(wrong: &str, known: &'static [&'static str]) -> Self {
        Self::new(Kind::UnknownName { wrong: wrong.to_owned(), known })
    }

    fn unknown_field(wrong: &str, known: &'static [&'static str]) -> Self {
        Self::new(Kind::UnknownKey { wrong: wrong.to_owned(), known })
    }

    fn missing_field(name: &'static str) -> Self {
        Self::new(Kind::Missing(name.to_owned()))
    }
}

/// One value.
#[derive(Clone, Copy)]
pub(super) struct Source<'a>(pub(super) &'a Value);

/// A table as a deserializer.
#[derive(Clone, Copy)]
pub(super) struct Whole<'a>(pub(super) &'a Table);

fn table<'de, V: Visitor<'de>>(table: &'de Table, visitor: V) -> Result<V::Value, Fault> {
    visitor.visit_map(Entries { left: table.iter(), next: None })
}

fn array<'de, V: Visitor<'de>>(items: &'de [Value], visitor: V) -> Result<V::Value, Fault> {
    let expected = Wanted(&visitor).to_string();
    let mut left = Items { left: items.iter(), index: 0 };
    let value = visitor.visit_seq(&mut left)?;
    if left.left.len() == 0 { Ok(value) } else { Err(Fault::new(Kind::Expected(expected))) }
}

fn one_of(names: &[&str]) -> Fault {
    Fault::new(Kind::Expected(format!("one of {}", list(names))))
}

/// Displays what a visitor expects.
struct Wanted<'v, V>(&'v V);

impl<'de, V: Visitor<'de>> fmt::Display for Wanted<'_, V> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.expecting(f)
    }
}

impl<'de> Deserializer<'de> for Source<'de> {
    type Error = Fault;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        match self.0 {
            Value::String(text) => visitor.visit_borrowed_str(text),
            Value::Integer(n) => visitor.visit_i64(*n),
            Value::Float(x) => visitor.visit_f64(*x),
            Value::Boolean(truth) => visitor.visit_bool(*truth),
            // No configuration type accepts a date.
            Value::Datetime(_) => Err(Fault::new(Kind::Expected(Wanted(&visitor).to_string()))),
            Value::Array(items) => array(items, visitor),
            Value::Table(inner) => table(inner, visitor),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Fault> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        match self.0 {
            Value::Table(inner) => table(inner, visitor),
            _ => Err(Fault::new(Kind::Expected(Wanted(&visitor).to_string()))),
        }
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        names: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        match self.0 {
            Value::String(name) => visitor.visit_enum(name.as_str().into_deserializer()),
            Value::Table(inner) => {
                let mut entries = inner.iter();
                match (entries.next(), entries.next()) {
                    (Some((name, content)), None) => visitor.visit_enum(Variant { name, content, names }),
                    _ => Err(one_of(names)),
                }
            }
            _ => Err(one_of(names)),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple
        tuple_struct map identifier ignored_any
    }
}

impl<'de> Deserializer<'de> for Whole<'de> {
    type Error = Fault;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        table(self.0, visitor)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Fault> {
        visitor.visit_newtype_struct(self)
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple
        tuple_struct map struct enum identifier ignored_any
    }
}

struct Entries<'de> {
    left: toml::map::Iter<'de, String, Value>,
    next: Option<(&'de str, &'de Value)>,
}

impl<'de> MapAccess<'de> for Entries<'de> {
    type Error = Fault;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, Fault> {
        let Some((name, value)) = self.left.next() else { return Ok(None) };
        self.next = Some((name, value));
        let key: StrDeserializer<'_, Fault> = name.as_str().into_deserializer();
        seed.deserialize(key).map(Some).map_err(|fault| fault.within(Part::Key(name.clone())))
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, Fault> {
        let (name, value) = self.next.take().expect("a key comes before its value");
        seed.deserialize(Source(value)).map_err(|fault| fault.within(Part::Key(name.to_owned())))
    }
}

struct Items<'de> {
    left: std::slice::Iter<'de, Value>,
    index: usize,
}

impl<'de> SeqAccess<'de> for &mut Items<'de> {
    type Error = Fault;

    fn next_element_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, Fault> {
        let Some(value) = self.left.next() else { return Ok(None) };
        let index = self.index;
        self.index += 1;
        seed.deserialize(Source(value)).map(Some).map_err(|fault| fault.within(Part::Index(index)))
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.left.len())
    }
}

/// `{ name = content }`.
struct Variant<'de> {
    name: &'de str,
    content: &'de Value,
    names: &'static [&'static str],
}

impl<'de> EnumAccess<'de> for Variant<'de> {
    type Error = Fault;
    type Variant = Content<'de>;

    fn variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<(S::Value, Content<'de>), Fault> {
        let name: StringDeserializer<Fault> = self.name.to_owned().into_deserializer();
        let value = seed.deserialize(name).map_err(|fault| fault.within(Part::Key(self.name.to_owned())))?;
        Ok((value, Content(self)))
    }
}

struct Content<'de>(Variant<'de>);

impl Content<'_> {
    fn within(name: &str) -> impl FnOnce(Fault) -> Fault {
        move |fault| fault.within(Part::Key(name.to_owned()))
    }
}

impl<'de> VariantAccess<'de> for Content<'de> {
    type Error = Fault;

    fn unit_variant(self) -> Result<(), Fault> {
        match self.0.content {
            Value::Table(inner) if inner.is_empty() => Ok(()),
            _ => Err(one_of(self.0.names)),
        }
    }

    fn newtype_variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<S::Value, Fault> {
        let Variant { name, content, .. } = self.0;
        seed.deserialize(Source(content)).map_err(Self::within(name))
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, Fault> {
        let Variant { name, content, .. } = self.0;
        Source(content).deserialize_any(visitor).map_err(Self::within(name))
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        let Variant { name, content, .. } = self.0;
        Source(content).deserialize_struct("", fields, visitor).map_err(Self::within(name))
    }
}
