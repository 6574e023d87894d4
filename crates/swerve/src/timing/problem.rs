//! What is wrong with a timing file, and where.

use core::fmt;
use core::ops::Range;
use std::path::Path;

/// One thing that is wrong with a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Where in the text, in bytes.
    pub at: Range<usize>,
    /// The key, with the operator or resource that it belongs to.
    pub key: String,
    /// What was found and what was expected.
    pub message: String,
}

/// All problems of one file, first line first; at least one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problems(Vec<String>);

impl Problems {
    /// `problems`, with the lines that they have in `text`.
    pub(crate) fn new(file: &Path, text: &str, mut problems: Vec<Problem>) -> Self {
        problems.sort_by_key(|p| p.at.start);
        let line = |at: usize| 1 + text.as_bytes().iter().take(at).filter(|b| **b == b'\n').count();
        let show = |p: Problem| {
            let key = if p.key.is_empty() { String::new() } else { format!("{}: ", p.key) };
            format!("{}:{}: {key}{}", file.display(), line(p.at.start), p.message)
        };
        Self(problems.into_iter().map(show).collect())
    }

    /// One line for each problem: `file:line: key: message`.
    pub fn lines(&self) -> &[String] {
        &self.0
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.join("\n"))
    }
}

impl std::error::Error for Problems {}

/// `"a", "b" or "c"`.
pub(crate) fn alternatives<S: AsRef<str>>(names: &[S]) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("\"{}\"", name.as_ref())).collect();
    match quoted.split_last() {
        None => "nothing".to_owned(),
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
    }
}

/// The name that `wrong` was probably meant to be, as a question to put behind a message.
pub(crate) fn nearest<S: AsRef<str>>(wrong: &str, names: &[S]) -> String {
    names
        .iter()
        .map(|name| (strsim::damerau_levenshtein(wrong, name.as_ref()), name.as_ref()))
        .min()
        .filter(|(distance, name)| *distance <= 1 + name.chars().count() / 2)
        .map_or_else(String::new, |(_, name)| format!("; did you mean \"{name}\"?"))
}
