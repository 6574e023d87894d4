//! TOML documents with problems that name file, line and key.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;
use std::sync::Arc;

use serde::de::DeserializeOwned;
use toml::de::{DeTable, DeValue};

use crate::bound::TooLong;
use crate::decode::{NotText, decoded, line_of};
use crate::{Problem, Problems, read_bytes, read_given, read_meant};

/// Maximum size of a file written by people, bytes.
const TEXT_MAX: u64 = 16 << 20;

/// Reads a text file; it must be a regular file.
///
/// # Errors
/// If the file cannot be read, is not UTF-8, or exceeds 16 MiB.
pub fn read_text(path: &Path) -> io::Result<String> {
    text_of(read_bytes(path, TEXT_MAX))
}

/// Same as [`read_text`], for a path from the command line: a descriptor opened by the caller (`/dev/stdin`,
/// `/dev/fd/N`, the `<(...)` of a shell) is read as a stream.
///
/// # Errors
/// Same as there.
pub fn read_given_text(path: &Path) -> io::Result<String> {
    text_of(read_given(path, TEXT_MAX))
}

fn text_of(read: io::Result<Vec<u8>>) -> io::Result<String> {
    let bytes = read.map_err(|error| match error.kind() {
        io::ErrorKind::FileTooLarge => {
            io::Error::other("it is larger than 16 MiB: expected a file of settings")
        }
        _ => error,
    })?;
    decoded(bytes).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))
}

/// First line up to which a text fails to parse with this error, for errors without a location, such as keys with too
/// many dots.
fn line_that_fails(text: &str, error: &toml::de::Error) -> Option<usize> {
    let ends: Vec<usize> = text.match_indices('\n').map(|(at, _)| at).chain([text.len()]).collect();
    let fails = |end: &usize| {
        let part = DeTable::parse(&text[..*end]).map(drop);
        part.is_err_and(|other| other.span().is_none() && other.message() == error.message())
    };
    let before = ends.partition_point(|end| !fails(end));
    (before < ends.len()).then_some(before + 1)
}

/// Problem for a file that cannot be read, with the line of bytes that are not text.
pub fn unreadable(path: &Path, error: &io::Error) -> Problem {
    let not_text = error.get_ref().and_then(|error| error.downcast_ref::<NotText>());
    Problem {
        file: path.display().to_string(),
        line: not_text.map(|not_text| not_text.line),
        key: String::new(),
        message: format!("cannot be read: {error}"),
    }
}

/// A parsed TOML text: its values, and their locations.
#[derive(Clone, Debug)]
pub struct Document {
    /// File name for messages.
    pub file: String,
    /// Text.
    pub text: Arc<str>,
    /// Values.
    pub table: toml::Table,
    places: Places,
}

/// Location of the value at each dotted key.
type Places = BTreeMap<String, Location>;

#[derive(Clone, Debug)]
struct Location {
    /// Byte offset in the text.
    start: usize,
    /// Line, starting at 1.
    line: usize,
    /// File, if other than the document's.
    file: Option<Arc<str>>,
}

impl Document {
    /// Reads a file.
    ///
    /// # Errors
    /// If it cannot be read, or is not TOML.
    pub fn read(path: &Path) -> Result<Self, Problem> {
        let text = read_text(path).map_err(|error| unreadable(path, &error))?;
        Self::parse(&path.display().to_string(), &text)
    }

    /// Parses a text; `file` is its name in messages.
    ///
    /// # Errors
    /// If it is not TOML, or a key or text is too long.
    pub fn parse(file: &str, text: impl AsRef<str>) -> Result<Self, Problem> {
        let text = text.as_ref();
        let syntax = |error: toml::de::Error| Problem {
            file: file.to_owned(),
            line: error
                .span()
                .map(|span| line_of(text, span.start))
                .or_else(|| line_that_fails(text, &error)),
            key: String::new(),
            message: match duplicate(text, &error) {
                Some(message) => message,
                None => not_toml(error.message().trim_end()),
            },
        };
        let parsed = DeTable::parse(text).map_err(syntax)?;
        if let Some(TooLong { key, start, message }) = TooLong::find(parsed.get_ref()) {
            return Err(Problem { file: file.to_owned(), line: Some(line_of(text, start)), key, message });
        }
        let mut places = Places::new();
        note_table(parsed.get_ref(), "", &Lines::of(text), &mut places);
        let table = toml::from_str(text).map_err(|error| {
            let at = error.span().map_or(0, |span| span.start);
            let before = places.iter().filter(|(_, place)| place.start <= at);
            let key =
                before.max_by_key(|(_, place)| place.start).map_or_else(String::new, |(key, _)| key.clone());
            Problem { key, ..syntax(error) }
        })?;
        Ok(Self { file: file.to_owned(), text: text.into(), table, places })
    }

    /// Merges this document over `base`: tables are merged key by key, except those that are one value
    /// ([`is_one_value`](crate::is_one_value)); these and all other values of this document take precedence. Values of
    /// `base` keep their file and line.
    #[must_use]
    pub fn over(mut self, mut base: Self) -> Self {
        let file: Arc<str> = base.file.as_str().into();
        for place in base.places.values_mut() {
            place.file.get_or_insert_with(|| Arc::clone(&file));
        }
        lay_over(&mut base.table, self.table, "", &mut base.places);
        base.places.append(&mut self.places);
        Self { table: base.table, places: base.places, ..self }
    }

    /// Folder of the file, to which relative paths in it refer; the working folder for other texts.
    pub fn folder(&self) -> &Path {
        Path::new(&self.file).parent().unwrap_or(Path::new(""))
    }

    /// Deserializes the whole text.
    ///
    /// # Errors
    /// All values of a wrong form, in the order of the lines.
    pub fn to<T: DeserializeOwned>(&self) -> Result<T, Problems> {
        self.to_checked(Ok)
    }

    /// Deserializes the whole text and passes it to `check`.
    ///
    /// # Errors
    /// All values of a wrong form, and all problems reported by `check` for the value as far as it could be read, in
    /// the order of the lines.
    pub fn to_checked<T: DeserializeOwned, C>(
        &self,
        check: impl FnOnce(T) -> Result<C, Problems>,
    ) -> Result<C, Problems> {
        let misread = match read_meant(&self.table) {
            Ok(value) => return check(value),
            Err(misread) => misread,
        };
        let of_form = misread.problems.iter().map(|(key, message)| self.problem(key, message));
        let mut problems: Vec<Problem> = of_form.collect();
        let of_values = misread.meant.and_then(|meant| check(meant).err()).unwrap_or_default();
        let is_guessed = |problem: &Problem| misread.guessed.holds(&problem.key);
        problems.extend(of_values.into_iter().filter(|problem| !is_guessed(problem)));
        problems.sort_by_key(|problem| problem.line);
        Err(problems.into_iter().collect())
    }

    /// Problem with the value at dotted `key` (or, if that is not in the text, with its nearest parent).
    pub fn problem(&self, key: &str, message: impl Into<String>) -> Problem {
        let place = self.nearest_place(key);
        Problem {
            file: place.and_then(|place| place.file.as_deref()).unwrap_or(&self.file).to_owned(),
            line: place.map(|place| place.line),
            key: key.to_owned(),
            message: message.into(),
        }
    }

    /// Line of the value at dotted `key`, or of its nearest parent in the text.
    pub fn line(&self, key: &str) -> Option<usize> {
        self.nearest_place(key).map(|place| place.line)
    }

    fn nearest_place(&self, key: &str) -> Option<&Location> {
        let mut at = key;
        loop {
            if let Some(place) = self.place(at) {
                return Some(place);
            }
            (at, _) = at.rsplit_once(['.', '['])?;
        }
    }

    /// Byte offset of the value at dotted `key`.
    pub(crate) fn start(&self, key: &str) -> Option<usize> {
        self.place(key).map(|place| place.start)
    }

    fn place(&self, key: &str) -> Option<&Location> {
        self.places.get(key)
    }
}

/// Merges `top` into `base`; forgets the locations of replaced values.
fn lay_over(base: &mut toml::Table, top: toml::Table, prefix: &str, places: &mut Places) {
    for (name, value) in top {
        let key = format!("{prefix}{name}");
        match (base.get_mut(&name), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(above)) if !crate::is_one_value(&key) => {
                lay_over(below, above, &format!("{key}."), places);
            }
            (_, value) => {
                places.retain(|place, _| !crate::is_within(place, &key));
                base.insert(name, value);
            }
        }
    }
}

/// Message for a key that is there twice, with the key.
fn duplicate(text: &str, error: &toml::de::Error) -> Option<String> {
    let at = error.span().filter(|_| error.message().trim_end() == "duplicate key")?.start;
    let start = text.get(..at)?.rfind('\n').map_or(0, |end| end + 1);
    let line = text.get(start..)?.lines().next()?.trim();
    let header = line.strip_prefix('[').and_then(|line| line.split(']').next());
    Some(match header {
        Some(name) => {
            let name = name.trim_start_matches('[').trim();
            format!(
                "the table `[{name}]` is there twice: expected one, or `[[{name}]]` for each entry of a list"
            )
        }
        None => {
            let key = line.split('=').next().unwrap_or(line).trim();
            format!("the key `{key}` is there twice: expected each key once in a table")
        }
    })
}

/// Rewords an error of the TOML parser for users.
fn not_toml(message: &str) -> String {
    if message.starts_with("invalid type: integer") {
        let found = message.split('`').nth(1).map_or_else(String::new, |found| format!(", found {found}"));
        return format!("expected whole numbers from {} to {}{found}", i64::MIN, i64::MAX);
    }
    if message.contains("recursion") {
        return "not TOML: tables and arrays are nested too deep".to_owned();
    }
    format!("not TOML: {message}")
}

/// Ends of the lines of a text.
struct Lines(Vec<usize>);

impl Lines {
    fn of(text: &str) -> Self {
        Self(text.match_indices('\n').map(|(at, _)| at).collect())
    }

    /// Line of a byte offset, starting at 1.
    fn line(&self, offset: usize) -> usize {
        self.0.partition_point(|end| *end < offset) + 1
    }
}

fn note_table(table: &DeTable<'_>, prefix: &str, lines: &Lines, places: &mut Places) {
    for (name, value) in table {
        let name_start = name.span().start;
        let name = name.get_ref();
        let key = if prefix.is_empty() { name.to_string() } else { format!("{prefix}.{name}") };
        // A table with its own header starts at that header, not where a table inside it is first named.
        let is_table = matches!(value.get_ref(), DeValue::Table(_));
        let start = if is_table { name_start.max(value.span().start) } else { name_start };
        note(value.get_ref(), &key, start, lines, places);
    }
}

fn note(value: &DeValue<'_>, key: &str, start: usize, lines: &Lines, places: &mut Places) {
    places.entry(key.to_owned()).or_insert_with(|| Location { start, line: lines.line(start), file: None });
    match value {
        DeValue::Table(inner) => note_table(inner, key, lines, places),
        DeValue::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                note(item.get_ref(), &format!("{key}[{i}]"), item.span().start, lines, places);
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Deserialize, Debug)]
    #[serde(deny_unknown_fields)]
    struct Outer {
        #[expect(dead_code, reason = "only read through its errors")]
        inner: Inner,
    }

    #[derive(Deserialize, Debug)]
    #[serde(deny_unknown_fields)]
    struct Inner {
        #[expect(dead_code, reason = "only read through its errors")]
        horizon: f64,
    }

    fn problem(text: &str) -> String {
        let read = Document::parse("a.toml", text).map_err(Problems::from);
        let problems = read.and_then(|document| document.to::<Outer>()).expect_err("wrong on purpose");
        problems.iter().map(Problem::to_string).collect::<Vec<_>>().join(" & ")
    }

    #[test]
    fn problem_names_file_line_key_and_expected_value() {
        assert_eq!(
            problem("[inner]\nhorizn = 1.0\n"),
            "a.toml:2: inner.horizn: unknown key; did you mean `horizon`?"
        );
        assert_eq!(
            problem("\n[inner]\nhorizon = \"long\"\n"),
            "a.toml:3: inner.horizon: expected a number, found the text \"long\""
        );
        assert_eq!(
            problem("[other]\n"),
            "a.toml: inner: is missing: expected a table & \
             a.toml:1: other: unknown key; expected one of \"inner\""
        );
        assert_eq!(problem(""), "a.toml: inner: is missing: expected a table");
        assert_eq!(
            problem("[[road]]\n[actor]\na = 1\n[actor]\na = 2\n"),
            "a.toml:4: the table `[actor]` is there twice: expected one, or `[[actor]]` for each entry of a list"
        );
        assert_eq!(
            problem("a = 1\nb.c = 1\na = 2\n"),
            "a.toml:3: the key `a` is there twice: expected each key once in a table"
        );
        assert!(problem("[inner\n").starts_with("a.toml:1: not TOML: "), "{}", problem("[inner\n"));
    }

    #[test]
    fn toml_errors_are_worded_for_users() {
        for (text, expected) in [
            (
                "a = 1\nb = 99999999999999999999\n",
                "a.toml:2: b: expected whole numbers from -9223372036854775808 to ",
            ),
            (
                "[a]\n[a.b]\nc = [\n 1,\n -99999999999999999999,\n]\n",
                "a.toml:5: a.b.c[1]: expected whole numbers from -9223372036854775808 to ",
            ),
            (
                &format!("a = 1\nb = {}1\n", "[".repeat(500)),
                "a.toml:2: not TOML: tables and arrays are nested too",
            ),
            (
                &format!("a = 1\nb{} = 1\nc = 2\n", ".b".repeat(200)),
                "a.toml:2: not TOML: tables and arrays are nested too",
            ),
            (
                &format!("a = 1\n[b]\nc = 1\n[d{}]\ne = 1\n[f]\n", ".d".repeat(200)),
                "a.toml:4: not TOML: tables and arrays are nested too",
            ),
        ] {
            let said = problem(text);
            assert!(said.starts_with(expected), "{said}");
        }
        let folder = std::env::temp_dir().join(format!("swerve_text_{}", std::process::id()));
        std::fs::write(&folder, b"a = 1\nb = \"\xff\"\n").unwrap();
        let said = Document::read(&folder).unwrap_err().to_string();
        std::fs::remove_file(&folder).unwrap();
        assert!(said.ends_with(":2: cannot be read: expected text in UTF-8"), "{said}");
    }

    #[test]
    fn merged_document_keeps_the_location_of_each_value() {
        let base = Document::parse("base.toml", "a = 1\n[b]\nc = [1, 2]\nd = 3\n[e]\nf = 1\n").unwrap();
        let top = Document::parse("top.toml", "[b]\nc = [9]\n[g]\nh = 2\n").unwrap();
        let both = top.over(base);
        let wanted = "a = 1\nb = { c = [9], d = 3 }\ne = { f = 1 }\ng = { h = 2 }";
        assert_eq!(both.table, wanted.parse().unwrap());
        for (key, at) in [
            ("a", "base.toml:1"),
            ("b.c[0]", "top.toml:2"),
            ("b.c[1]", "top.toml:2"),
            ("b.d", "base.toml:4"),
            ("e.f.x", "base.toml:6"),
            ("g.h", "top.toml:4"),
            ("z", "top.toml"),
        ] {
            assert_eq!(both.problem(key, "x").to_string(), format!("{at}: {key}: x"));
        }
        let third = Document::parse("third.toml", "[e]\nf = 2\n").unwrap().over(both);
        assert_eq!(third.problem("b.d", "x").to_string(), "base.toml:4: b.d: x");
        assert_eq!(third.problem("g.h", "x").to_string(), "top.toml:4: g.h: x");
    }

    #[test]
    fn value_can_be_located_after_parsing() {
        let document = Document::parse("a.toml", "x = 1\n[a]\nb = [\n 1,\n {c = 2},\n]\n").unwrap();
        assert_eq!(document.problem("a.b[1].c", "").line, Some(5));
        assert_eq!(document.problem("a.missing", "").line, Some(2));
        assert_eq!(document.problem("nowhere", "").line, None);
    }
}
