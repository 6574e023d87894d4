//! Deserialization of JSON, with errors worded as for TOML.

use std::collections::{BTreeMap, BTreeSet};

use serde::de::DeserializeOwned;
use serde_json::error::{Category, Error};

use crate::form::{in_words, read};
use crate::problem::{KeyProblem, Problem, Problems};
use crate::words::{unknown_key, unknown_name};

/// Deserializes JSON as a `T`; `file` is its name in messages.
///
/// # Errors
/// The first value that does not have the form of a `T`, with line and key, or a syntax error.
pub fn from_json<T: DeserializeOwned>(file: &str, text: &str) -> Result<T, Problem> {
    serde_json::from_str(text).map_err(|error| problem(file, text, &error))
}

/// Same as [`from_json`], for an object without `null`; finds all problems at once.
///
/// # Errors
/// All values that do not have the form of a `T`, with lines and keys, or a syntax error.
pub fn read_json<T: DeserializeOwned>(file: &str, text: &str) -> Result<T, Problems> {
    let table = from_json::<toml::Table>(file, text).map_err(|mut problem| {
        problem.message = problem.message.replace("any valid TOML value", "a value");
        Problems::from(problem)
    })?;
    read(&table).map_err(|found| {
        let in_json = |(key, message): KeyProblem| (key, message.replace("a table", "an object"));
        json_problems(file, text, found.into_iter().map(in_json).collect())
    })
}

/// Finds the lines of problems in JSON; that of a missing key is the line of the object that should have it.
pub fn json_problems(file: &str, text: &str, found: Vec<KeyProblem>) -> Problems {
    let keys = found.iter().flat_map(|(key, _)| outwards(key)).map(str::to_owned).collect();
    let lines = lines_of(text, &keys);
    let placed = |(key, message): KeyProblem| {
        let line = outwards(&key).find_map(|key| lines.get(key).copied()).or(Some(1));
        Problem { file: file.to_owned(), line, key, message }
    };
    found.into_iter().map(placed).collect()
}

fn problem(file: &str, text: &str, error: &Error) -> Problem {
    let (line, column) = (error.line().max(1), error.column());
    let before: usize = text.split_inclusive('\n').take(line - 1).map(str::len).sum();
    let at = (before + column).min(text.len());
    let mut key = key_at(&text.as_bytes()[..at]);
    let whole = error.to_string();
    let place = format!(" at line {} column {column}", error.line());
    let told = whole.strip_suffix(&place).unwrap_or(&whole);
    let message = match (error.classify(), told) {
        (Category::Eof, _) => "it ends too early, expected whole JSON".to_owned(),
        (_, "number out of range") => {
            format!("expected a number of at most {:e}, found {}", f64::MAX, number_at(text, at))
        }
        (Category::Data, told) => match told.strip_prefix("missing field ") {
            Some(name) => {
                let name = name.trim_matches('`');
                key = if key.is_empty() { name.to_owned() } else { format!("{key}.{name}") };
                "is missing".to_owned()
            }
            None => of_value(told),
        },
        (_, told) => format!("it is not JSON: {told}"),
    };
    Problem { file: file.to_owned(), line: Some(line), key, message }
}

/// Rewords an error of serde for users.
fn of_value(told: &str) -> String {
    let names = || -> Vec<&str> { told.split('`').skip(1).step_by(2).collect() };
    match told.split_once(' ').map(|(first, rest)| (first, rest.split_once(' '))) {
        Some(("unknown", Some(("field", _)))) => {
            names().split_first().map_or_else(|| told.to_owned(), |(wrong, known)| unknown_key(wrong, known))
        }
        Some(("unknown", Some(("variant", _)))) => {
            names().split_first().map_or_else(|| told.to_owned(), |(wrong, known)| unknown_name(wrong, known))
        }
        Some(("invalid", Some((what, rest)))) => match rest.rsplit_once(", expected ") {
            Some((length, wanted)) if what == "length" => {
                format!("expected {}, found an array of {length}", expected(wanted))
            }
            Some((found, wanted)) => format!("expected {}, found {}", expected(wanted), described(found)),
            None => told.to_owned(),
        },
        _ => told.to_owned(),
    }
}

/// Rewords the expected kind of value.
fn expected(wanted: &str) -> String {
    match in_words(wanted).as_ref() {
        "a table" => "an object".to_owned(),
        _ if wanted.contains("tagged enum ") => "an object".to_owned(),
        words => words.to_owned(),
    }
}

/// Rewords serde's description of the value found.
fn described(found: &str) -> String {
    match found {
        "map" => "an object".to_owned(),
        "sequence" => "an array".to_owned(),
        _ => match found.strip_prefix("string ") {
            Some(text) => format!("the text {text}"),
            // "integer `7`", "floating point `1.5`", "boolean `true`".
            None => found.split('`').nth(1).unwrap_or(found).to_owned(),
        },
    }
}

/// A container that is open at some position in a text.
enum Open<'t> {
    /// An object, at the value of this key or before one.
    Object(Option<&'t [u8]>),
    /// An array, at the value of this index.
    Array(usize),
}

/// Dotted key of the value that starts or was last read at the end of `text`.
fn key_at(text: &[u8]) -> String {
    dotted(&scan(text, |_, _| {}))
}

fn dotted(open: &[Open<'_>]) -> String {
    open.iter().fold(String::new(), |way, around| match around {
        Open::Object(None) => way,
        Open::Object(Some(name)) if way.is_empty() => String::from_utf8_lossy(name).into_owned(),
        Open::Object(Some(name)) => format!("{way}.{}", String::from_utf8_lossy(name)),
        Open::Array(index) => format!("{way}[{index}]"),
    })
}

/// Containers that are open at the end of a text. `at_place` is called for each key of an object and each element of an
/// array, with the containers around its value and its offset.
fn scan<'t>(text: &'t [u8], mut at_place: impl FnMut(&[Open<'t>], usize)) -> Vec<Open<'t>> {
    let mut open: Vec<Open<'t>> = Vec::new();
    let next = |at: usize| at + text[at..].iter().take_while(|byte| byte.is_ascii_whitespace()).count();
    let mut at = 0;
    while let Some(byte) = text.get(at) {
        at += 1;
        match (byte, open.last_mut()) {
            (b'{', _) => open.push(Open::Object(None)),
            (b'[', _) => {
                open.push(Open::Array(0));
                at_place(&open, next(at));
            }
            (b'}' | b']', _) => drop(open.pop()),
            (b',', Some(Open::Object(key))) => *key = None,
            (b',', Some(Open::Array(index))) => {
                *index += 1;
                at_place(&open, next(at));
            }
            (b'"', around) => {
                let inside = &text[at..];
                let length = length_of_text(inside);
                if let Some(Open::Object(key @ None)) = around {
                    *key = Some(&inside[..length]);
                    at_place(&open, at);
                }
                at += length + 1;
            }
            _ => {}
        }
    }
    open
}

/// Lines of some dotted keys, starting at 1; those of missing keys are missing.
fn lines_of(text: &str, keys: &BTreeSet<String>) -> BTreeMap<String, usize> {
    let text = text.as_bytes();
    let (mut counted, mut line) = (0, 1);
    let mut found = BTreeMap::new();
    scan(text, |open, at| {
        let until = at.min(text.len());
        line += text[counted..until].iter().filter(|byte| **byte == b'\n').count();
        counted = until;
        let key = dotted(open);
        if keys.contains(&key) {
            found.entry(key).or_insert(line);
        }
    });
    found
}

/// The key, then each key around it, up to the whole text.
fn outwards(key: &str) -> impl Iterator<Item = &str> {
    std::iter::successors(Some(key), |key| key.rfind(['.', '[']).map(|end| &key[..end]))
}

/// Number of bytes before the closing quote of a string.
fn length_of_text(inside: &[u8]) -> usize {
    let mut is_escaped = false;
    let ends = |byte: &u8| {
        let is_end = *byte == b'"' && !is_escaped;
        is_escaped = *byte == b'\\' && !is_escaped;
        is_end
    };
    inside.iter().position(ends).unwrap_or(inside.len())
}

/// The number around a byte offset.
fn number_at(text: &str, at: usize) -> String {
    let is_other = |byte: &u8| !(byte.is_ascii_alphanumeric() || b"+-.".contains(byte));
    let (before, after) = text.as_bytes().split_at(at.saturating_sub(1));
    let start = before.iter().rposition(is_other).map_or(0, |found| found + 1);
    let end = after.iter().position(is_other).unwrap_or(after.len());
    String::from_utf8_lossy(&text.as_bytes()[start..before.len() + end]).into_owned()
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[derive(Deserialize, Debug)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "it is read and no more")]
    struct Form {
        size: f64,
        count: Option<u32>,
        places: Option<Vec<Sample>>,
    }

    #[derive(Deserialize, Debug)]
    #[expect(dead_code, reason = "it is read and no more")]
    struct Sample {
        at: [f64; 2],
        kind: Option<Kind>,
    }

    #[derive(Deserialize, Debug)]
    #[serde(rename_all = "snake_case")]
    enum Kind {
        Left,
        Right,
    }

    #[test]
    fn errors_state_line_key_and_expected_value() {
        for (text, told) in [
            ("{\"size\":\n{\"a\": 1}}", "f.json:2: size: expected a number, found an object"),
            ("{\"size\": \"a, \\\"b\"}", "f.json:1: size: expected a number, found the text \"a, \\\"b\""),
            (
                "{\"size\": 1,\n \"count\": -1}",
                "f.json:2: count: expected a whole number that is not negative, found -1",
            ),
            ("{\"count\": 1.5}", "f.json:1: count: expected a whole number that is not negative, found 1.5"),
            ("{\"count\": 1}", "f.json:1: size: is missing"),
            ("{\"siz\": 1}", "f.json:1: siz: unknown key; did you mean `size`?"),
            (
                "{\"places\": [\n{\"at\": [1, 2]},\n{\"at\": [3, true]}]}",
                "f.json:3: places[1].at[1]: expected a number, found true",
            ),
            ("{\"places\": [{\"at\": [1, 2]}, {\"kind\": null}]}", "f.json:1: places[1].at: is missing"),
            (
                "{\"places\": [{\"kind\": \"lft\"}]}",
                "f.json:1: places[0].kind: expected one of \"left\", \"right\", found \"lft\"; did you mean `left`?",
            ),
            (
                "{\"places\": [{\"at\": [1]}]}",
                "f.json:1: places[0].at: expected an array of 2 values, found an array of 1",
            ),
            ("{\"places\": 7}", "f.json:1: places: expected an array, found 7"),
            ("[1]", "f.json:1: expected an object, found an array of 1"),
            ("3", "f.json:1: expected an object, found 3"),
            (
                "{\"size\": 1e999}",
                "f.json:1: size: expected a number of at most 1.7976931348623157e308, found 1e999",
            ),
            ("{\"size\": 1,}", "f.json:1: it is not JSON: trailing comma"),
            ("{\"size\":\n\n", "f.json:3: size: it ends too early, expected whole JSON"),
            ("", "f.json:1: it ends too early, expected whole JSON"),
        ] {
            let problem = from_json::<Form>("f.json", text).unwrap_err().to_string();
            assert!(problem.starts_with(told), "{text}: {problem}\nexpected {told}");
        }
        assert!(
            from_json::<Form>("f.json", "{\"size\": 1, \"places\": [{\"at\": [1, 2], \"kind\": \"left\"}]}")
                .is_ok()
        );
    }

    /// Truncation or insertion at any position gives one message.
    #[test]
    fn no_text_causes_a_panic() {
        let whole = "{\"size\": 1.5e3, \"ä\\\"\": [null, {\"at\": \"\\u00e4\"}], \"count\": 2}\n";
        for at in (0..whole.len()).filter(|at| whole.is_char_boundary(*at)) {
            for other in ["", "\"", "\\", "]", "}", ",", "{", "1e999", "ä", "\n"] {
                let text = format!("{}{other}{}", &whole[..at], &whole[at..]);
                for text in [&text, &text[..at + other.len()]] {
                    let _either_way =
                        from_json::<Form>("f.json", text).map_err(|problem| problem.to_string());
                }
            }
        }
    }

    #[test]
    fn all_problems_of_an_object_are_found_with_their_lines() {
        #[derive(Debug, Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Inner {
            _speed_mps: f64,
        }
        #[derive(Debug, Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Outer {
            _cars: Vec<Inner>,
            _name: String,
        }
        let text = "{\n \"_cars\": [\n  { \"_speed_mps\": \"a, [b\" },\n  {},\n  { \"_speed_mps\": 1,\n    \"_sped\": 2 }\n ]\n}";
        let problems = read_json::<Outer>("f.json", text).unwrap_err();
        let found: Vec<String> = problems.iter().map(ToString::to_string).collect();
        assert_eq!(
            found,
            [
                "f.json:3: _cars[0]._speed_mps: expected a number, found the text \"a, [b\"",
                "f.json:4: _cars[1]._speed_mps: is missing: expected a number",
                "f.json:6: _cars[2]._sped: unknown key; did you mean `_speed_mps`?",
                "f.json:1: _name: is missing: expected a text",
            ]
        );
        assert!(
            read_json::<Outer>("f.json", "{ \"_cars\": null }").unwrap_err()[0]
                .to_string()
                .contains("found null")
        );
        assert!(read_json::<Outer>("f.json", "[]").is_err() && read_json::<Outer>("f.json", "{").is_err());
    }
}
