//! Everything in a TOML table that has not the form of a Rust type, in words of TOML.
//!
//! serde stops at the first fault and speaks of Rust types. So each fault is mended in a copy of the table, with a
//! value that the type takes, and the copy is read again: the next fault shows. What the type would take at a
//! place is found in the same way: it is offered a value of another kind and says what it expected instead.

use std::borrow::Cow;

use serde::de::DeserializeOwned;
use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

use super::words::{nearest, number};

/// A file with more faults than this is another kind of file.
const TOLD_MAX: usize = 50;
/// A name that no list of names holds.
const NO_NAME: &str = "?";

/// One step from the top of a table to a value in it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Part {
    /// Into a table.
    Key(String),
    /// Into an array, from 0.
    Index(usize),
}

/// A path as messages have it: `operator[0].every_ms`.
pub fn dotted(path: &[Part]) -> String {
    path.iter().fold(String::new(), |key, part| match part {
        Part::Key(name) if key.is_empty() => name.clone(),
        Part::Key(name) => format!("{key}.{name}"),
        Part::Index(index) => format!("{key}[{index}]"),
    })
}

/// Whether `key` is `outer` or within it.
pub fn is_within(key: &str, outer: &str) -> bool {
    let rest = key.strip_prefix(outer);
    outer.is_empty() || rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

/// What is wrong with the form of `table` as a `T`, each with its key: all of it, but for what is within a value
/// that is wrong as a whole.
pub fn faults<T: DeserializeOwned>(table: &Table) -> Vec<(String, String)> {
    let mut table = table.clone();
    let mut told: Vec<(String, String)> = Vec::new();
    let mut meant = Vec::new();
    while let Some(fault) = Fault::first::<T>(&table).filter(|_| told.len() < TOLD_MAX) {
        let key = dotted(&fault.path);
        meant.extend(fault.meant());
        // A key with a slip in its name is not missing as well.
        let is_told = fault.missing().is_some() && meant.contains(&key);
        if !is_told && !told.iter().any(|(outer, _)| is_within(&key, outer)) {
            told.push((key, fault.message::<T>(&table)));
        }
        if !fault.mend::<T>(&mut table) {
            break;
        }
    }
    // A value that is wrong as a whole may show only after what is in it.
    let keys: Vec<String> = told.iter().map(|(key, _)| key.clone()).collect();
    told.retain(|(key, _)| !keys.iter().any(|outer| outer != key && is_within(key, outer)));
    told
}

/// The first thing wrong with the form of a table.
struct Fault {
    path: Vec<Part>,
    /// In serde's words.
    message: String,
}

impl Fault {
    fn first<T: DeserializeOwned>(table: &Table) -> Option<Self> {
        let text = toml::to_string(table).expect("a table of values has a text");
        let error = toml::from_str::<T>(&text).err()?;
        let parsed = DeTable::parse(&text).expect("the text of a table is a table");
        let mut path = Vec::new();
        // An empty span is the whole text's.
        if let Some(span) = error.span().filter(|span| !span.is_empty()) {
            visit(parsed.get_ref(), &mut Vec::new(), &mut |at, name, value| {
                let holds = |r: &std::ops::Range<usize>| r.start <= span.start && span.end <= r.end;
                if (holds(&name) || holds(&value)) && at.len() > path.len() {
                    path = at.to_vec();
                }
            });
        }
        let mut fault = Self { path, message: error.message().trim_end().to_owned() };
        if let Some(name) = fault.missing() {
            fault.path.push(Part::Key(name));
        }
        Some(fault)
    }

    /// The key that is not there, if that is the fault.
    fn missing(&self) -> Option<String> {
        Some(self.message.strip_prefix("missing field `")?.strip_suffix('`')?.to_owned())
    }

    /// What is unknown (`field` or `variant`), its name, and the names that are known.
    fn unknown(&self) -> Option<(&str, &str, Vec<&str>)> {
        let (what, _) = self.message.strip_prefix("unknown ")?.split_once(' ')?;
        let mut names = self.message.split('`').skip(1).step_by(2);
        Some((what, names.next()?, names.collect()))
    }

    /// The key that was meant by an unknown one.
    fn meant(&self) -> Option<String> {
        let (_, wrong, known) = self.unknown().filter(|(what, ..)| *what == "field")?;
        let (_, parents) = self.path.split_last()?;
        let near = Part::Key(nearest(wrong, known)?.to_owned());
        Some(dotted(&[parents, &[near]].concat()))
    }

    fn message<T: DeserializeOwned>(&self, table: &Table) -> String {
        let wanted = || self.wanted::<T>(table).unwrap_or_else(|| "a value".to_owned());
        if self.missing().is_some() {
            return format!("is missing: expected {}", wanted());
        }
        if let Some((what, wrong, known)) = self.unknown() {
            let near = nearest(wrong, known.iter().copied());
            let hint = near.map_or_else(String::new, |near| format!("; did you mean \"{near}\"?"));
            return match (what, near) {
                ("field", Some(_)) => format!("unknown key{hint}"),
                ("field", None) => format!("unknown key; expected one of {}", listed(&known)),
                _ => format!("expected one of {}, found \"{wrong}\"{hint}", listed(&known)),
            };
        }
        match get(table, &self.path) {
            Some(found) => format!("expected {}, found {}", wanted(), describe(found)),
            None => self.message.clone(),
        }
    }

    /// What `T` takes at this place.
    fn wanted<T: DeserializeOwned>(&self, table: &Table) -> Option<String> {
        let says = |value: Value| {
            let mut table = table.clone();
            put(&mut table, &self.path, Some(value));
            Self::first::<T>(&table).filter(|fault| fault.path.starts_with(&self.path))
        };
        if let Some(named) = says(NO_NAME.into())
            && let Some(("variant", _, known)) = named.unknown()
        {
            return Some(format!("one of {}", listed(&known)));
        }
        let Some(said) = says(true.into()) else { return Some("true or false".into()) };
        let wanted = said.message.split_once(", expected ").map(|(_, wanted)| wanted)?;
        Some(in_words(wanted).into_owned())
    }

    /// Puts something in the place of the fault that `T` takes; false where nothing was found.
    fn mend<T: DeserializeOwned>(&self, table: &mut Table) -> bool {
        if self.missing().is_none() && matches!(self.path.last(), Some(Part::Key(_))) {
            put(table, &self.path, None);
            let next = Self::first::<T>(table);
            if next.is_none_or(|next| next.path != self.path) {
                return true;
            }
        }
        let names = self.wanted::<T>(table).unwrap_or_default();
        let name = names.split('"').nth(1).unwrap_or_default().to_owned();
        let pair = Value::Array(vec![Value::Integer(1), Value::Integer(2)]);
        let kinds: [Value; 7] = [
            Value::Integer(1),
            name.into(),
            Value::Array(Vec::new()),
            Value::Table(Table::new()),
            true.into(),
            pair.clone(),
            Value::Array(vec![pair]),
        ];
        kinds.into_iter().any(|value| {
            put(table, &self.path, Some(value));
            let next = Self::first::<T>(table);
            // A fault further inside is one of a value that is of the right kind.
            next.is_none_or(|next| !next.path.starts_with(&self.path) || next.path.len() > self.path.len())
        })
    }
}

/// Calls `with` for every value of a table: its path, the places of its name and of itself in the text.
fn visit(
    table: &DeTable<'_>,
    path: &mut Vec<Part>,
    with: &mut impl FnMut(&[Part], std::ops::Range<usize>, std::ops::Range<usize>),
) {
    for (name, value) in table {
        path.push(Part::Key(name.get_ref().to_string()));
        with(path, name.span(), value.span());
        visit_value(value.get_ref(), path, with);
        path.pop();
    }
}

fn visit_value(
    value: &DeValue<'_>,
    path: &mut Vec<Part>,
    with: &mut impl FnMut(&[Part], std::ops::Range<usize>, std::ops::Range<usize>),
) {
    match value {
        DeValue::Table(inner) => visit(inner, path, with),
        DeValue::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                path.push(Part::Index(i));
                with(path, item.span(), item.span());
                visit_value(item.get_ref(), path, with);
                path.pop();
            }
        }
        _ => {}
    }
}

/// The value at `path`.
fn get<'a>(table: &'a Table, path: &[Part]) -> Option<&'a Value> {
    let (Part::Key(first), rest) = path.split_first()? else { return None };
    rest.iter().try_fold(table.get(first)?, |at, part| match part {
        Part::Key(name) => at.get(name.as_str()),
        Part::Index(i) => at.get(*i),
    })
}

/// Sets the value at `path` of a table that has all but its last part, or takes it away.
fn put(table: &mut Table, path: &[Part], value: Option<Value>) {
    let Some((last, parents)) = path.split_last() else { return };
    let parent = parents.split_first().map(|(first, rest)| {
        let Part::Key(first) = first else { return None };
        rest.iter().try_fold(table.get_mut(first)?, |at, part| match part {
            Part::Key(name) => at.get_mut(name.as_str()),
            Part::Index(i) => at.get_mut(*i),
        })
    });
    match (parent, last) {
        (None, Part::Key(name)) => put_key(table, name, value),
        (Some(Some(Value::Table(inner))), Part::Key(name)) => put_key(inner, name, value),
        (Some(Some(Value::Array(items))), Part::Index(i)) => {
            if let (Some(item), Some(value)) = (items.get_mut(*i), value) {
                *item = value;
            }
        }
        _ => {}
    }
}

fn put_key(table: &mut Table, name: &str, value: Option<Value>) {
    match value {
        Some(value) => table.insert(name.to_owned(), value),
        None => table.remove(name),
    };
}

/// Names in quotes, with commas.
fn listed(names: &[&str]) -> String {
    names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ")
}

/// A value in a message.
fn describe(value: &Value) -> String {
    match value {
        Value::String(text) => format!("the text \"{text}\""),
        Value::Float(x) => number(*x),
        Value::Array(items) => format!("an array of {}", items.len()),
        Value::Table(_) => "a table".into(),
        Value::Integer(_) | Value::Boolean(_) | Value::Datetime(_) => value.to_string(),
    }
}

/// serde's names of types in words of TOML.
fn in_words(wanted: &str) -> Cow<'_, str> {
    let length = |prefix| wanted.strip_prefix(prefix).map(|n| format!("an array of {n} values").into());
    match wanted {
        "f64" | "f32" => "a number".into(),
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number that is not negative".into(),
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number".into(),
        "a boolean" => "true or false".into(),
        "a string" | "path string" => "a text".into(),
        "a sequence" => "an array".into(),
        "a map" => "a table".into(),
        _ if wanted.starts_with("struct ") => "a table".into(),
        _ => length("an array of length ").or_else(|| length("a tuple of size ")).unwrap_or(wanted.into()),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use serde::Deserialize;

    #[derive(Deserialize, PartialEq, Eq, PartialOrd, Ord)]
    #[serde(rename_all = "snake_case")]
    enum Way {
        Left,
        Right,
    }

    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only read through its errors")]
    struct Inner {
        number: f64,
        count: Option<usize>,
        way: Way,
        ways: Option<Vec<Way>>,
        pair: Option<[f64; 2]>,
        #[serde(default)]
        name: String,
    }

    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only read through its errors")]
    struct Outer {
        #[serde(default)]
        by_way: BTreeMap<Way, f64>,
        is_on: bool,
        inner: Inner,
        #[serde(default)]
        list: Vec<Inner>,
    }

    fn told(text: &str) -> Vec<String> {
        let table: Table = text.parse().unwrap();
        faults::<Outer>(&table).iter().map(|(key, message)| format!("{key}: {message}")).collect()
    }

    #[test]
    fn nothing_is_wrong_with_the_right_form() {
        assert_eq!(told("is_on = true\n[inner]\nnumber = 1\nway = \"left\"\npair = [1, 2.5]\n"), [""; 0]);
    }

    #[test]
    fn every_fault_is_told_in_words_of_toml() {
        let text = "is_on = 1\n[inner]\nnumber = \"far\"\ncount = -1\nway = 5\nways = [\"left\", \"rigt\"]\n\
                    pair = [1]\nname = 1e308\nnmae = 1\n[[list]]\n[[list]]\nnumber = [1]\nway = \"up\"\nother = 3\n";
        let mut told = told(text);
        told.sort();
        let ways = "one of \"left\", \"right\"";
        assert_eq!(
            told,
            [
                "inner.count: expected a whole number that is not negative, found -1".to_owned(),
                "inner.name: expected a text, found 1e308".into(),
                "inner.nmae: unknown key; did you mean \"name\"?".into(),
                "inner.number: expected a number, found the text \"far\"".into(),
                "inner.pair: expected an array of 2 values, found an array of 1".into(),
                format!("inner.way: expected {ways}, found 5"),
                format!("inner.ways[1]: expected {ways}, found \"rigt\"; did you mean \"right\"?"),
                "is_on: expected true or false, found 1".into(),
                "list[0].number: is missing: expected a number".into(),
                format!("list[0].way: is missing: expected {ways}"),
                "list[1].number: expected a number, found an array of 1".into(),
                "list[1].other: unknown key; expected one of \"number\", \"count\", \"way\", \"ways\", \"pair\", \"name\"".into(),
                format!("list[1].way: expected {ways}, found \"up\""),
            ]
        );
    }

    #[test]
    fn what_is_within_a_wrong_value_is_not_told() {
        assert_eq!(told("is_on = true\ninner = 5\n"), ["inner: expected a table, found 5"]);
        assert_eq!(
            told(""),
            ["is_on: is missing: expected true or false", "inner: is missing: expected a table"]
        );
        let ways = "one of \"left\", \"right\"";
        assert_eq!(
            told("is_on = true\nby_way = { up.far = 1 }\n[inner]\nnumber = 1\nway = { left = 1 }\n"),
            [
                format!("by_way.up: expected {ways}, found \"up\""),
                format!("inner.way: expected {ways}, found a table"),
            ]
        );
        assert_eq!(
            told("is_off = true\ninner = 5\n"),
            ["inner: expected a table, found 5", "is_off: unknown key; did you mean \"is_on\"?"]
        );
    }
}
