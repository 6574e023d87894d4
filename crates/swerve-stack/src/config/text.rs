//! TOML text with problems that name file, line and key.

use std::fmt;
use std::path::Path;

use serde::de::DeserializeOwned;
use toml::de::{DeTable, DeValue};

use super::faults::faults;

/// One thing wrong with one file.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Problem {
    /// The file as the user named it, or where else the text came from.
    pub file: String,
    /// Line, from 1; `None` when the problem has no place in the text.
    pub line: Option<usize>,
    /// Dotted key; empty when the problem is the whole file's.
    pub key: String,
    /// What is wrong and what was expected.
    pub message: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        f.write_str(": ")?;
        if !self.key.is_empty() {
            write!(f, "{}: ", self.key)?;
        }
        f.write_str(&self.message)
    }
}

impl std::error::Error for Problem {}

/// A TOML file read once: its text for places, its table for values.
#[derive(Clone, Debug)]
pub struct Document {
    /// Name for messages.
    pub file: String,
    /// The values.
    pub table: toml::Table,
    text: String,
    places: Vec<Place>,
}

#[derive(Clone, Debug)]
struct Place {
    key: String,
    start: usize,
}

impl Document {
    /// The same text with other values.
    pub fn with_table(&self, table: toml::Table) -> Self {
        Self { table, ..self.clone() }
    }

    /// Reads a file.
    pub fn read(path: &Path) -> Result<Self, Problem> {
        let file = path.display().to_string();
        match swerve_scenario::read_text(path) {
            Ok(text) => Self::parse(&file, text),
            Err(error) => Err(Problem {
                file,
                line: None,
                key: String::new(),
                message: format!("cannot be read: {error}"),
            }),
        }
    }

    /// Takes text that is already at hand; `file` names it in messages.
    pub fn parse(file: &str, text: String) -> Result<Self, Problem> {
        let (table, places) = {
            let parsed = DeTable::parse(&text).map_err(|error| syntax_problem(file, &text, &error))?;
            let mut places = Vec::new();
            collect_places(parsed.get_ref(), "", &mut places);
            let table = toml::from_str(&text).map_err(|error| syntax_problem(file, &text, &error))?;
            (table, places)
        };
        Ok(Self { file: file.to_owned(), table, text, places })
    }

    /// The typed form of the whole text, or all that has not its form.
    pub fn to<T: DeserializeOwned>(&self) -> Result<T, Vec<Problem>> {
        toml::from_str(&self.text).map_err(|error| {
            let told = faults::<T>(&self.table);
            if told.is_empty() {
                return vec![syntax_problem(&self.file, &self.text, &error)];
            }
            let mut problems: Vec<Problem> =
                told.iter().map(|(key, message)| self.problem(key, message.as_str())).collect();
            problems.sort_by_key(|problem| problem.line);
            problems
        })
    }

    /// A problem with the value at dotted `key` (or, where that is not written, with its nearest parent).
    pub fn problem(&self, key: &str, message: impl Into<String>) -> Problem {
        let mut at = key;
        let place = loop {
            if let Some(place) = self.places.iter().find(|p| p.key == at) {
                break Some(place);
            }
            match at.rsplit_once(['.', '[']) {
                Some((parent, _)) => at = parent,
                None => break None,
            }
        };
        Problem {
            file: self.file.clone(),
            line: place.map(|p| line_of(&self.text, p.start)),
            key: key.to_owned(),
            message: message.into(),
        }
    }
}

fn collect_places(table: &DeTable<'_>, prefix: &str, places: &mut Vec<Place>) {
    for (name, value) in table {
        let key = if prefix.is_empty() {
            name.get_ref().to_string()
        } else {
            format!("{prefix}.{}", name.get_ref())
        };
        places.push(Place { key: key.clone(), start: name.span().start });
        match value.get_ref() {
            DeValue::Table(inner) => collect_places(inner, &key, places),
            DeValue::Array(items) => {
                for (i, item) in items.iter().enumerate() {
                    let key = format!("{key}[{i}]");
                    places.push(Place { key: key.clone(), start: item.span().start });
                    if let DeValue::Table(inner) = item.get_ref() {
                        collect_places(inner, &key, places);
                    }
                }
            }
            _ => {}
        }
    }
}

fn syntax_problem(file: &str, text: &str, error: &toml::de::Error) -> Problem {
    Problem {
        file: file.to_owned(),
        line: error.span().map(|span| line_of(text, span.start)),
        key: String::new(),
        message: format!("not TOML: {}", error.message().trim_end()),
    }
}

fn line_of(text: &str, offset: usize) -> usize {
    text.as_bytes()[..offset.min(text.len())].iter().filter(|b| **b == b'\n').count() + 1
}

/// Sets the value at dotted `key`, making tables on the way.
pub fn set(table: &mut toml::Table, key: &str, value: toml::Value) -> Result<(), String> {
    let (path, name) = key.rsplit_once('.').unwrap_or(("", key));
    let mut at = table;
    for part in path.split('.').filter(|p| !p.is_empty()) {
        let inner = at.entry(part).or_insert_with(|| toml::Value::Table(toml::Table::new()));
        at = inner.as_table_mut().ok_or_else(|| format!("`{part}` is a value, not a table"))?;
    }
    at.insert(name.to_owned(), value);
    Ok(())
}

/// Reads `key=value` as `--set` takes it; a value that is no TOML is a string.
pub fn parse_assignment(text: &str) -> Result<(String, toml::Value), Problem> {
    let problem = |message: &str| Problem {
        file: "--set".to_owned(),
        line: None,
        key: text.to_owned(),
        message: message.to_owned(),
    };
    let (key, value) = text.split_once('=').ok_or_else(|| problem("expected key=value"))?;
    let key = key.trim();
    if key.is_empty() || key.split('.').any(str::is_empty) {
        return Err(problem("expected a dotted key before `=`"));
    }
    let value = value.trim();
    let parsed = toml::from_str::<toml::Table>(&format!("v = {value}")).ok().and_then(|mut t| t.remove("v"));
    Ok((key.to_owned(), parsed.unwrap_or_else(|| toml::Value::String(value.to_owned()))))
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
        let read = Document::parse("a.toml", text.to_owned()).map_err(|problem| vec![problem]);
        let problems = read.and_then(|document| document.to::<Outer>()).expect_err("wrong on purpose");
        problems.iter().map(Problem::to_string).collect::<Vec<_>>().join(" & ")
    }

    #[test]
    fn a_problem_names_file_line_key_and_what_was_expected() {
        assert_eq!(
            problem("[inner]\nhorizn = 1.0\n"),
            "a.toml:2: inner.horizn: unknown key; did you mean \"horizon\"?"
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
        assert!(problem("[inner\n").starts_with("a.toml:1: not TOML: "), "{}", problem("[inner\n"));
    }

    #[test]
    fn a_value_can_be_located_after_parsing() {
        let document =
            Document::parse("a.toml", "x = 1\n[a]\nb = [\n 1,\n {c = 2},\n]\n".to_owned()).unwrap();
        assert_eq!(document.problem("a.b[1].c", "").line, Some(5));
        assert_eq!(document.problem("a.missing", "").line, Some(2));
        assert_eq!(document.problem("nowhere", "").line, None);
    }

    #[test]
    fn assignments_are_toml_or_strings() {
        let value = |text| parse_assignment(text).unwrap().1;
        assert_eq!(value("a=1.5"), toml::Value::Float(1.5));
        assert_eq!(value("a=fot"), toml::Value::String("fot".into()));
        assert_eq!(value("a=[1, 2]").as_array().unwrap().len(), 2);
        assert!(parse_assignment("a").is_err() && parse_assignment("a..b=1").is_err());
        let mut table = toml::Table::new();
        set(&mut table, "a.b.c", toml::Value::Integer(1)).unwrap();
        assert!(set(&mut table, "a.b.c.d", toml::Value::Integer(1)).is_err());
    }
}
