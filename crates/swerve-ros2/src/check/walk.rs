//! Serializer without output that checks every number and string of a message.

use core::fmt;

use serde::Serialize;
use serde::ser::{self, Impossible};

use super::{Invalid, NAME_MAX, NUMBER_MAX, TEXT_MAX, Why};

/// Checks every number and string of `message`; the fields named in `may_be_nan` may be NaN.
///
/// # Errors
/// The first field that is not finite, exceeds [`NUMBER_MAX`], has nanoseconds of a full second or more, is not a
/// valid frame name, or is too long.
pub fn check_numbers<T: Serialize>(message: &T, may_be_nan: &[&str]) -> Result<(), Invalid> {
    message.serialize(&mut Walk { path: Vec::new(), may_be_nan }).map_err(|Stop(invalid)| *invalid)
}

struct Walk<'a> {
    path: Vec<Step>,
    may_be_nan: &'a [&'a str],
}

#[derive(Clone, Copy)]
enum Step {
    Field(&'static str),
    Index(usize),
}

#[derive(Debug)]
struct Stop(Box<Invalid>);

impl fmt::Display for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl std::error::Error for Stop {}

impl ser::Error for Stop {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self(Box::new(Invalid { field: String::new(), why: Why::Name(message.to_string()) }))
    }
}

impl Walk<'_> {
    fn stop(&self, why: Why) -> Stop {
        let mut field = String::new();
        for step in &self.path {
            match step {
                Step::Field(name) if field.is_empty() => field.push_str(name),
                Step::Field(name) => field = field + "." + name,
                Step::Index(i) => field += &format!("[{i}]"),
            }
        }
        Stop(Box::new(Invalid { field, why }))
    }

    /// Innermost field name of the present path.
    fn name(&self) -> &'static str {
        let names = self.path.iter().rev().find_map(|step| match step {
            Step::Field(name) => Some(*name),
            Step::Index(_) => None,
        });
        names.unwrap_or_default()
    }

    fn number(&self, value: f64) -> Result<(), Stop> {
        if value.abs() <= NUMBER_MAX || value.is_nan() && self.may_be_nan.contains(&self.name()) {
            return Ok(());
        }
        Err(self.stop(if value.is_finite() {
            Why::OutOfRange { value, min: -NUMBER_MAX, max: NUMBER_MAX }
        } else {
            Why::NotFinite
        }))
    }

    fn text(&self, text: &str) -> Result<(), Stop> {
        if text.len() > TEXT_MAX {
            return Err(self.stop(Why::TooLong(text.len())));
        }
        let is_name = matches!(self.name(), "frame_id" | "child_frame_id" | "encoding" | "format" | "name");
        if is_name && (text.len() > NAME_MAX || text.chars().any(char::is_control)) {
            return Err(self.stop(Why::Name(text.chars().take(32).collect())));
        }
        Ok(())
    }

    fn inside<T: ?Sized + Serialize>(&mut self, step: Step, value: &T) -> Result<(), Stop> {
        self.path.push(step);
        value.serialize(&mut *self)?;
        self.path.pop();
        Ok(())
    }
}

/// Visitor of fields and elements; counts the elements.
struct Inside<'w, 'a> {
    walk: &'w mut Walk<'a>,
    index: usize,
}

impl Inside<'_, '_> {
    fn next<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Stop> {
        self.index += 1;
        self.walk.inside(Step::Index(self.index - 1), value)
    }
}

impl ser::SerializeSeq for Inside<'_, '_> {
    type Ok = ();
    type Error = Stop;
    fn serialize_element<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Stop> {
        self.next(value)
    }
    fn end(self) -> Result<(), Stop> {
        Ok(())
    }
}

impl ser::SerializeTuple for Inside<'_, '_> {
    type Ok = ();
    type Error = Stop;
    fn serialize_element<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Stop> {
        self.next(value)
    }
    fn end(self) -> Result<(), Stop> {
        Ok(())
    }
}

impl ser::SerializeStruct for Inside<'_, '_> {
    type Ok = ();
    type Error = Stop;
    fn serialize_field<T: ?Sized + Serialize>(&mut self, key: &'static str, value: &T) -> Result<(), Stop> {
        self.walk.inside(Step::Field(key), value)
    }
    fn end(self) -> Result<(), Stop> {
        Ok(())
    }
}

macro_rules! nothing {
    ($($method:ident: $ty:ty),*) => { $(fn $method(self, _: $ty) -> Result<(), Stop> { Ok(()) })* };
}

impl<'w, 'a> ser::Serializer for &'w mut Walk<'a> {
    type Ok = ();
    type Error = Stop;
    type SerializeSeq = Inside<'w, 'a>;
    type SerializeTuple = Inside<'w, 'a>;
    type SerializeStruct = Inside<'w, 'a>;
    type SerializeTupleStruct = Impossible<(), Stop>;
    type SerializeTupleVariant = Impossible<(), Stop>;
    type SerializeStructVariant = Impossible<(), Stop>;
    type SerializeMap = Impossible<(), Stop>;

    nothing!(serialize_bool: bool, serialize_i8: i8, serialize_i16: i16, serialize_i32: i32,
        serialize_i64: i64, serialize_u8: u8, serialize_u16: u16, serialize_u64: u64,
        serialize_char: char, serialize_bytes: &[u8]);

    fn serialize_u32(self, value: u32) -> Result<(), Stop> {
        if self.name() == "nanosec" && value >= 1_000_000_000 {
            return Err(self.stop(Why::Nanoseconds(value)));
        }
        Ok(())
    }
    fn serialize_f32(self, value: f32) -> Result<(), Stop> {
        self.number(f64::from(value))
    }
    fn serialize_f64(self, value: f64) -> Result<(), Stop> {
        self.number(value)
    }
    fn serialize_str(self, text: &str) -> Result<(), Stop> {
        self.text(text)
    }
    fn serialize_seq(self, _: Option<usize>) -> Result<Inside<'w, 'a>, Stop> {
        Ok(Inside { walk: self, index: 0 })
    }
    fn serialize_tuple(self, _: usize) -> Result<Inside<'w, 'a>, Stop> {
        Ok(Inside { walk: self, index: 0 })
    }
    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Inside<'w, 'a>, Stop> {
        Ok(Inside { walk: self, index: 0 })
    }

    // Not used in ROS messages: options, units, enumerations with contents, maps.
    fn serialize_none(self) -> Result<(), Stop> {
        Ok(())
    }
    fn serialize_some<T: ?Sized + Serialize>(self, value: &T) -> Result<(), Stop> {
        value.serialize(self)
    }
    fn serialize_unit(self) -> Result<(), Stop> {
        Ok(())
    }
    fn serialize_unit_struct(self, _: &'static str) -> Result<(), Stop> {
        Ok(())
    }
    fn serialize_unit_variant(self, _: &'static str, _: u32, _: &'static str) -> Result<(), Stop> {
        Ok(())
    }
    fn serialize_newtype_struct<T: ?Sized + Serialize>(self, _: &'static str, value: &T) -> Result<(), Stop> {
        value.serialize(self)
    }
    fn serialize_newtype_variant<T: ?Sized + Serialize>(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        value: &T,
    ) -> Result<(), Stop> {
        value.serialize(self)
    }
    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<Impossible<(), Stop>, Stop> {
        Err(ser::Error::custom("a tuple struct"))
    }
    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Impossible<(), Stop>, Stop> {
        Err(ser::Error::custom("an enumeration"))
    }
    fn serialize_map(self, _: Option<usize>) -> Result<Impossible<(), Stop>, Stop> {
        Err(ser::Error::custom("a map"))
    }
    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Impossible<(), Stop>, Stop> {
        Err(ser::Error::custom("an enumeration"))
    }
}
