//! NumPy archives of numeric arrays: `.npz`, a zip archive of `.npy` arrays.
//!
//! Supports archives of up to 256 MiB of numbers in `f4`, `f8`, `i4`, `i8`, `u1` or `b1`, stored or deflated, in C
//! order.

use std::collections::BTreeMap;

/// Largest total size of the arrays, bytes.
const MOST_BYTES: usize = 256 << 20;

/// Error of reading an archive, with the affected member.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{at}: {what}")]
pub struct NpzError {
    at: String,
    what: String,
}

/// An array of numbers in C order.
#[derive(Clone, PartialEq, Debug)]
pub struct Array {
    /// Length of each dimension.
    pub shape: Vec<usize>,
    /// Elements.
    pub values: Vec<f64>,
}

impl Array {
    /// Rows of a two-dimensional array with `N` columns; `None` for other shapes.
    pub fn rows<const N: usize>(&self) -> Option<&[[f64; N]]> {
        (self.shape.len() == 2 && self.shape[1] == N).then(|| self.values.as_chunks::<N>().0)
    }
}

fn wrong(at: &str, what: impl Into<String>) -> NpzError {
    NpzError { at: at.to_owned(), what: what.into() }
}

/// Reads the arrays of an archive, by name without `.npy`.
///
/// # Errors
/// The first error of the archive, with the affected array.
pub fn read(bytes: &[u8]) -> Result<BTreeMap<String, Array>, NpzError> {
    let (mut at, count) = directory(bytes)?;
    let (mut arrays, mut left) = (BTreeMap::new(), MOST_BYTES);
    for _ in 0..count {
        let member = Member::read(bytes, &mut at)?;
        let unpacked = member.unpacked(bytes, left)?;
        left -= unpacked.len();
        let name = member.name.strip_suffix(".npy").unwrap_or(&member.name).to_owned();
        let array = array(&unpacked).map_err(|what| wrong(&member.name, what))?;
        arrays.insert(name, array);
    }
    Ok(arrays)
}

/// A little-endian number of up to 4 bytes.
fn number<const N: usize>(bytes: &[u8], at: usize) -> Option<usize> {
    let read = bytes.get(at..at.checked_add(N)?)?;
    Some(read.iter().rev().fold(0, |n, byte| n << 8 | usize::from(*byte)))
}

/// Start of the central directory, and its number of members.
fn directory(bytes: &[u8]) -> Result<(usize, usize), NpzError> {
    let none = || wrong("archive", "no zip archive: expected an `.npz` file as NumPy writes it");
    // The end record is at the end, before a comment of at most 64 KiB.
    let first = bytes.len().saturating_sub(22 + 0xffff);
    let last = bytes.len().checked_sub(22).ok_or_else(none)?;
    let at = (first..=last).rev().find(|&at| bytes[at..].starts_with(b"PK\x05\x06")).ok_or_else(none)?;
    let count = number::<2>(bytes, at + 10).ok_or_else(none)?;
    let start = number::<4>(bytes, at + 16).ok_or_else(none)?;
    if count == 0xffff || start == 0xffff_ffff {
        return Err(wrong("archive", "a zip64 archive: expected one of less than 4 GiB"));
    }
    Ok((start, count))
}

/// One file of an archive.
struct Member {
    name: String,
    method: usize,
    crc: usize,
    packed: usize,
    size: usize,
    header: usize,
}

impl Member {
    /// Reads the directory entry at `at`, which advances to the next.
    fn read(bytes: &[u8], at: &mut usize) -> Result<Self, NpzError> {
        let cut = || wrong("archive", "its directory is cut off");
        let entry = bytes.get(*at..).filter(|rest| rest.starts_with(b"PK\x01\x02")).ok_or_else(cut)?;
        let short = |at| number::<2>(entry, at).ok_or_else(cut);
        let long = |at| number::<4>(entry, at).ok_or_else(cut);
        let name = entry.get(46..46 + short(28)?).ok_or_else(cut)?;
        let member = Self {
            name: String::from_utf8_lossy(name).into_owned(),
            method: short(10)?,
            crc: long(16)?,
            packed: long(20)?,
            size: long(24)?,
            header: long(42)?,
        };
        *at += 46 + short(28)? + short(30)? + short(32)?;
        Ok(member)
    }

    fn unpacked(&self, bytes: &[u8], most: usize) -> Result<Vec<u8>, NpzError> {
        let wrong = |what: String| wrong(&self.name, what);
        let cut = || wrong("cut off".into());
        let header = bytes.get(self.header..).ok_or_else(cut)?;
        let behind = |at| number::<2>(header, at).ok_or_else(cut);
        let from = 30 + behind(26)? + behind(28)?;
        let packed = header.get(from..from.saturating_add(self.packed)).ok_or_else(cut)?;
        if self.size > most {
            return Err(wrong(format!("too large: expected at most {MOST_BYTES} bytes in all arrays")));
        }
        let unpacked = match self.method {
            0 => packed.to_vec(),
            8 => miniz_oxide::inflate::decompress_to_vec_with_limit(packed, self.size)
                .map_err(|_| wrong("what is deflated there is broken".into()))?,
            other => return Err(wrong(format!("packed by method {other}, expected 0 or 8"))),
        };
        if unpacked.len() != self.size || crc32(&unpacked) as usize != self.crc {
            return Err(wrong("its checksum is another: the file is damaged".into()));
        }
        Ok(unpacked)
    }
}

/// CRC-32 as used by zip archives.
fn crc32(bytes: &[u8]) -> u32 {
    let table: [u32; 256] = core::array::from_fn(|i| {
        (0..8).fold(i as u32, |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    });
    !bytes.iter().fold(!0, |crc: u32, byte| crc >> 8 ^ table[usize::from(crc as u8 ^ byte)])
}

/// Parses an `.npy` file.
fn array(bytes: &[u8]) -> Result<Array, String> {
    let cut = || "cut off".to_owned();
    if !bytes.starts_with(b"\x93NUMPY") {
        return Err("no `.npy` array".into());
    }
    let (from, length) = match bytes.get(6).ok_or_else(cut)? {
        1 => (10, number::<2>(bytes, 8)),
        2 | 3 => (12, number::<4>(bytes, 8)),
        other => return Err(format!("an array of version {other}, expected 1 to 3")),
    };
    let end = from + length.ok_or_else(cut)?;
    let head = core::str::from_utf8(bytes.get(from..end).ok_or_else(cut)?).map_err(|_| cut())?;
    if value(head, "fortran_order").is_none_or(|order| !order.starts_with("False")) {
        return Err("column by column, expected `fortran_order: False`".into());
    }
    let kind = value(head, "descr").and_then(|text| text.strip_prefix('\'')?.split('\'').next());
    let shape = shape(head).ok_or("its shape cannot be read")?;
    let count = shape.iter().try_fold(1_usize, |n, length| n.checked_mul(*length)).ok_or_else(cut)?;
    let values = values(&bytes[end..], kind.unwrap_or_default())?;
    if values.len() != count {
        return Err(format!("{} numbers, expected {count} by its shape", values.len()));
    }
    Ok(Array { shape, values })
}

/// Text after a key of the header.
fn value<'a>(head: &'a str, key: &str) -> Option<&'a str> {
    head.split_once(&format!("'{key}':")).map(|(_, rest)| rest.trim_start())
}

fn shape(head: &str) -> Option<Vec<usize>> {
    let inside = value(head, "shape")?.strip_prefix('(')?.split(')').next()?;
    let lengths = inside.split(',').map(str::trim).filter(|text| !text.is_empty());
    lengths.map(|text| text.parse().ok()).collect()
}

fn values(bytes: &[u8], kind: &str) -> Result<Vec<f64>, String> {
    fn each<const N: usize>(bytes: &[u8], number: fn([u8; N]) -> f64) -> Vec<f64> {
        bytes.as_chunks::<N>().0.iter().map(|chunk| number(*chunk)).collect()
    }
    Ok(match kind {
        "<f8" => each(bytes, f64::from_le_bytes),
        "<f4" => each(bytes, |b| f64::from(f32::from_le_bytes(b))),
        "<i8" => each(bytes, |b| i64::from_le_bytes(b) as f64),
        "<i4" => each(bytes, |b| f64::from(i32::from_le_bytes(b))),
        "|u1" | "|b1" => each(bytes, |[b]: [u8; 1]| f64::from(b)),
        other => return Err(format!("numbers of type `{other}`, expected <f8, <f4, <i8, <i4, |u1 or |b1")),
    })
}

#[cfg(test)]
mod tests;
