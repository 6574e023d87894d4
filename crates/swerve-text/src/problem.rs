use std::collections::BTreeMap;
use std::fmt;
use std::ops::Deref;

use crate::bound::shortened;

/// A problem with a text.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Problem {
    /// File as named by the user, or another source of the text.
    pub file: String,
    /// Line, starting at 1; `None` if the problem has no place in the text.
    pub line: Option<usize>,
    /// Dotted key from the top of the text; empty for a problem with the whole text.
    pub key: String,
    /// Description: the mistake, the expected value, and the nearest valid name, if any.
    pub message: String,
}

/// Cuts long keys and texts.
impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        f.write_str(": ")?;
        if !self.key.is_empty() {
            write!(f, "{}: ", shortened(&self.key))?;
        }
        f.write_str(&shortened(&self.message))
    }
}

impl std::error::Error for Problem {}

/// A problem without a location: dotted key and message.
pub type KeyProblem = (String, String);

/// Formats problems with keys in one line, as in `` `a.b`: expected a text, found 3; `c`: ... ``.
pub fn in_one_line(problems: &[KeyProblem]) -> String {
    let lines: Vec<String> = problems.iter().map(|(key, message)| format!("`{key}`: {message}")).collect();
    lines.join("; ")
}

/// All problems of a text, in reporting order.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Problems {
    all: Vec<Problem>,
    known: KnownKeys,
}

/// Keys that a table may have, by the full name of an unknown key in it.
pub(crate) type KnownKeys = BTreeMap<String, Vec<&'static str>>;

impl Problems {
    /// Creates an empty list.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a problem.
    pub fn push(&mut self, problem: Problem) {
        self.all.push(problem);
    }

    /// The same problems, some of which are unknown keys.
    pub(crate) fn with_known(self, known: KnownKeys) -> Self {
        Self { known, ..self }
    }

    /// Keys that the table of an unknown key may have; `None` if a [`TableReader`](crate::TableReader) knows the key.
    pub fn known_beside(&self, key: &str) -> Option<&[&'static str]> {
        self.known.get(key).map(Vec::as_slice)
    }

    /// Returns `value` if there are no problems.
    ///
    /// # Errors
    /// These problems, if any.
    pub fn or<T>(self, value: T) -> Result<T, Self> {
        if self.all.is_empty() { Ok(value) } else { Err(self) }
    }
}

impl Deref for Problems {
    type Target = [Problem];

    fn deref(&self) -> &[Problem] {
        &self.all
    }
}

impl IntoIterator for Problems {
    type Item = Problem;
    type IntoIter = std::vec::IntoIter<Problem>;

    fn into_iter(self) -> Self::IntoIter {
        self.all.into_iter()
    }
}

impl Extend<Problem> for Problems {
    fn extend<I: IntoIterator<Item = Problem>>(&mut self, problems: I) {
        self.all.extend(problems);
    }
}

impl FromIterator<Problem> for Problems {
    fn from_iter<I: IntoIterator<Item = Problem>>(problems: I) -> Self {
        Self { all: problems.into_iter().collect(), known: KnownKeys::new() }
    }
}

impl From<Problem> for Problems {
    fn from(problem: Problem) -> Self {
        Self::from_iter([problem])
    }
}

/// Formats one problem per line.
impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, problem) in self.all.iter().enumerate() {
            let line_break = if i == 0 { "" } else { "\n" };
            write!(f, "{line_break}{problem}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Problems {}
