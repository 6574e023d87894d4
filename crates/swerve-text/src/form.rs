//! Finds all values in a TOML table that do not have the form of a Rust type, with messages in terms of TOML.
//!
//! serde stops at the first error. Each error is therefore repaired in a copy of the table with a value that the type
//! accepts, and the copy is read again to find the next error. The expected type of a missing key is found in the same
//! way: the type is offered a value of another kind, and its error states the expected one.

mod value;

use std::borrow::Cow;

use serde::de::DeserializeOwned;
use toml::{Table, Value};

use self::value::{Fault, Kind, Part, Whole};
use crate::KeyProblem;
use crate::words::{describe, nearest, unknown_key, unknown_name};

/// Maximum number of problems reported for a text.
const PROBLEMS_MAX: usize = 50;
/// Maximum number of rounds; one problem may take several to repair, from the outside inwards.
const ROUNDS_MAX: usize = 4 * PROBLEMS_MAX;

/// A path as written in messages: `operator[0].every_ms`.
fn dotted(path: &[Part]) -> String {
    path.iter().fold(String::new(), |key, part| match part {
        Part::Key(name) if key.is_empty() => name.clone(),
        Part::Key(name) => format!("{key}.{name}"),
        Part::Index(index) => format!("{key}[{index}]"),
    })
}

/// True if dotted `key` is `outer` or within it.
pub fn is_within(key: &str, outer: &str) -> bool {
    let rest = key.strip_prefix(outer);
    outer.is_empty() || rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

/// Result of reading a table that does not have the form of a `T`.
#[derive(Debug)]
pub struct Misread<T> {
    /// All problems with their keys, except those within a value that is wrong as a whole.
    pub problems: Vec<KeyProblem>,
    /// The value as far as it can be repaired: misspelt names are corrected; missing values are defaults or arbitrary.
    pub meant: Option<T>,
    /// Keys whose values are not from the text.
    pub guessed: Guessed,
}

/// Dotted keys of values that are not from the text.
#[derive(Debug, Default)]
pub struct Guessed(Vec<String>);

impl Guessed {
    /// True if the value at dotted `key`, a value inside it, or a parent of it is among them.
    pub fn holds(&self, key: &str) -> bool {
        self.0.iter().any(|guessed| is_within(key, guessed) || is_within(guessed, key))
    }

    /// Adds the keys of another value, which is at dotted `key`.
    pub fn extend(&mut self, key: &str, others: Self) {
        self.0.extend(others.0.into_iter().map(|other| format!("{key}.{other}")));
    }
}

/// Deserializes a table as a `T`.
///
/// # Errors
/// All problems with their keys, except those within a value that is wrong as a whole.
pub fn read<T: DeserializeOwned>(table: &Table) -> Result<T, Vec<KeyProblem>> {
    read_meant(table).map_err(|misread| misread.problems)
}

/// Same as [`read`], but the error also contains the repaired value.
///
/// # Errors
/// All values that do not have the form of a `T`.
pub fn read_meant<T: DeserializeOwned>(table: &Table) -> Result<T, Misread<T>> {
    first::<T>(table).map_err(|fault| {
        let (problems, guessed, meant) = misread(&|table| first::<T>(table).err(), table, fault);
        let meant = meant.and_then(|table| first(&table).ok());
        Misread { problems, meant, guessed }
    })
}

/// Deserializes a text that is part of the program.
///
/// # Panics
/// If the text does not have the form of a `T`; tests read each such text.
pub fn built_in<T: DeserializeOwned>(text: &str) -> T {
    let table = toml::from_str(text).expect("a test reads every text of the program");
    first(&table).expect("a test reads every text of the program")
}

/// Keys that a `T` accepts in the table at dotted `within`; `None` if it accepts any, or is not a table.
pub fn keys<T: DeserializeOwned>(within: &str) -> Option<&'static [&'static str]> {
    // An unknown key, whose error lists the known ones.
    const NOBODYS: &str = "\0";
    let key = if within.is_empty() { NOBODYS.to_owned() } else { format!("{within}.{NOBODYS}") };
    let mut table = Table::new();
    if crate::set(&mut table, &key, true.into()).is_err() {
        return None;
    }
    match first::<T>(&table).err().map(|fault| fault.kind) {
        Some(Kind::UnknownKey { wrong, known }) if wrong == NOBODYS => Some(known),
        _ => None,
    }
}

fn first<T: DeserializeOwned>(table: &Table) -> Result<T, Fault> {
    T::deserialize(Whole(table))
}

/// First error of a table for some type. Code that finds and repairs errors depends on the type only through this, so
/// that it is compiled only once.
type FirstFault<'a> = &'a dyn Fn(&Table) -> Option<Fault>;

/// Problems of a table, the guessed keys, and the repaired table.
fn misread(
    fault_of: FirstFault<'_>,
    table: &Table,
    first_fault: Fault,
) -> (Vec<KeyProblem>, Guessed, Option<Table>) {
    let mut table = table.clone();
    let mut found: Vec<KeyProblem> = Vec::new();
    let (mut meant, mut guessed) = (None, Vec::new());
    let mut next = Some(first_fault);
    for _ in 0..ROUNDS_MAX {
        let Some(fault) = next.take().filter(|_| found.len() < PROBLEMS_MAX) else { break };
        let key = dotted(&fault.path());
        // A key with a misspelt name is not also reported as missing.
        let is_told = matches!(fault.kind, Kind::Missing(_)) && guessed.contains(&key);
        if !is_told && !found.iter().any(|(outer, _)| is_within(&key, outer)) {
            found.push((key.clone(), message(fault_of, &fault, &table)));
        }
        guessed.extend(meant_path(&fault).as_deref().map(dotted));
        guessed.push(key);
        if !mend(fault_of, &fault, &mut table) {
            break;
        }
        next = fault_of(&table);
        if next.is_none() {
            meant = Some(table.clone());
        }
    }
    // A value that is wrong as a whole may be found only after its contents.
    let keys: Vec<String> = found.iter().map(|(key, _)| key.clone()).collect();
    found.retain(|(key, _)| !keys.iter().any(|outer| outer != key && is_within(key, outer)));
    (found, Guessed(guessed), meant)
}

/// Path of the key for which an unknown one was probably intended.
fn meant_path(fault: &Fault) -> Option<Vec<Part>> {
    let Kind::UnknownKey { wrong, known } = &fault.kind else { return None };
    let path = fault.path();
    let (_, parents) = path.split_last()?;
    let near = Part::Key(nearest(wrong, known.iter().copied())?.to_owned());
    Some([parents, &[near]].concat())
}

fn message(fault_of: FirstFault<'_>, fault: &Fault, table: &Table) -> String {
    match &fault.kind {
        Kind::Missing(_) => {
            let wanted = wanted(fault_of, &fault.path(), table).unwrap_or_else(|| "a value".to_owned());
            format!("is missing: expected {wanted}")
        }
        Kind::UnknownKey { wrong, known } => unknown_key(wrong, known),
        Kind::UnknownName { wrong, known } => unknown_name(wrong, known),
        Kind::Expected(wanted) => {
            let found = get(table, &fault.path()).map_or_else(|| "a table".to_owned(), describe);
            format!("expected {}, found {found}", in_words(wanted))
        }
        Kind::Other(message) => message.clone(),
    }
}

/// Expected kind of value at a place without one.
fn wanted(fault_of: FirstFault<'_>, path: &[Part], table: &Table) -> Option<String> {
    let mut table = table.clone();
    put(&mut table, path, Some(true.into()));
    match fault_of(&table).filter(|fault| fault.path() == path) {
        None => Some("true or false".to_owned()),
        Some(Fault { kind: Kind::Expected(wanted), .. }) => Some(in_words(&wanted).into_owned()),
        Some(_) => None,
    }
}

/// Corrects a name that is close to a valid one; returns false, without a change, if the type does not accept the
/// result.
fn mend_name(fault_of: FirstFault<'_>, fault: &Fault, table: &mut Table) -> bool {
    let path = fault.path();
    let Some(value) = get(table, &path).cloned() else { return false };
    let mut mended = table.clone();
    let place = match &fault.kind {
        Kind::UnknownKey { .. } => {
            let Some(meant) = meant_path(fault).filter(|meant| get(table, meant).is_none()) else {
                return false;
            };
            put(&mut mended, &path, None);
            put(&mut mended, &meant, Some(value));
            meant
        }
        Kind::UnknownName { wrong, known } if value.is_str() => {
            let Some(near) = nearest(wrong, known.iter().copied()) else { return false };
            put(&mut mended, &path, Some(near.into()));
            path
        }
        _ => return false,
    };
    let is_good = fault_of(&mended).is_none_or(|next| !next.path().starts_with(&place));
    if is_good {
        *table = mended;
    }
    is_good
}

/// Replaces a wrong value by one that the type accepts; returns false if none was found.
fn mend(fault_of: FirstFault<'_>, fault: &Fault, table: &mut Table) -> bool {
    if mend_name(fault_of, fault, table) {
        return true;
    }
    let path = fault.path();
    let next = |table: &Table| fault_of(table).map(|fault| fault.path());
    if !matches!(fault.kind, Kind::Missing(_)) && matches!(path.last(), Some(Part::Key(_))) {
        put(table, &path, None);
        // If the surrounding table requires the key, another value must replace it.
        if next(table).is_none_or(|next| !path.starts_with(&next)) {
            return true;
        }
    }
    // An error further inside means that the value itself is of the right kind.
    let is_mended =
        |table: &Table| next(table).is_none_or(|next| !next.starts_with(&path) || next.len() > path.len());
    let name = match &fault.kind {
        Kind::UnknownName { known, .. } => known.first().copied().unwrap_or_default().to_owned(),
        _ => {
            let wanted = wanted(fault_of, &path, table).unwrap_or_default();
            wanted.split('"').nth(1).unwrap_or_default().to_owned()
        }
    };
    let numbers = |n| Value::Array(vec![Value::Integer(1); n]);
    let kinds = [
        Value::Integer(1),
        name.into(),
        Value::Array(Vec::new()),
        Value::Table(Table::new()),
        true.into(),
        numbers(2),
        numbers(3),
        Value::Array(vec![numbers(2)]),
    ];
    kinds.into_iter().any(|value| {
        put(table, &path, Some(value));
        is_mended(table)
    })
}

/// Value at `path`.
fn get<'a>(table: &'a Table, path: &[Part]) -> Option<&'a Value> {
    let (Part::Key(first), rest) = path.split_first()? else { return None };
    rest.iter().try_fold(table.get(first)?, |at, part| match part {
        Part::Key(name) => at.get(name.as_str()),
        Part::Index(i) => at.get(*i),
    })
}

/// Sets or removes the value at `path`, whose parents must exist.
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

/// Converts serde's type names to terms of TOML.
pub(crate) fn in_words(wanted: &str) -> Cow<'_, str> {
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
mod tests;
