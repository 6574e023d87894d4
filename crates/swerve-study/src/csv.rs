//! Texts in CSV files.

/// Text of a field, in quotes if it needs them.
pub(super) fn field(text: &str) -> String {
    if text.contains([',', '"', '\n']) { quoted(text) } else { text.to_owned() }
}

/// CSV text in quotes.
pub(super) fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}
