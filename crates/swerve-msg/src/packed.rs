use core::fmt;
use core::marker::PhantomData;
use core::ops::{Deref, DerefMut};

use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A number that [`Packed`] can hold.
pub trait Packable: bytemuck::Pod + Default {}

impl Packable for u8 {}
impl Packable for u16 {}
impl Packable for u32 {}
impl Packable for f32 {}

// What is in memory is what is serialized.
const _: () = assert!(cfg!(target_endian = "little"), "logs and digests hold little-endian numbers");

/// Many numbers of one kind, as they fill images and point clouds.
///
/// In memory a vector; serialized **one run of bytes**, little-endian, so that a digest or a log takes in a
/// megabyte at once instead of number by number. A run whose length is no multiple of a number's is refused
/// when it is read.
#[derive(Clone, PartialEq, Default)]
pub struct Packed<T>(pub Vec<T>);

impl<T: Packable> Packed<T> {
    /// Makes it `n` numbers long, all zero, in the memory that it has.
    pub fn reset(&mut self, n: usize) {
        self.0.clear();
        self.0.resize(n, T::default());
    }
}

impl<T> Deref for Packed<T> {
    type Target = Vec<T>;

    fn deref(&self) -> &Vec<T> {
        &self.0
    }
}

impl<T> DerefMut for Packed<T> {
    fn deref_mut(&mut self) -> &mut Vec<T> {
        &mut self.0
    }
}

impl<T> From<Vec<T>> for Packed<T> {
    fn from(numbers: Vec<T>) -> Self {
        Self(numbers)
    }
}

/// Says how many there are, and the first few.
impl<T: fmt::Debug> fmt::Debug for Packed<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN: usize = 8;
        write!(f, "{} x {:?}", self.0.len(), &self.0[..self.0.len().min(SHOWN)])?;
        if self.0.len() > SHOWN { f.write_str("...") } else { Ok(()) }
    }
}

impl<T: Packable> Serialize for Packed<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(bytemuck::cast_slice(&self.0))
    }
}

impl<'de, T: Packable> Deserialize<'de> for Packed<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_byte_buf(Bytes(PhantomData))
    }
}

/// Takes a run of bytes, or, from formats that have none, a sequence of them.
struct Bytes<T>(PhantomData<T>);

impl<'de, T: Packable> Visitor<'de> for Bytes<T> {
    type Value = Packed<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "bytes, {} for each number", size_of::<T>())
    }

    fn visit_bytes<E: Error>(self, bytes: &[u8]) -> Result<Packed<T>, E> {
        if !bytes.len().is_multiple_of(size_of::<T>()) {
            return Err(E::invalid_length(bytes.len(), &self));
        }
        let mut numbers = vec![T::default(); bytes.len() / size_of::<T>()];
        bytemuck::cast_slice_mut(&mut numbers).copy_from_slice(bytes);
        Ok(Packed(numbers))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Packed<T>, A::Error> {
        let mut bytes = Vec::new();
        while let Some(byte) = sequence.next_element()? {
            bytes.push(byte);
        }
        self.visit_bytes(&bytes)
    }
}

#[cfg(test)]
mod tests {
    use swerve_core::digest_of;

    use super::*;

    fn cbor<T: Packable>(numbers: &Packed<T>) -> Vec<u8> {
        let mut out = Vec::new();
        ciborium::into_writer(numbers, &mut out).unwrap();
        out
    }

    #[test]
    fn numbers_are_one_run_of_little_endian_bytes() {
        let numbers = Packed(vec![1.0_f32, -2.5, f32::INFINITY]);
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        // A byte string of twelve (RFC 8949, 3.1: major type 2).
        assert_eq!(cbor(&numbers), [&[0x4c_u8][..], &bytes].concat());
        assert_eq!(cbor(&Packed(vec![0x0102_u16])), [0x42, 0x02, 0x01]);
        assert_eq!(digest_of(&numbers), digest_of(&Packed(bytes)), "the digest is that of the bytes");
    }

    #[test]
    fn what_is_written_is_read_back_whatever_its_length() {
        for n in [0, 1, 1000, 100_000] {
            let numbers = Packed((0..n).map(|i| i as f32 * 0.5).collect());
            assert_eq!(ciborium::from_reader::<Packed<f32>, _>(&cbor(&numbers)[..]).unwrap(), numbers);
            let ids = Packed((0..n).map(|i: u32| i.wrapping_mul(77_777)).collect());
            assert_eq!(ciborium::from_reader::<Packed<u32>, _>(&cbor(&ids)[..]).unwrap(), ids);
        }
        let text = serde_json::to_string(&Packed(vec![1.5_f32])).unwrap();
        assert_eq!(text, "[0,0,192,63]");
        assert_eq!(serde_json::from_str::<Packed<f32>>(&text).unwrap(), Packed(vec![1.5]));
    }

    #[test]
    fn half_a_number_is_refused() {
        let said = ciborium::from_reader::<Packed<f32>, _>(&[0x43_u8, 1, 2, 3][..]).unwrap_err().to_string();
        assert!(said.contains("length 3") && said.contains("4 for each number"), "{said}");
        assert!(serde_json::from_str::<Packed<u16>>("[1]").is_err());
        assert!(serde_json::from_str::<Packed<u16>>("[1, 256]").is_err());
        assert!(serde_json::from_str::<Packed<u16>>("12").is_err());
    }

    #[test]
    fn a_reset_keeps_the_memory() {
        let mut numbers = Packed(vec![7_u16; 100]);
        let before = numbers.as_ptr();
        numbers.reset(60);
        assert_eq!((numbers.len(), numbers[59], numbers.as_ptr()), (60, 0, before));
        assert_eq!(format!("{:?}", Packed(vec![1_u8; 9])), "9 x [1, 1, 1, 1, 1, 1, 1, 1]...");
    }
}
