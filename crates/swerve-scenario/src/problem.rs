use core::fmt;

/// One thing wrong with a scenario file.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Problem {
    /// The file, as the caller named it.
    pub file: String,
    /// Line from 1; 0 when the problem is with the file as a whole.
    pub line: usize,
    /// The key, from the top of the file, as in `actor.truck.size.length_m`; empty when there is none.
    pub key: String,
    /// What is wrong, what was expected, and the nearest valid name where there is one.
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
