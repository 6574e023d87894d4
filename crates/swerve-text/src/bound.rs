//! Limits of keys and texts, both in input and in messages.

use std::borrow::Cow;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Maximum length of a key or name, characters.
pub const NAME_MAX: usize = 200;
/// Maximum length of a text in a TOML document, characters.
pub const PARAGRAPH_MAX: usize = 10_000;

/// Maximum length of a word in a message; a dotted key contains a name and more.
const WORD_MAX: usize = 300;
/// Maximum length of a message, characters.
const MESSAGE_MAX: usize = 4_000;

/// Message for a text of more than `max` characters; `None` if it is short enough.
pub(crate) fn too_long(text: &str, max: usize) -> Option<String> {
    // A character takes at least one byte.
    let count = if text.len() > max { text.chars().count() } else { 0 };
    (count > max).then(|| format!("has {count} characters: expected at most {max}"))
}

/// A key or text of a document that exceeds its limit.
pub(crate) struct TooLong {
    /// Dotted key.
    pub(crate) key: String,
    /// Byte offset in the document.
    pub(crate) start: usize,
    pub(crate) message: String,
}

impl TooLong {
    /// Finds the first key or text of a document that exceeds its limit.
    pub(crate) fn find(table: &DeTable<'_>) -> Option<Self> {
        table.iter().find_map(|(name, value)| {
            let (key, start) = (name.get_ref(), name.span().start);
            if let Some(message) = too_long(key, NAME_MAX) {
                let key = key.chars().take(NAME_MAX).collect::<String>() + "…";
                return Some(Self { key, start, message: format!("the key {message}") });
            }
            Self::find_in(value, start).map(|inner| inner.within(key))
        })
    }

    fn find_in(value: &Spanned<DeValue<'_>>, start: usize) -> Option<Self> {
        match value.get_ref() {
            DeValue::String(text) => too_long(text, PARAGRAPH_MAX).map(|message| Self {
                key: String::new(),
                start,
                message: format!("the text {message}"),
            }),
            DeValue::Array(items) => items.iter().enumerate().find_map(|(i, item)| {
                Self::find_in(item, item.span().start).map(|inner| inner.within(&format!("[{i}]")))
            }),
            DeValue::Table(table) => Self::find(table),
            _ => None,
        }
    }

    fn within(self, outer: &str) -> Self {
        let dot = if self.key.is_empty() || self.key.starts_with('[') { "" } else { "." };
        Self { key: format!("{outer}{dot}{}", self.key), ..self }
    }
}

/// Shortens a text for a message: long words and long texts are cut.
pub(crate) fn shortened(text: &str) -> Cow<'_, str> {
    let words = || text.split_inclusive(char::is_whitespace);
    if text.len() <= MESSAGE_MAX && words().all(|word| word.len() <= WORD_MAX) {
        return text.into();
    }
    let mut short = String::new();
    for word in words() {
        let cut = word.char_indices().nth(WORD_MAX).map(|(at, _)| at);
        short.push_str(&word[..cut.unwrap_or(word.len())]);
        if cut.is_some() {
            short.push_str("… ");
        }
        if let Some((at, _)) = short.char_indices().nth(MESSAGE_MAX) {
            short.truncate(at);
            short.push('…');
            break;
        }
    }
    short.truncate(short.trim_end().len());
    short.into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Document;

    #[test]
    fn long_keys_and_texts_are_refused_with_their_place_in_a_short_message() {
        let (long, much) = ("k".repeat(1 << 20), "t".repeat(1 << 20));
        let long_key = format!("{}…", "k".repeat(NAME_MAX));
        let key = format!("the key has {} characters: expected at most 200", 1 << 20);
        let text = format!("the text has {} characters: expected at most 10000", 1 << 20);
        for (written, line, at, message) in [
            (format!("a = 1\n{long} = 2\n"), 2, long_key.clone(), &key),
            (format!("[a.\"{long}\"]\nb = 2\n"), 1, format!("a.{long_key}"), &key),
            (format!("[a]\nb = [1, {{ {long} = 1 }}]\n"), 2, format!("a.b[1].{long_key}"), &key),
            (format!("[a]\n\nb = \"{much}\"\n"), 3, "a.b".into(), &text),
            (format!("a = [\n1,\n[\"{much}\"]]\n"), 3, "a[1][0]".into(), &text),
        ] {
            let said = Document::parse("a.toml", &written).unwrap_err().to_string();
            assert_eq!(said, format!("a.toml:{line}: {at}: {message}"));
        }
        let most = format!("\"{}\" = \"{}\"\n", "ä".repeat(NAME_MAX), "ä".repeat(PARAGRAPH_MAX));
        Document::parse("a.toml", most).unwrap();
    }

    #[test]
    fn messages_are_cut_by_word_and_in_total() {
        assert_eq!(shortened("as it is"), "as it is");
        let said = shortened(&format!("unknown kind `{}`; expected `a`", "ä".repeat(1 << 20))).into_owned();
        assert!(said.starts_with("unknown kind `ä") && said.ends_with("ä… expected `a`"), "{said}");
        assert!(said.chars().count() < 2 * WORD_MAX);
        let cut = shortened(&"word ".repeat(1 << 20)).into_owned();
        assert_eq!(cut.chars().count(), MESSAGE_MAX + 1);
    }
}
