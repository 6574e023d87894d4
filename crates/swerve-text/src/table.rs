//! Key-by-key reading of TOML tables; problems are collected with their locations, and none stops the reading.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;

use toml::Value;

use crate::bound::{NAME_MAX, too_long};
use crate::problem::KnownKeys;
use crate::words::{describe, did_you_mean, is_shown, list, unknown_key, unknown_name};
use crate::{Document, Problem, Problems};

/// Valid range of a number, both limits included.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    low: f64,
    high: f64,
}

impl Range {
    /// Creates the range from `low` to `high`.
    pub const fn between(low: f64, high: f64) -> Self {
        Self { low, high }
    }

    fn holds(&self, x: f64) -> bool {
        (self.low..=self.high).contains(&x)
    }

    fn wanted(&self) -> String {
        format!("a number from {} to {}", self.low, self.high)
    }
}

/// State of reading a text, with the problems found so far.
pub struct Reading<'d> {
    file: &'d str,
    /// Source of line numbers; without it, problems have no lines.
    document: Option<&'d Document>,
    problems: RefCell<Vec<Problem>>,
    /// Valid keys beside each unknown one.
    known: RefCell<KnownKeys>,
    /// Locations of tables that have another name in messages.
    named: RefCell<BTreeMap<String, String>>,
    guesses: Cell<usize>,
}

impl<'d> Reading<'d> {
    /// Starts reading a document.
    pub fn of(document: &'d Document) -> Self {
        Self { document: Some(document), ..Self::without_text(&document.file) }
    }

    /// Starts reading a table without its text: its problems have no lines. `name` is the file name in messages.
    pub fn without_text(name: &'d str) -> Self {
        Self {
            file: name,
            document: None,
            problems: RefCell::default(),
            known: RefCell::default(),
            named: RefCell::default(),
            guesses: Cell::new(0),
        }
    }

    /// Reader of the whole table.
    pub fn top<'r>(&'r self, table: &'r toml::Table) -> TableReader<'r> {
        TableReader {
            reading: self,
            table,
            place: String::new(),
            path: String::new(),
            known: RefCell::default(),
        }
    }

    /// Reports a problem with dotted `key`, named as in messages.
    pub fn report(&self, key: &str, message: impl Into<String>) {
        let named = self.named.borrow();
        let ends = key.rmatch_indices(['.', '[']).map(|(at, _)| at);
        let mut tables = std::iter::once(key.len()).chain(ends).map(|end| key.split_at(end));
        let place = tables.find_map(|(name, rest)| named.get(name).map(|place| format!("{place}{rest}")));
        let place = place.unwrap_or_else(|| key.to_owned());
        self.note(&place, key, message.into());
    }

    /// Name of the file.
    pub fn file(&self) -> &'d str {
        self.file
    }

    /// Number of values that had to be replaced because the text has no usable one.
    pub fn guesses(&self) -> usize {
        self.guesses.get()
    }

    /// All problems, ordered by line if the lines are known.
    pub fn into_problems(self) -> Problems {
        let mut problems = self.problems.into_inner();
        if self.document.is_some() {
            problems.sort();
            problems.dedup();
        }
        Problems::from_iter(problems).with_known(self.known.into_inner())
    }

    fn note(&self, place: &str, key: &str, message: String) {
        let line = self.document.and_then(|document| document.line(place));
        // A key missing from the whole text is reported at its first line.
        let line = line.or(self.document.filter(|_| !key.is_empty()).map(|_| 1));
        let problem = Problem { file: self.file.to_owned(), line, key: key.to_owned(), message };
        self.problems.borrow_mut().push(problem);
    }

    /// Counts a value that has to be replaced because the text has no usable one.
    pub fn guess(&self) {
        self.guesses.set(self.guesses.get() + 1);
    }
}

/// Reader of one table. Problems are added to its [`Reading`].
pub struct TableReader<'r> {
    reading: &'r Reading<'r>,
    table: &'r toml::Table,
    /// Key in the text, with indices.
    place: String,
    /// Key in messages; empty for the whole text.
    path: String,
    known: RefCell<Vec<&'static str>>,
}

fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

impl<'r> TableReader<'r> {
    /// State of reading the text.
    pub fn reading(&self) -> &'r Reading<'r> {
        self.reading
    }

    /// Key from the top of the text, as in messages; empty for the whole text.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Full name of a key of this table.
    pub fn key(&self, key: &str) -> String {
        join(&self.path, key)
    }

    /// Reports a problem with a key of this table.
    pub fn report(&self, key: &str, message: impl Into<String>) {
        self.reading.note(&join(&self.place, key), &self.key(key), message.into());
    }

    /// Reports a problem with the table as a whole.
    pub fn report_whole(&self, message: impl Into<String>) {
        self.reading.note(&self.place, &self.path, message.into());
    }

    /// True if the text has this key.
    pub fn has(&self, key: &'static str) -> bool {
        self.value(key).is_some()
    }

    /// Value of a key, unchecked.
    pub fn value(&self, key: &'static str) -> Option<&'r Value> {
        self.know(key);
        self.table.get(key)
    }

    /// Keys present in the text, in the order of the text.
    pub fn keys(&self) -> Vec<&'r str> {
        let mut keys: Vec<&str> = self.table.keys().map(String::as_str).collect();
        if let Some(document) = self.reading.document {
            keys.sort_by_key(|key| document.start(&join(&self.place, key)));
        }
        keys
    }

    fn know(&self, key: &'static str) {
        self.known.borrow_mut().push(key);
    }

    fn missing(&self, key: &str, wanted: &str) {
        self.reading.guess();
        self.report(key, format!("is missing: expected {wanted}"));
    }

    /// Reports that a key has another value than `wanted`.
    pub fn mistyped(&self, key: &str, wanted: &str, found: &Value) {
        self.reading.guess();
        self.report(key, format!("expected {wanted}, found {}", describe(found)));
    }

    /// Reads a required number.
    pub fn number(&self, key: &'static str, range: Range) -> f64 {
        self.number_if_any(key, range).unwrap_or_else(|| {
            self.missing(key, &range.wanted());
            range.high
        })
    }

    /// Reads an optional number.
    pub fn number_if_any(&self, key: &'static str, range: Range) -> Option<f64> {
        let value = self.value(key)?;
        let x = as_number(value).filter(|&x| range.holds(x));
        Some(x.unwrap_or_else(|| {
            self.mistyped(key, &range.wanted(), value);
            range.high
        }))
    }

    /// Reads a number, with a default.
    pub fn number_or(&self, key: &'static str, otherwise: f64, range: Range) -> f64 {
        self.number_if_any(key, range).unwrap_or(otherwise)
    }

    /// Reads an optional integer from `low` to `high`.
    pub fn whole_if_any(&self, key: &'static str, low: i64, high: i64) -> Option<i64> {
        let value = self.value(key)?;
        let n = value.as_integer().filter(|n| (low..=high).contains(n));
        if n.is_none() {
            self.mistyped(key, &format!("a whole number from {low} to {high}"), value);
        }
        n
    }

    /// Reads an optional boolean.
    pub fn truth_if_any(&self, key: &'static str) -> Option<bool> {
        let value = self.value(key)?;
        if !value.is_bool() {
            self.mistyped(key, "true or false", value);
        }
        value.as_bool()
    }

    /// Reads a required text that is not blank.
    pub fn text(&self, key: &'static str) -> String {
        if !self.has(key) {
            self.missing(key, "a text");
        }
        self.text_if_any(key).unwrap_or_default()
    }

    /// Reads a required array of texts, at least one. Empty after a problem.
    pub fn texts(&self, key: &'static str) -> Vec<String> {
        let wanted = "an array of texts";
        let texts: Option<Vec<String>> = self
            .value(key)
            .and_then(|value| value.as_array()?.iter().map(|text| Some(text.as_str()?.to_owned())).collect());
        match (texts.filter(|texts| !texts.is_empty()), self.value(key)) {
            (Some(texts), _) => return texts,
            (None, Some(found)) => self.mistyped(key, wanted, found),
            (None, None) => self.missing(key, wanted),
        }
        Vec::new()
    }

    /// Reads an optional text that is not blank and has no control characters.
    pub fn text_if_any(&self, key: &'static str) -> Option<String> {
        self.text_like(key, "a text that is not blank, without control characters", is_shown)
    }

    /// Reads an optional name of a given form, of at most [`NAME_MAX`] characters.
    pub fn text_like(
        &self,
        key: &'static str,
        wanted: &str,
        is_right: impl Fn(&str) -> bool,
    ) -> Option<String> {
        let text = self.paragraph_like(key, wanted, is_right)?;
        let Some(message) = too_long(&text, NAME_MAX) else { return Some(text) };
        self.reading.guess();
        self.report(key, message);
        None
    }

    /// Reads an optional text of a given form.
    pub fn paragraph_like(
        &self,
        key: &'static str,
        wanted: &str,
        is_right: impl Fn(&str) -> bool,
    ) -> Option<String> {
        let value = self.value(key)?;
        let text = value.as_str().filter(|text| is_right(text));
        if text.is_none() {
            self.mistyped(key, wanted, value);
        }
        text.map(str::to_owned)
    }

    /// Reads a required name; returns its index in `names`.
    pub fn one_of(&self, key: &'static str, names: &[&str]) -> Option<usize> {
        if !self.has(key) {
            self.missing(key, &format!("one of {}", list(names)));
        }
        self.one_of_if_any(key, names)
    }

    /// Reads an optional name; returns its index in `names`.
    pub fn one_of_if_any(&self, key: &'static str, names: &[&str]) -> Option<usize> {
        let value = self.value(key)?;
        let Some(text) = value.as_str() else {
            self.mistyped(key, &format!("one of {}", list(names)), value);
            return None;
        };
        let found = names.iter().position(|&name| name == text);
        if found.is_none() {
            self.reading.guess();
            self.report(key, unknown_name(text, names));
        }
        found
    }

    /// Reads a required table.
    pub fn table(&self, key: &'static str) -> Option<TableReader<'r>> {
        if !self.has(key) {
            self.missing(key, "a table");
        }
        self.table_if_any(key)
    }

    /// Reads an optional table.
    pub fn table_if_any(&self, key: &'static str) -> Option<TableReader<'r>> {
        self.know(key);
        self.named_table(key)
    }

    /// Reads a table under a key defined by the text.
    pub fn named_table(&self, key: &str) -> Option<TableReader<'r>> {
        match self.table.get(key)? {
            Value::Table(table) => Some(self.inner(join(&self.place, key), self.key(key), table)),
            other => {
                self.mistyped(key, "a table", other);
                None
            }
        }
    }

    fn inner(&self, place: String, path: String, table: &'r toml::Table) -> TableReader<'r> {
        if place != path {
            self.reading.named.borrow_mut().insert(path.clone(), place.clone());
        }
        TableReader { reading: self.reading, table, place, path, known: RefCell::default() }
    }

    /// Reads an array of tables, empty if absent; `name` gives the name of each in messages, or its index for `None`.
    pub fn tables(
        &self,
        key: &'static str,
        name: impl Fn(&TableReader<'r>) -> Option<String>,
    ) -> Vec<TableReader<'r>> {
        let mut tables = Vec::new();
        let wanted = match self.path.is_empty() {
            true => format!("an array of tables, each after `[[{key}]]`"),
            false => "an array of tables".to_owned(),
        };
        for (i, value) in self.array(key, &wanted).iter().enumerate() {
            let (place, path) =
                (format!("{}[{i}]", join(&self.place, key)), format!("{}[{i}]", self.key(key)));
            match value {
                Value::Table(table) => {
                    let unnamed = self.inner(place.clone(), path, table);
                    tables.push(match name(&unnamed) {
                        Some(name) => {
                            let named = self.inner(place, format!("{}.{name}", self.key(key)), table);
                            TableReader { known: unnamed.known, ..named }
                        }
                        None => unnamed,
                    });
                }
                other => {
                    self.reading.guess();
                    self.reading.note(&place, &path, format!("expected a table, found {}", describe(other)));
                }
            }
        }
        tables
    }

    fn array(&self, key: &'static str, wanted: &str) -> &'r [Value] {
        match self.value(key) {
            Some(Value::Array(array)) => array,
            Some(other) => {
                self.mistyped(key, wanted, other);
                &[]
            }
            None => &[],
        }
    }

    /// Reads an array of at least one pair of numbers, as in `[[0.0, 5.0], [3.0, 0.0]]`. Empty after a problem.
    pub fn pairs(&self, key: &'static str, wanted: &str, ranges: [Range; 2]) -> Vec<[f64; 2]> {
        match self.value(key) {
            None => self.missing(key, wanted),
            Some(Value::Array(items)) if items.is_empty() => {
                self.reading.guess();
                self.report(key, format!("expected {wanted}, found an empty array"));
            }
            Some(_) => {}
        }
        let array = self.array(key, wanted);
        let mut pairs = Vec::new();
        for (i, value) in array.iter().enumerate() {
            let pair = value.as_array().filter(|pair| pair.len() == 2);
            let read = |k: usize| pair.and_then(|pair| as_number(&pair[k])).filter(|&x| ranges[k].holds(x));
            if let (Some(a), Some(b)) = (read(0), read(1)) {
                pairs.push([a, b]);
            } else {
                let wanted = format!("a pair of {} and {}", ranges[0].wanted(), ranges[1].wanted());
                self.mistyped(&format!("{key}[{i}]"), &wanted, value);
            }
        }
        if pairs.len() < array.len() {
            pairs.clear();
        }
        pairs
    }

    /// Returns the only one of `keys` in the text; reports a problem unless there is exactly one.
    pub fn only_one(&self, keys: &[&'static str]) -> Option<&'static str> {
        let found: Vec<_> = keys.iter().copied().filter(|key| self.has(key)).collect();
        let message = match found[..] {
            [key] => return Some(key),
            [] => {
                let known = self.known.borrow();
                let unknown = self.keys().into_iter().filter(|key| !known.contains(key));
                let mut hints = unknown.map(|key| did_you_mean(key, keys.iter().copied()));
                let hint = hints.find(|hint| !hint.is_empty()).unwrap_or_default();
                format!("expected one of {}{hint}", list(keys))
            }
            _ => format!("expected only one of {}, found {}", list(keys), list(&found)),
        };
        self.reading.guess();
        self.report_whole(message);
        None
    }

    /// Reports every key of the text that was never read, with the nearest known one.
    pub fn finish(&self) {
        let mut known = self.known.borrow().clone();
        known.sort_unstable();
        known.dedup();
        for key in self.keys().into_iter().filter(|key| !known.contains(key)) {
            self.report(key, unknown_key(key, &known));
            self.reading.known.borrow_mut().insert(self.key(key), known.clone());
        }
    }
}

/// Converts to a finite number.
fn as_number(value: &Value) -> Option<f64> {
    let x = value.as_float().or_else(|| value.as_integer().map(|n| n as f64));
    x.filter(|x| x.is_finite())
}

#[cfg(test)]
mod tests;
