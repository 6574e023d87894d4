//! CBOR (RFC 8949), the form of payloads and records in logs: ciborium with less overhead.
//!
//! Ciborium alone writes byte by byte, and reads into a buffer of four kilobytes that it clears for every value.

use std::cell::RefCell;
use std::io::{self, Read, Write};

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Appends a value to `out`.
///
/// # Panics
/// If the value's `Serialize` fails: a bug of the type.
pub fn write<T: Serialize + ?Sized>(value: &T, out: &mut Vec<u8>) {
    let mut pieces = Pieces { held: [0; HELD], len: 0, out };
    ciborium::into_writer(value, &mut pieces).expect("values serialize without fail, and memory takes all");
    pieces.spill();
}

/// Reads one value.
///
/// # Errors
/// If the bytes are not a value of type `T`.
pub fn read<T: DeserializeOwned>(from: impl Read) -> Result<T, String> {
    /// Size of the buffer that ciborium allocates if it is given none.
    const SCRATCH: usize = 4096;
    thread_local! {
        static KEPT: RefCell<[u8; SCRATCH]> = const { RefCell::new([0; SCRATCH]) };
    }
    let read = KEPT.with(|kept| match kept.try_borrow_mut() {
        Ok(mut kept) => ciborium::de::from_reader_with_buffer(from, &mut *kept),
        // The buffer is in use: a value that is being read reads another one.
        Err(_) => ciborium::from_reader(from),
    });
    read.map_err(|error| error.to_string())
}

/// Number of bytes collected before they are appended.
const HELD: usize = 256;

/// Collects written pieces, most of which are a byte or a word.
struct Pieces<'a> {
    held: [u8; HELD],
    len: usize,
    out: &'a mut Vec<u8>,
}

impl Pieces<'_> {
    fn spill(&mut self) {
        self.out.extend_from_slice(&self.held[..self.len]);
        self.len = 0;
    }

    /// Appends a piece that does not fit into the buffer.
    #[cold]
    fn append(&mut self, piece: &[u8]) {
        self.spill();
        self.out.extend_from_slice(piece);
    }
}

impl Write for Pieces<'_> {
    fn write(&mut self, piece: &[u8]) -> io::Result<usize> {
        self.write_all(piece)?;
        Ok(piece.len())
    }

    fn write_all(&mut self, piece: &[u8]) -> io::Result<()> {
        // The head of a small number has no bytes after it.
        if piece.is_empty() {
            return Ok(());
        }
        let rest = self.held.get_mut(self.len..);
        let Some(room) = rest.and_then(|rest| rest.get_mut(..piece.len())) else {
            self.append(piece);
            return Ok(());
        };
        self.len += piece.len();
        // Heads and numbers take one store each.
        if let ([to], [byte]) = (&mut *room, piece) {
            *to = *byte;
        } else if let (Ok(to), Ok(word)) = (<&mut [u8; 8]>::try_from(&mut *room), <&[u8; 8]>::try_from(piece))
        {
            *to = *word;
        } else if let (Ok(to), Ok(word)) = (<&mut [u8; 4]>::try_from(&mut *room), <&[u8; 4]>::try_from(piece))
        {
            *to = *word;
        } else {
            room.copy_from_slice(piece);
        }
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Values with pieces of many lengths.
    fn values() -> impl Strategy<Value = Vec<(Option<f64>, i64, String, Vec<u16>)>> {
        let one =
            (any::<Option<f64>>(), any::<i64>(), ".{0,300}", prop::collection::vec(any::<u16>(), 0..40));
        prop::collection::vec(one, 0..6)
    }

    proptest! {
        #[test]
        fn a_value_is_written_as_ciborium_writes_it_and_read_back(value in values()) {
            let mut plain = vec![7];
            ciborium::into_writer(&value, &mut plain).unwrap();
            let mut ours = vec![7];
            write(&value, &mut ours);
            prop_assert_eq!(&ours, &plain);
            let back: Vec<(Option<f64>, i64, String, Vec<u16>)> = read(&ours[1..]).unwrap();
            let mut again = vec![7];
            write(&back, &mut again);
            prop_assert_eq!(again, ours);
        }
    }

    #[test]
    fn runs_of_bytes_of_any_length_are_written_whole() {
        for n in [0, 1, 2, 3, 4, 7, 8, 9, 253, 254, 255, 256, 257, 510, 511, 512, 5000] {
            let text = "x".repeat(n);
            let (mut plain, mut ours) = (Vec::new(), Vec::new());
            ciborium::into_writer(&(1, &text, 2.5), &mut plain).unwrap();
            write(&(1, &text, 2.5), &mut ours);
            assert_eq!(ours, plain, "{n}");
            assert_eq!(read::<(u8, String, f64)>(&ours[..]).unwrap(), (1, text, 2.5));
        }
    }

    #[test]
    fn value_of_another_type_is_refused_with_ciboriums_error() {
        let said = ciborium::from_reader::<u8, _>(&b"\x61a"[..]).unwrap_err().to_string();
        assert_eq!(read::<u8>(&b"\x61a"[..]).unwrap_err(), said);
        assert!(read::<u8>(&b""[..]).is_err());
    }

    /// Reads its bytes as a value while it is being read.
    #[derive(PartialEq, Debug)]
    struct Nested(u8);

    impl<'de> serde::Deserialize<'de> for Nested {
        fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
            let text = String::deserialize(from)?;
            read(text.as_bytes()).map(Self).map_err(serde::de::Error::custom)
        }
    }

    #[test]
    fn a_value_that_is_being_read_may_read_another_one() {
        assert_eq!(read::<Nested>(&b"\x61\x07"[..]), Ok(Nested(7)));
    }
}
