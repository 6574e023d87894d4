//! Large arrays of numbers, serialized as one byte string.

use core::fmt;
use core::marker::PhantomData;
use core::ops::{Deref, DerefMut};
use std::sync::Arc;

use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::block::{self, Block, BlockId, Form, Memory, Room};

/// Element type of [`Packed`].
pub trait Packable: bytemuck::Pod + Default {
    /// The bytes of a slice of numbers.
    fn bytes(numbers: &[Self]) -> &[u8] {
        bytemuck::cast_slice(numbers)
    }
}

impl Packable for u8 {}
impl Packable for u16 {}
impl Packable for u32 {}
impl Packable for f32 {}

// Serialized form and memory are identical.
const _: () = assert!(cfg!(target_endian = "little"), "logs and digests hold little-endian numbers");

/// Array of numbers of one type, as in images and point clouds.
///
/// In memory it is a vector or a block that other processes read in place ([`Packed::in_memory`]). Serialized it is
/// **one byte string**, little-endian, so that digests and logs process a megabyte at once instead of number by
/// number. A byte string whose length is not a multiple of the element size is rejected.
pub struct Packed<T>(Store<T>);

enum Store<T> {
    Own(Vec<T>),
    /// The first `n` numbers of a block that is being written.
    Room(Box<dyn Room>, usize),
    /// The first `n` numbers of an immutable block.
    Block(Arc<dyn Block>, usize),
}

/// The first `n` numbers of a block: fewer if it is too short, none if it is misaligned.
fn numbers<T: Packable>(bytes: &[u8], n: usize) -> &[T] {
    let whole = bytes.len() / size_of::<T>();
    let bytes = &bytes[..whole.min(n) * size_of::<T>()];
    bytemuck::try_cast_slice(bytes).unwrap_or_default()
}

impl<T: Packable> Packed<T> {
    /// Allocates `n` zeros in `memory`, or in a vector if that is `None` or full.
    pub fn in_memory(memory: Option<&dyn Memory>, n: usize) -> Self {
        let room = memory.and_then(|memory| memory.room(n * size_of::<T>()));
        match room.filter(|room| numbers::<T>(room.bytes(), n).len() == n) {
            Some(room) => Self(Store::Room(room, n)),
            None => Self(Store::Own(vec![T::default(); n])),
        }
    }

    /// Ends writing to shared memory. Does nothing for a vector.
    ///
    /// # Errors
    /// If the memory cannot be shared. The numbers are lost.
    pub fn seal(&mut self) -> Result<(), String> {
        self.0 = match core::mem::replace(&mut self.0, Store::Own(Vec::new())) {
            Store::Room(room, n) => Store::Block(room.seal()?, n),
            other => other,
        };
        Ok(())
    }

    /// Place of the sealed block; `None` if not in shared memory or not sealed.
    pub fn place(&self) -> Option<BlockId> {
        match &self.0 {
            Store::Block(block, _) => Some(block.place()),
            Store::Own(_) | Store::Room(..) => None,
        }
    }

    /// Sets the length to `n`, all zero, and keeps the memory if possible.
    pub fn reset(&mut self, n: usize) {
        match &mut self.0 {
            Store::Room(room, len) if numbers::<T>(room.bytes(), n).len() == n => {
                *len = n;
                room.bytes_mut()[..n * size_of::<T>()].fill(0);
            }
            _ => {
                let own = self.own();
                own.clear();
                own.resize(n, T::default());
            }
        }
    }

    /// Appends a number.
    pub fn push(&mut self, number: T) {
        self.own().push(number);
    }

    /// Removes and returns the last number.
    pub fn pop(&mut self) -> Option<T> {
        let last = self.last().copied();
        self.truncate(self.len().saturating_sub(1));
        last
    }

    /// Removes all numbers and keeps the memory.
    pub fn clear(&mut self) {
        self.truncate(0);
    }

    /// Keeps the first `n` numbers and the memory.
    pub fn truncate(&mut self, n: usize) {
        match &mut self.0 {
            Store::Own(numbers) => numbers.truncate(n),
            Store::Room(_, len) | Store::Block(_, len) => *len = n.min(*len),
        }
    }

    /// The numbers as an owned vector; copies them out of shared memory.
    fn own(&mut self) -> &mut Vec<T> {
        if !matches!(self.0, Store::Own(_)) {
            self.0 = Store::Own(self.to_vec());
        }
        match &mut self.0 {
            Store::Own(numbers) => numbers,
            Store::Room(..) | Store::Block(..) => unreachable!("it was just made its own"),
        }
    }
}

impl<T: Packable> Deref for Packed<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        match &self.0 {
            Store::Own(numbers) => numbers,
            Store::Room(room, n) => numbers(room.bytes(), *n),
            Store::Block(block, n) => numbers(block.bytes(), *n),
        }
    }
}

/// Mutable access to sealed memory makes a copy first.
impl<T: Packable> DerefMut for Packed<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        match self.0 {
            Store::Room(ref mut room, n) => {
                bytemuck::cast_slice_mut(&mut room.bytes_mut()[..n * size_of::<T>()])
            }
            _ => self.own(),
        }
    }
}

impl<T> Default for Packed<T> {
    fn default() -> Self {
        Self(Store::Own(Vec::new()))
    }
}

impl<T> From<Vec<T>> for Packed<T> {
    fn from(numbers: Vec<T>) -> Self {
        Self(Store::Own(numbers))
    }
}

/// Copies into an owned vector.
impl<T: Packable> Clone for Packed<T> {
    fn clone(&self) -> Self {
        Self(Store::Own(self.to_vec()))
    }
}

impl<T: Packable + PartialEq> PartialEq for Packed<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

/// Formats the length and the first few numbers.
impl<T: Packable + fmt::Debug> fmt::Debug for Packed<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN: usize = 8;
        write!(f, "{} x {:?}", self.len(), &self[..self.len().min(SHOWN)])?;
        if self.len() > SHOWN { f.write_str("...") } else { Ok(()) }
    }
}

impl<T: Packable> Serialize for Packed<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let bytes: &[u8] = bytemuck::cast_slice(self);
        match block::form(bytes.len(), self.place()) {
            Form::Plain => serializer.serialize_bytes(bytes),
            Form::Away { place: None } => Away::Here(Run(bytes)).serialize(serializer),
            Form::Away { place: Some(place) } => {
                Away::<Run<'_>>::There(place, self.len()).serialize(serializer)
            }
        }
    }
}

impl<'de, T: Packable> Deserialize<'de> for Packed<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        if !block::is_reading() {
            return deserializer.deserialize_byte_buf(Bytes(PhantomData));
        }
        match Away::<Plain<T>>::deserialize(deserializer)? {
            Away::Here(Plain(numbers)) => Ok(numbers),
            Away::There(place, n) => {
                let block = block::find(place);
                let block = block.ok_or_else(|| D::Error::custom(format_args!("{place:?} is not there")))?;
                if numbers::<T>(block.bytes(), n).len() == n {
                    return Ok(Self(Store::Block(block, n)));
                }
                Err(D::Error::custom(format_args!("{place:?} has no room for {n} numbers")))
            }
        }
    }
}

/// Encoding of an array for another process.
#[derive(Serialize, Deserialize)]
enum Away<R> {
    Here(R),
    There(BlockId, usize),
}

struct Run<'a>(&'a [u8]);

impl Serialize for Run<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(self.0)
    }
}

struct Plain<T>(Packed<T>);

impl<'de, T: Packable> Deserialize<'de> for Plain<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_byte_buf(Bytes(PhantomData)).map(Self)
    }
}

/// Visitor that accepts a byte string or, for formats without one, a sequence of bytes.
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
        Ok(numbers.into())
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
    use std::collections::BTreeMap;
    use std::rc::Rc;
    use std::sync::Mutex;

    use swerve_core::digest_of;

    use super::*;
    use crate::block::{Shelf, Written, reading, reading_plainly, writing};

    fn cbor<T: Packable>(numbers: &Packed<T>) -> Vec<u8> {
        let mut out = Vec::new();
        ciborium::into_writer(numbers, &mut out).unwrap();
        out
    }

    #[test]
    fn packed_serializes_as_one_little_endian_byte_string() {
        let numbers = Packed::from(vec![1.0_f32, -2.5, f32::INFINITY]);
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        // A byte string of length twelve (RFC 8949, 3.1: major type 2).
        assert_eq!(cbor(&numbers), [&[0x4c_u8][..], &bytes].concat());
        assert_eq!(cbor(&Packed::from(vec![0x0102_u16])), [0x42, 0x02, 0x01]);
        assert_eq!(digest_of(&numbers), digest_of(&Packed::from(bytes)), "the digest is that of the bytes");
    }

    #[test]
    fn packed_round_trips_at_any_length() {
        for n in [0, 1, 1000, 100_000] {
            let numbers = Packed::from((0..n).map(|i| i as f32 * 0.5).collect::<Vec<_>>());
            assert_eq!(ciborium::from_reader::<Packed<f32>, _>(&cbor(&numbers)[..]).unwrap(), numbers);
            let ids = Packed::from((0..n).map(|i: u32| i.wrapping_mul(77_777)).collect::<Vec<_>>());
            assert_eq!(ciborium::from_reader::<Packed<u32>, _>(&cbor(&ids)[..]).unwrap(), ids);
        }
        let text = serde_json::to_string(&Packed::from(vec![1.5_f32])).unwrap();
        assert_eq!(text, "[0,0,192,63]");
        assert_eq!(serde_json::from_str::<Packed<f32>>(&text).unwrap(), Packed::from(vec![1.5]));
    }

    #[test]
    fn packed_rejects_a_partial_number() {
        let said = ciborium::from_reader::<Packed<f32>, _>(&[0x43_u8, 1, 2, 3][..]).unwrap_err().to_string();
        assert!(said.contains("length 3") && said.contains("4 for each number"), "{said}");
        assert!(serde_json::from_str::<Packed<u16>>("[1]").is_err());
        assert!(serde_json::from_str::<Packed<u16>>("[1, 256]").is_err());
        assert!(serde_json::from_str::<Packed<u16>>("12").is_err());
    }

    #[test]
    fn packed_reset_keeps_the_memory() {
        let mut numbers = Packed::from(vec![7_u16; 100]);
        let before = numbers.as_ptr();
        numbers.reset(60);
        assert_eq!((numbers.len(), numbers[59], numbers.as_ptr()), (60, 0, before));
        assert_eq!(format!("{:?}", Packed::from(vec![1_u8; 9])), "9 x [1, 1, 1, 1, 1, 1, 1, 1]...");
    }

    /// Shared memory as in another process: aligned, and identified by its place.
    #[derive(Clone, Default)]
    struct Shared(Arc<Mutex<BTreeMap<u64, Arc<Piece>>>>);

    struct Piece {
        lines: Vec<u64>,
        bytes: usize,
        place: BlockId,
        of: Shared,
    }

    impl Memory for Shared {
        fn room(&self, bytes: usize) -> Option<Box<dyn Room>> {
            let place = BlockId { memory: 7, seq: self.0.lock().unwrap().len() as u64 + 1 };
            let lines = vec![0; bytes.div_ceil(8)];
            Some(Box::new(Piece { lines, bytes, place, of: self.clone() }))
        }
    }

    impl Room for Piece {
        fn bytes(&self) -> &[u8] {
            &bytemuck::cast_slice(&self.lines)[..self.bytes]
        }

        fn bytes_mut(&mut self) -> &mut [u8] {
            &mut bytemuck::cast_slice_mut(&mut self.lines)[..self.bytes]
        }

        fn seal(self: Box<Self>) -> Result<Arc<dyn Block>, String> {
            let (shared, seq) = (self.of.clone(), self.place.seq);
            let piece: Arc<Self> = Arc::from(self);
            shared.0.lock().unwrap().insert(seq, piece.clone());
            Ok(piece)
        }
    }

    impl Block for Piece {
        fn bytes(&self) -> &[u8] {
            Room::bytes(self)
        }

        fn place(&self) -> BlockId {
            self.place
        }
    }

    impl Shelf for Shared {
        fn find(&self, place: BlockId) -> Option<Arc<dyn Block>> {
            Some(self.0.lock().unwrap().get(&place.seq)?.clone())
        }
    }

    /// Round trip to a process that has the shelf `shelf`; CBOR stands in for any format.
    fn sent(numbers: &Packed<f32>, places: bool, shelf: &Shared) -> (Result<Packed<f32>, String>, Written) {
        let (bytes, written) = writing(places, 1000, || cbor(numbers));
        let read = || ciborium::from_reader(&bytes[..]).map_err(|error| error.to_string());
        (reading(Rc::new(shelf.clone()), read), written)
    }

    #[test]
    fn shared_memory_is_sent_by_place_and_read_in_place() {
        let shared = Shared::default();
        let mut numbers = Packed::<f32>::in_memory(Some(&shared), 1000);
        numbers[999] = 0.5;
        numbers[3] = -1.0;
        numbers.truncate(900);
        assert_eq!(numbers.place(), None, "nobody reads what is being written");
        numbers.seal().unwrap();
        assert_eq!(numbers.place(), Some(BlockId { memory: 7, seq: 1 }));
        let (there, written) = sent(&numbers, true, &shared);
        let there = there.unwrap();
        assert_eq!((written.in_place, written.copied), (1, 0));
        assert_eq!((there.as_ptr(), there.len()), (numbers.as_ptr(), 900));
        let own = Packed::from(numbers.to_vec());
        assert_eq!((digest_of(&there), cbor(&there)), (digest_of(&own), cbor(&own)), "logs see the numbers");

        let (there, written) = sent(&numbers, false, &Shared::default());
        assert_eq!((written.in_place, written.copied), (0, 3600));
        assert_eq!(there.unwrap(), own, "sent as what they are, where the place is of no use");
        let (there, written) = sent(&own, true, &shared);
        assert_eq!((there.unwrap(), written.copied), (own.clone(), 3600), "own memory has no place");
        let (there, _) = sent(&numbers, true, &Shared::default());
        assert!(there.unwrap_err().contains("is not there"));
    }

    #[test]
    fn plain_numbers_are_read_while_a_call_is_read() {
        let numbers = Packed::from(vec![1.0_f32, 2.0]);
        let plain = cbor(&numbers);
        let (away, _) = writing(true, 1000, || cbor(&numbers));
        let read = |bytes: &[u8]| ciborium::from_reader::<Packed<f32>, _>(bytes).ok();
        let shelf = Rc::new(Shared::default());
        let found = reading(shelf, || [read(&plain), reading_plainly(|| read(&plain)), read(&away)]);
        assert_eq!(found, [None, Some(numbers.clone()), Some(numbers)]);
    }

    #[test]
    fn packed_copies_sealed_memory_on_write() {
        let shared = Shared::default();
        let mut numbers = Packed::<f32>::in_memory(Some(&shared), 100);
        numbers.seal().unwrap();
        let mut other = sent(&numbers, true, &shared).0.unwrap();
        other[5] = 1.0;
        assert_eq!((numbers[5], other[5], other.place()), (0.0, 1.0, None));
        numbers.push(2.0);
        numbers.reset(3);
        assert_eq!((&numbers[..], numbers.clone().pop()), (&[0.0; 3][..], Some(0.0)));
        assert_eq!(&Packed::<f32>::in_memory(None, 2)[..], [0.0; 2]);
    }
}
