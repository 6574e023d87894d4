//! Text and numbers of files.

use std::fmt::Display;
use std::path::Path;

use anyhow::anyhow;
use swerve_report::files::read_whole;

/// Error in a line of a file.
pub(super) fn wrong(path: &Path, line: usize, what: impl Display) -> anyhow::Error {
    anyhow!("{}:{line}: {what}", path.display())
}

/// Text of a file of up to 1 GiB: results of a whole data set take hundreds of megabytes.
pub(super) fn text(path: &Path) -> anyhow::Result<String> {
    swerve_text::decoded(read_whole(path)?).map_err(|error| wrong(path, error.line, error))
}

/// Parses the number in a column.
pub(super) fn number(name: &str, word: &str) -> Result<f64, String> {
    match word.trim().parse() {
        Ok(number) if f64::is_finite(number) => Ok(number),
        _ => Err(format!("{name}: expected a finite number, found `{}`", word.trim())),
    }
}
