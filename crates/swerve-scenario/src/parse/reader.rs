//! Tables of a TOML text, read key by key; every problem is noted with its line and none stops the reading.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;

use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

use crate::Problem;

/// The text being read and the problems found so far.
pub(super) struct Source<'t> {
    file: &'t str,
    text: &'t str,
    problems: RefCell<Vec<Problem>>,
    lines: RefCell<BTreeMap<String, usize>>,
    guesses: Cell<usize>,
}

impl<'t> Source<'t> {
    pub(super) fn new(file: &'t str, text: &'t str) -> Self {
        Self { file, text, problems: RefCell::default(), lines: RefCell::default(), guesses: Cell::new(0) }
    }

    /// Line of a byte of the text, from 1.
    pub(super) fn line(&self, byte: usize) -> usize {
        1 + self.text.as_bytes()[..byte.min(self.text.len())].iter().filter(|&&b| b == b'\n').count()
    }

    /// Line of a key that was read; 0 for one that the text does not have.
    pub(super) fn line_of(&self, key: &str) -> usize {
        self.lines.borrow().get(key).copied().unwrap_or(0)
    }

    pub(super) fn report(&self, line: usize, key: &str, message: String) {
        let problem = Problem { file: self.file.to_owned(), line, key: key.to_owned(), message };
        self.problems.borrow_mut().push(problem);
    }

    /// How many values had to be made up because the text gives none that can be used.
    pub(super) fn guesses(&self) -> usize {
        self.guesses.get()
    }

    pub(super) fn into_problems(self) -> Vec<Problem> {
        let mut problems = self.problems.into_inner();
        problems.sort();
        problems.dedup();
        problems
    }

    fn guess(&self) {
        self.guesses.set(self.guesses.get() + 1);
    }
}

/// The values a number may take.
#[derive(Clone, Copy)]
pub(super) struct Range {
    low: f64,
    high: f64,
    low_is_in: bool,
}

impl Range {
    /// Both ends included.
    pub(super) const fn between(low: f64, high: f64) -> Self {
        Self { low, high, low_is_in: true }
    }

    /// Above zero, up to and with `high`.
    pub(super) const fn positive(high: f64) -> Self {
        Self { low: 0.0, high, low_is_in: false }
    }

    fn holds(&self, x: f64) -> bool {
        x <= self.high && if self.low_is_in { x >= self.low } else { x > self.low }
    }

    fn wanted(&self) -> String {
        if self.low_is_in {
            format!("a number from {} to {}", self.low, self.high)
        } else {
            format!("a number above {} and at most {}", self.low, self.high)
        }
    }
}

/// One table of the text.
pub(super) struct Table<'a, 't> {
    pub(super) source: &'a Source<'t>,
    /// Its key from the top of the text; empty for the whole text.
    pub(super) path: String,
    /// Line where it begins.
    pub(super) line: usize,
    table: &'a DeTable<'t>,
    known: RefCell<Vec<&'static str>>,
}

impl<'a, 't> Table<'a, 't> {
    pub(super) fn new(source: &'a Source<'t>, path: String, line: usize, table: &'a DeTable<'t>) -> Self {
        source.lines.borrow_mut().insert(path.clone(), line);
        Self { source, path, line, table, known: RefCell::default() }
    }

    /// The full name of one of its keys.
    pub(super) fn key(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }

    /// Reports a problem at one of its keys.
    pub(super) fn report(&self, key: &str, message: impl Into<String>) {
        let line = self.entry(key).map_or(self.line, |(line, _)| line);
        self.source.report(line, &self.key(key), message.into());
    }

    pub(super) fn has(&self, key: &'static str) -> bool {
        self.know(key);
        self.table.contains_key(key)
    }

    /// Its keys that are in the text, in the order of the text.
    pub(super) fn keys(&self) -> Vec<String> {
        let mut keys: Vec<_> = self.table.keys().map(|k| (k.span().start, k.get_ref().to_string())).collect();
        keys.sort();
        keys.into_iter().map(|(_, key)| key).collect()
    }

    fn know(&self, key: &'static str) {
        self.known.borrow_mut().push(key);
    }

    fn entry(&self, key: &str) -> Option<(usize, &'a Spanned<DeValue<'t>>)> {
        let (name, value) = self.table.get_key_value(key)?;
        let line = self.source.line(name.span().start);
        self.source.lines.borrow_mut().insert(self.key(key), line);
        Some((line, value))
    }

    fn get(&self, key: &'static str) -> Option<&'a DeValue<'t>> {
        self.know(key);
        self.entry(key).map(|(_, value)| value.get_ref())
    }

    fn missing(&self, key: &str, wanted: &str) {
        self.source.guess();
        self.source.report(self.line, &self.key(key), format!("is missing: expected {wanted}"));
    }

    fn mistyped(&self, key: &str, wanted: &str, found: &DeValue<'_>) {
        self.source.guess();
        self.report(key, format!("expected {wanted}, found {}", describe(found)));
    }

    /// A number that the text must give.
    pub(super) fn number(&self, key: &'static str, range: Range) -> f64 {
        match self.get(key) {
            Some(value) => self.in_range(key, value, range),
            None => {
                self.missing(key, &range.wanted());
                range.high
            }
        }
    }

    /// A number that the text may give.
    pub(super) fn number_if_any(&self, key: &'static str, range: Range) -> Option<f64> {
        self.get(key).map(|value| self.in_range(key, value, range))
    }

    /// A number, or the given one where the text has none.
    pub(super) fn number_or(&self, key: &'static str, otherwise: f64, range: Range) -> f64 {
        self.number_if_any(key, range).unwrap_or(otherwise)
    }

    fn in_range(&self, key: &str, value: &DeValue<'_>, range: Range) -> f64 {
        match number(value) {
            Some(x) if range.holds(x) => x,
            _ => {
                self.mistyped(key, &range.wanted(), value);
                range.high
            }
        }
    }

    /// A text that is not blank.
    pub(super) fn text(&self, key: &'static str) -> String {
        self.text_if_any(key).unwrap_or_else(|| {
            if !self.has(key) {
                self.missing(key, "a text");
            }
            String::new()
        })
    }

    /// A text that is not blank, where there is one.
    pub(super) fn text_if_any(&self, key: &'static str) -> Option<String> {
        match self.get(key)? {
            DeValue::String(text) if !text.trim().is_empty() => Some(text.to_string()),
            other => {
                self.mistyped(key, "a text that is not blank", other);
                None
            }
        }
    }

    /// One of the given names.
    pub(super) fn one_of(&self, key: &'static str, names: &[&'static str]) -> Option<usize> {
        let wanted = format!("one of {}", list(names));
        match self.get(key) {
            None => {
                self.missing(key, &wanted);
                None
            }
            Some(DeValue::String(text)) => {
                let found = names.iter().position(|&name| name == text.as_ref());
                if found.is_none() {
                    self.source.guess();
                    let hint =
                        nearest(text, names.iter().copied()).map(|n| format!("; did you mean \"{n}\"?"));
                    self.report(
                        key,
                        format!("expected {wanted}, found \"{text}\"{}", hint.unwrap_or_default()),
                    );
                }
                found
            }
            Some(other) => {
                self.mistyped(key, &wanted, other);
                None
            }
        }
    }

    /// A table that the text must have.
    pub(super) fn table(&self, key: &'static str) -> Option<Table<'a, 't>> {
        if !self.has(key) {
            self.missing(key, "a table");
        }
        self.table_if_any(key)
    }

    /// A table, where there is one.
    pub(super) fn table_if_any(&self, key: &'static str) -> Option<Table<'a, 't>> {
        self.know(key);
        self.named_table(key)
    }

    /// A table under a key that only the text knows.
    pub(super) fn named_table(&self, key: &str) -> Option<Table<'a, 't>> {
        let (line, value) = self.entry(key)?;
        match value.get_ref() {
            DeValue::Table(table) => {
                // A table with a heading of its own begins at that heading, not at its parent's first mention.
                let line = line.max(self.source.line(value.span().start));
                Some(Table::new(self.source, self.key(key), line, table))
            }
            other => {
                self.mistyped(key, "a table", other);
                None
            }
        }
    }

    /// All tables of an array of tables, empty where there is none; `name` gives each its name in keys.
    pub(super) fn tables(
        &self,
        key: &'static str,
        name: impl Fn(&Table<'a, 't>) -> Option<String>,
    ) -> Vec<Table<'a, 't>> {
        let Some(array) = self.array(key, "an array of tables") else { return Vec::new() };
        let mut tables = Vec::new();
        for (i, value) in array.iter().enumerate() {
            let line = self.source.line(value.span().start);
            let path = format!("{}[{}]", self.key(key), i);
            match value.get_ref() {
                DeValue::Table(table) => {
                    let mut found = Table::new(self.source, path, line, table);
                    if let Some(name) = name(&found) {
                        found = Table::new(self.source, format!("{}.{name}", self.key(key)), line, table);
                    }
                    tables.push(found);
                }
                other => {
                    self.source.guess();
                    self.source.report(line, &path, format!("expected a table, found {}", describe(other)));
                }
            }
        }
        tables
    }

    fn array(&self, key: &'static str, wanted: &str) -> Option<&'a DeArray<'t>> {
        match self.get(key)? {
            DeValue::Array(array) => Some(array),
            other => {
                self.mistyped(key, wanted, other);
                None
            }
        }
    }

    /// An array of pairs of numbers, as in `[[0.0, 5.0], [3.0, 0.0]]`; at least one. Empty after a problem.
    pub(super) fn pairs(&self, key: &'static str, wanted: &str, ranges: [Range; 2]) -> Vec<[f64; 2]> {
        if !self.has(key) {
            self.missing(key, wanted);
        }
        let Some(array) = self.array(key, wanted) else { return Vec::new() };
        if array.is_empty() {
            self.source.guess();
            self.report(key, format!("expected {wanted}, found an empty array"));
        }
        let mut pairs = Vec::new();
        for (i, value) in array.iter().enumerate() {
            let pair = value.get_ref().as_array().filter(|p| p.len() == 2);
            let read = |k: usize| {
                let x = pair.and_then(|p| p.get(k)).and_then(|v| number(v.get_ref()));
                x.filter(|&x| ranges[k].holds(x))
            };
            if let (Some(a), Some(b)) = (read(0), read(1)) {
                pairs.push([a, b]);
            } else {
                self.source.guess();
                let wanted = format!("{} and {}", ranges[0].wanted(), ranges[1].wanted());
                let found = describe(value.get_ref());
                let path = format!("{}[{}]", self.key(key), i);
                let line = self.source.line(value.span().start);
                self.source.report(line, &path, format!("expected a pair of {wanted}, found {found}"));
            }
        }
        if pairs.len() < array.len() {
            pairs.clear();
        }
        pairs
    }

    /// Whether the text gives exactly one of `keys`, and which; a problem otherwise.
    pub(super) fn only_one(&self, keys: &[&'static str]) -> Option<&'static str> {
        let found: Vec<_> = keys.iter().copied().filter(|key| self.has(key)).collect();
        match found[..] {
            [key] => Some(key),
            [] => {
                self.source.guess();
                let unknown = self.keys().into_iter().next();
                let hint = unknown.and_then(|u| nearest(&u, keys.iter().copied()).map(str::to_owned));
                let hint = hint.map(|n| format!("; did you mean \"{n}\"?")).unwrap_or_default();
                let message = format!("expected one of {}{hint}", list(keys));
                self.source.report(self.line, &self.path, message);
                None
            }
            _ => {
                self.source.guess();
                let message = format!("expected only one of {}, found {}", list(keys), list(&found));
                self.source.report(self.line, &self.path, message);
                None
            }
        }
    }

    /// Reports every key of the text that was never asked for, with the nearest one that exists.
    pub(super) fn finish(&self) {
        let mut known = self.known.borrow().clone();
        known.sort_unstable();
        known.dedup();
        for key in self.keys() {
            if known.contains(&key.as_str()) {
                continue;
            }
            let message = match nearest(&key, known.iter().copied()) {
                Some(near) => format!("unknown key; did you mean \"{near}\"?"),
                None => format!("unknown key; expected one of {}", list(&known)),
            };
            self.report(&key, message);
        }
    }
}

fn number(value: &DeValue<'_>) -> Option<f64> {
    let x = match value {
        DeValue::Float(float) => float.as_str().parse().ok(),
        DeValue::Integer(int) => i64::from_str_radix(int.as_str(), int.radix()).ok().map(|n| n as f64),
        _ => None,
    };
    x.filter(|x: &f64| x.is_finite())
}

fn describe(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("the text \"{text}\""),
        DeValue::Integer(int) => int.to_string(),
        DeValue::Float(float) => float.as_str().to_owned(),
        DeValue::Boolean(truth) => truth.to_string(),
        DeValue::Datetime(date) => format!("the date {date}"),
        DeValue::Array(_) => "an array".to_owned(),
        DeValue::Table(_) => "a table".to_owned(),
    }
}

/// The names in quotes, with commas.
pub(super) fn list(names: &[&str]) -> String {
    names.iter().map(|n| format!("\"{n}\"")).collect::<Vec<_>>().join(", ")
}

/// The name nearest to what was written, if any is near: by letters in common or by few slips of the pen.
pub(super) fn nearest<'n>(written: &str, names: impl IntoIterator<Item = &'n str>) -> Option<&'n str> {
    let mut best: Option<(f64, &str)> = None;
    for name in names {
        let slips = strsim::damerau_levenshtein(written, name);
        let likeness = strsim::jaro_winkler(written, name);
        let near = likeness > 0.75 || slips <= written.chars().count() / 3;
        let score = likeness - slips as f64 * 0.01;
        if near && best.is_none_or(|(b, _)| score > b) {
            best = Some((score, name));
        }
    }
    best.map(|(_, name)| name)
}
