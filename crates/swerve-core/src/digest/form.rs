//! Serialized form that digests are computed from: fixed-width little-endian words, each written with one store.
//!
//! | value | bytes |
//! |---|---|
//! | integer, `char`, float | native width, little-endian; a float by its bits |
//! | `bool` | one byte, 0 or 1 |
//! | string, bytes | length in eight bytes, then the bytes |
//! | option | one byte, 0 or 1, then the value if any |
//! | sequence, map | element count in eight bytes, then the elements |
//! | sequence or map of unknown length | the byte 1 before each element, the byte 0 after the last |
//! | tuple, struct, unit, newtype | the fields, nothing added; a skipped field is the byte 0xff |
//! | field with [`unless_default`](super::unless_default) | nothing if it has its default, else its value |
//! | variant | index in four bytes, then the fields |
//!
//! Floats are hashed by their bits: 0.0 and -0.0 differ, and so do NaNs of different sign or payload. The form is the
//! same on any machine; human-readable variants of types are not used (`is_human_readable` is false).

use core::fmt;

use serde::{Serialize, ser};
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

/// Name by which a [`Form`] recognises a default that it leaves out.
pub(super) const DEFAULT: &str = "swerve default";

/// Size of the buffer that a form is collected in, bytes: most messages fit and are hashed at once.
const FORM_MAX: usize = 256;

/// A serialized form that is being hashed.
pub(super) struct Form {
    bytes: [u8; FORM_MAX],
    len: usize,
    /// Hasher for data beyond the buffer; `None` while everything fits.
    rest: Option<Box<Xxh3>>,
}

impl Form {
    pub(super) fn new() -> Self {
        Self { bytes: [0; FORM_MAX], len: 0, rest: None }
    }

    /// A form whose bytes follow those that `xxh` has hashed.
    pub(super) fn after(xxh: Xxh3) -> Self {
        Self { rest: Some(Box::new(xxh)), ..Self::new() }
    }

    #[inline]
    pub(super) fn take_in<T: Serialize + ?Sized>(&mut self, value: &T) {
        value.serialize(self).expect("message types serialize without fail");
    }

    #[inline]
    fn word<const N: usize>(&mut self, word: [u8; N]) {
        if self.len + N > FORM_MAX {
            self.spill();
        }
        // A single store even with little inlining: copying slices may be a function call.
        if let Some(room) = self.bytes.get_mut(self.len..).and_then(<[u8]>::first_chunk_mut) {
            *room = word;
        }
        self.len += N;
    }

    fn run(&mut self, bytes: &[u8]) {
        self.word((bytes.len() as u64).to_le_bytes());
        if self.len + bytes.len() > FORM_MAX {
            self.spill();
        }
        if bytes.len() > FORM_MAX {
            self.rest.get_or_insert_default().update(bytes);
        } else {
            self.bytes[self.len..self.len + bytes.len()].copy_from_slice(bytes);
            self.len += bytes.len();
        }
    }

    #[cold]
    fn spill(&mut self) {
        self.rest.get_or_insert_default().update(&self.bytes[..self.len]);
        self.len = 0;
    }

    pub(super) fn spilled(mut self) -> Xxh3 {
        self.spill();
        self.rest.map(|rest| *rest).unwrap_or_default()
    }

    /// Hash of everything taken in. By reference, because moving the bytes costs more than hashing a small form;
    /// inlined, so that the form's length is known at compile time for plain types.
    #[inline(always)]
    pub(super) fn hash(&mut self) -> u64 {
        if self.rest.is_none() { xxh3_64(&self.bytes[..self.len]) } else { self.long_hash() }
    }

    #[cold]
    fn long_hash(&mut self) -> u64 {
        self.spill();
        self.rest.get_or_insert_default().digest()
    }
}

/// Error of a type's `Serialize`.
#[derive(Debug)]
pub(super) struct Refused(String);

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl core::error::Error for Refused {}

impl ser::Error for Refused {
    fn custom<T: fmt::Display>(said: T) -> Self {
        Self(said.to_string())
    }
}

/// Parts of a compound value; elements of a sequence of unknown length are marked one by one.
pub(super) struct Parts<'a> {
    form: &'a mut Form,
    marked: bool,
}

impl<'a> Parts<'a> {
    fn several(form: &'a mut Form, n: Option<usize>) -> Self {
        if let Some(n) = n {
            form.word((n as u64).to_le_bytes());
        }
        Self { form, marked: n.is_none() }
    }

    fn plain(form: &'a mut Form) -> Self {
        Self { form, marked: false }
    }

    #[inline]
    fn part<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Refused> {
        value.serialize(&mut *self.form)
    }

    #[inline]
    fn element<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Refused> {
        if self.marked {
            self.form.word([1]);
        }
        self.part(value)
    }

    #[inline]
    fn close(self) {
        if self.marked {
            self.form.word([0]);
        }
    }
}

macro_rules! words {
    ($($method:ident $type:ty;)*) => {$(
        #[inline]
        fn $method(self, value: $type) -> Result<(), Refused> {
            self.word(value.to_le_bytes());
            Ok(())
        }
    )*};
}

impl<'a> ser::Serializer for &'a mut Form {
    type Ok = ();
    type Error = Refused;
    type SerializeSeq = Parts<'a>;
    type SerializeTuple = Parts<'a>;
    type SerializeTupleStruct = Parts<'a>;
    type SerializeTupleVariant = Parts<'a>;
    type SerializeMap = Parts<'a>;
    type SerializeStruct = Parts<'a>;
    type SerializeStructVariant = Parts<'a>;

    words! {
        serialize_i8 i8;
        serialize_i16 i16;
        serialize_i32 i32;
        serialize_i64 i64;
        serialize_i128 i128;
        serialize_u8 u8;
        serialize_u16 u16;
        serialize_u32 u32;
        serialize_u64 u64;
        serialize_u128 u128;
        serialize_f32 f32;
        serialize_f64 f64;
    }

    #[inline]
    fn serialize_bool(self, value: bool) -> Result<(), Refused> {
        self.serialize_u8(u8::from(value))
    }

    fn serialize_char(self, value: char) -> Result<(), Refused> {
        self.serialize_u32(u32::from(value))
    }

    fn serialize_str(self, value: &str) -> Result<(), Refused> {
        self.serialize_bytes(value.as_bytes())
    }

    fn serialize_bytes(self, value: &[u8]) -> Result<(), Refused> {
        self.run(value);
        Ok(())
    }

    #[inline]
    fn serialize_none(self) -> Result<(), Refused> {
        self.serialize_u8(0)
    }

    #[inline]
    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<(), Refused> {
        self.word([1]);
        value.serialize(self)
    }

    fn serialize_unit(self) -> Result<(), Refused> {
        Ok(())
    }

    fn serialize_unit_struct(self, _: &'static str) -> Result<(), Refused> {
        Ok(())
    }

    #[inline]
    fn serialize_unit_variant(self, _: &'static str, index: u32, _: &'static str) -> Result<(), Refused> {
        self.serialize_u32(index)
    }

    #[inline]
    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        name: &'static str,
        value: &T,
    ) -> Result<(), Refused> {
        if name == DEFAULT { Ok(()) } else { value.serialize(self) }
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        index: u32,
        _: &'static str,
        value: &T,
    ) -> Result<(), Refused> {
        self.word(index.to_le_bytes());
        value.serialize(self)
    }

    fn serialize_seq(self, n: Option<usize>) -> Result<Parts<'a>, Refused> {
        Ok(Parts::several(self, n))
    }

    #[inline]
    fn serialize_tuple(self, _: usize) -> Result<Parts<'a>, Refused> {
        Ok(Parts::plain(self))
    }

    #[inline]
    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<Parts<'a>, Refused> {
        Ok(Parts::plain(self))
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        index: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Parts<'a>, Refused> {
        self.word(index.to_le_bytes());
        Ok(Parts::plain(self))
    }

    fn serialize_map(self, n: Option<usize>) -> Result<Parts<'a>, Refused> {
        Ok(Parts::several(self, n))
    }

    #[inline]
    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Parts<'a>, Refused> {
        Ok(Parts::plain(self))
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        index: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Parts<'a>, Refused> {
        self.word(index.to_le_bytes());
        Ok(Parts::plain(self))
    }

    #[inline]
    fn is_human_readable(&self) -> bool {
        false
    }
}

macro_rules! parts {
    ($($part:ident::$method:ident $inner:ident;)*) => {$(
        impl ser::$part for Parts<'_> {
            type Ok = ();
            type Error = Refused;

            #[inline]
            fn $method<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Refused> {
                self.$inner(value)
            }

            #[inline]
            fn end(self) -> Result<(), Refused> {
                self.close();
                Ok(())
            }
        }
    )*};
}

parts! {
    SerializeSeq::serialize_element element;
    SerializeTuple::serialize_element part;
    SerializeTupleStruct::serialize_field part;
    SerializeTupleVariant::serialize_field part;
}

macro_rules! fields {
    ($($part:ident;)*) => {$(
        impl ser::$part for Parts<'_> {
            type Ok = ();
            type Error = Refused;

            #[inline]
            fn serialize_field<T: Serialize + ?Sized>(
                &mut self,
                _: &'static str,
                value: &T,
            ) -> Result<(), Refused> {
                self.part(value)
            }

            fn skip_field(&mut self, _: &'static str) -> Result<(), Refused> {
                self.form.word([0xff]);
                Ok(())
            }

            #[inline]
            fn end(self) -> Result<(), Refused> {
                Ok(())
            }
        }
    )*};
}

fields! {
    SerializeStruct;
    SerializeStructVariant;
}

impl ser::SerializeMap for Parts<'_> {
    type Ok = ();
    type Error = Refused;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), Refused> {
        self.element(key)
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Refused> {
        self.part(value)
    }

    fn end(self) -> Result<(), Refused> {
        self.close();
        Ok(())
    }
}
