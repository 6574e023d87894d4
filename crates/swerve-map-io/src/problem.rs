//! Problems of an XML file: place, element, description.

use core::fmt;
use core::ops::Deref;

/// Largest number of problems that are kept; the rest is counted.
pub const PROBLEMS_MAX: usize = 1000;

/// Longest text of a file that a message repeats, characters.
const QUOTE_MAX: usize = 40;

/// A problem with an element of an XML file. As `swerve_text::Problem`, with the column and, for a key, the element.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Problem {
    /// Line, starting at 1.
    pub line: usize,
    /// Column in characters, starting at 1.
    pub column: usize,
    /// Path of the element, such as `road 3/planView/geometry`; empty for a problem with the whole text.
    pub element: String,
    /// Description: the mistake, the expected value, and the nearest valid name, if any.
    pub message: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: ", self.line, self.column)?;
        if !self.element.is_empty() {
            write!(f, "{}: ", self.element)?;
        }
        f.write_str(&self.message)
    }
}

/// Problems of a file, in order of their place.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Problems {
    /// File as named by the user.
    file: String,
    kept: Vec<Problem>,
    /// Number of problems that are not kept.
    more: usize,
}

impl Problems {
    pub(crate) fn new(file: &str, mut kept: Vec<Problem>, more: usize) -> Self {
        kept.sort();
        Self { file: file.to_owned(), kept, more }
    }

    /// These problems and others of the same file.
    pub fn with(&self, others: &Self) -> Self {
        let kept = self.kept.iter().chain(&others.kept).cloned().collect();
        Self::new(&self.file, kept, self.more + others.more)
    }

    /// Number of problems, including those beyond [`PROBLEMS_MAX`].
    pub fn count(&self) -> usize {
        self.kept.len() + self.more
    }

    /// One problem per line with the name of the file, at most `lines` of them.
    pub fn first(&self, lines: usize) -> String {
        let shown = self.kept.iter().take(lines);
        let mut text: Vec<String> = shown.map(|problem| format!("{}:{problem}", self.file)).collect();
        let rest = self.count() - text.len();
        if rest > 0 {
            text.push(format!("{}: and {rest} more", self.file));
        }
        text.join("\n")
    }
}

impl Deref for Problems {
    type Target = [Problem];

    fn deref(&self) -> &[Problem] {
        &self.kept
    }
}

/// Formats one problem per line.
impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.first(PROBLEMS_MAX))
    }
}

impl std::error::Error for Problems {}

/// Text of a file, quoted for a message: in one line and of limited length.
pub fn quoted(text: &str) -> String {
    let mut short: String = text.chars().take(QUOTE_MAX).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    format!("{short:?}")
}
