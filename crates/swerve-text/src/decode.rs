//! Text from bytes.

use std::fmt;

/// Decodes UTF-8 and removes the byte-order mark that Windows programs add. Used by all readers of text.
///
/// # Errors
/// If there are bytes that are not UTF-8, with their line.
pub fn decoded(mut bytes: Vec<u8>) -> Result<String, NotText> {
    const MARK: &[u8] = b"\xef\xbb\xbf";
    if bytes.starts_with(MARK) {
        bytes.drain(..MARK.len());
    }
    String::from_utf8(bytes).map_err(|error| {
        let before = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        NotText { line: line_of(before, before.len()) }
    })
}

/// Bytes that are not UTF-8.
#[derive(Debug)]
pub struct NotText {
    /// Line of the first of them, starting at 1.
    pub line: usize,
}

impl fmt::Display for NotText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("expected text in UTF-8")
    }
}

impl std::error::Error for NotText {}

/// Line of an offset in bytes, starting at 1.
pub(crate) fn line_of(text: impl AsRef<[u8]>, offset: usize) -> usize {
    let text = text.as_ref();
    text[..offset.min(text.len())].iter().filter(|b| **b == b'\n').count() + 1
}
