//! Assignments of single keys: `--set key=value`.

use crate::{KeyProblem, Problem};

/// Maximum depth of a key, as for the file reader: tables are walked recursively.
const DEPTH_MAX: usize = 80;

/// Keys whose tables are one value in one of several forms: a run-time model, a deadline, a trigger of an actor.
const ONE_VALUE: [&str; 3] = ["deadline", "runtime", "trigger"];

/// True if a table at dotted `key` replaces an earlier one as a whole: it is one value in one of several forms
/// (`runtime`, `deadline`, `trigger`). Other tables are merged key by key.
pub fn is_one_value(key: &str) -> bool {
    ONE_VALUE.contains(&key.rsplit('.').next().unwrap_or(key))
}

/// Stores a value under `name`, part of dotted `key`: a table is merged into an earlier one key by key, except where it
/// is one value; any other value replaces the earlier one.
pub(crate) fn merge(table: &mut toml::Table, name: String, key: &str, value: toml::Value) {
    match (table.get_mut(&name), value) {
        (Some(toml::Value::Table(old)), toml::Value::Table(new)) if !is_one_value(key) => {
            for (name, value) in new {
                let key = format!("{key}.{name}");
                merge(old, name, &key, value);
            }
        }
        (_, value) => {
            table.insert(name, value);
        }
    }
}

/// Sets the value at dotted `key` and creates the tables on its path. A table is merged into an earlier one, as a file
/// over another: see [`Document::over`](crate::Document::over).
///
/// # Errors
/// If a part of the path is a value, or the key is nested too deeply: the start of `key` and a message.
pub fn set(table: &mut toml::Table, key: &str, value: toml::Value) -> Result<(), KeyProblem> {
    if key.split('.').count() > DEPTH_MAX {
        let start: String = key.chars().take(40).collect();
        return Err((format!("{start}..."), format!("expected a key of at most {DEPTH_MAX} parts")));
    }
    let (path, name) = key.rsplit_once('.').unwrap_or(("", key));
    let mut at = table;
    for part in path.split('.').filter(|part| !part.is_empty()) {
        let inner = at.entry(part).or_insert_with(|| toml::Value::Table(toml::Table::new()));
        let is_value = || (key.to_owned(), format!("`{part}` is a value, not a table"));
        at = inner.as_table_mut().ok_or_else(is_value)?;
    }
    merge(at, name.to_owned(), key, value);
    Ok(())
}

/// Parses `key=value` as given to `--set`; a value that is not TOML is a string.
///
/// # Errors
/// If there is no `=`, or no key before it.
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

/// Parses all `--set` arguments in order.
///
/// # Errors
/// The first one that is not an assignment ([`parse_assignment`]).
pub fn parse_assignments(texts: &[String]) -> Result<Vec<(String, toml::Value)>, Problem> {
    texts.iter().map(|text| parse_assignment(text)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn assignments_are_toml_or_strings() {
        let value = |text| parse_assignment(text).unwrap().1;
        assert_eq!(value("a=1.5"), toml::Value::Float(1.5));
        assert_eq!(value("a=fot"), toml::Value::String("fot".into()));
        assert_eq!(value("a=[1, 2]").as_array().unwrap().len(), 2);
        assert!(parse_assignment("a").is_err() && parse_assignment("a..b=1").is_err());
        let mut table = toml::Table::new();
        set(&mut table, "a.b.c", toml::Value::Integer(1)).unwrap();
        let (key, message) = set(&mut table, "a.b.c.d", toml::Value::Integer(1)).unwrap_err();
        assert_eq!((key.as_str(), message.as_str()), ("a.b.c.d", "`c` is a value, not a table"));
    }

    #[test]
    fn table_is_merged_and_one_value_is_replaced() {
        let set_all = |sets: &[&str]| {
            let mut table = toml::Table::new();
            for (key, value) in sets.iter().map(|text| parse_assignment(text).unwrap()) {
                set(&mut table, &key, value).unwrap();
            }
            table
        };
        for (sets, wanted) in [
            (&["a={b={c=1, d=2}, e=3}", "a={b={d=4}}"][..], "a = { b = { c = 1, d = 4 }, e = 3 }"),
            (&["a={b=1}", "a.c=2", "a={}"], "a = { b = 1, c = 2 }"),
            (&["a={b=[1, 2]}", "a={b=[3]}"], "a = { b = [3] }"),
            (&["a=1", "a={b=2}"], "a = { b = 2 }"),
            (&["a={b=2}", "a=1"], "a = 1"),
            (
                &["p={runtime={fixed_ms=1}, q=1}", "p={runtime={zero=true}}"],
                "p = { runtime = { zero = true }, q = 1 }",
            ),
            (&["p.deadline={ms=1, anchor=start}", "p.deadline={ms=2}"], "p.deadline = { ms = 2 }"),
        ] {
            assert_eq!(set_all(sets), wanted.parse().unwrap(), "{sets:?}");
        }
    }

    #[test]
    fn key_nested_too_deeply_is_refused_briefly() {
        let set = |parts: usize| set(&mut toml::Table::new(), &vec!["a"; parts].join("."), true.into());
        assert_eq!(set(DEPTH_MAX), Ok(()));
        let (key, message) = set(20_000).unwrap_err();
        assert!(key.len() < 50 && message.contains("at most 80 parts"), "{key}: {message}");
    }
}
