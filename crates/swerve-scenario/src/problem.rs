use core::fmt;
use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

/// One thing wrong with a scenario file.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Problem {
    /// The file, as the caller named it.
    pub file: String,
    /// Line from 1; 0 when the problem is with the file as a whole.
    pub line: usize,
    /// The key, from the top of the file, as in `actor.truck.size.length_m`; empty when there is none.
    pub key: String,
    /// The mistake, what was expected, and the nearest valid name where there is one.
    pub message: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if self.line > 0 {
            write!(f, ":{}", self.line)?;
        }
        if !self.key.is_empty() {
            write!(f, ": {}", self.key)?;
        }
        write!(f, ": {}", self.message)
    }
}

impl core::error::Error for Problem {}

/// No file that people write is larger, bytes.
const TEXT_MAX: u64 = 16 << 20;

/// The text of a file that people write; a device or a data set given by mistake is not read to its end.
///
/// # Errors
/// The file cannot be read, holds no UTF-8 or more than 16 MiB.
pub fn read_text(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    File::open(path)?.take(TEXT_MAX + 1).read_to_string(&mut text)?;
    if text.len() as u64 > TEXT_MAX {
        return Err(io::Error::other("it is larger than 16 MiB: expected a file of settings"));
    }
    Ok(text)
}
