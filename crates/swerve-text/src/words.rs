//! Building blocks of messages: nearest names, lists of names, short numbers, TOML values.

use toml::Value;

use crate::NAME_MAX;

/// Formats a number without hundreds of digits.
pub fn number(x: f64) -> String {
    let is_plain = x == 0.0 || (1e-6..1e15).contains(&x.abs()) || !x.is_finite();
    if is_plain { x.to_string() } else { format!("{x:e}") }
}

/// Name nearest to `wrong`, if any is close: by common letters, by few typing errors, or because `wrong` is a part of
/// it. A text too long for a name is close to none.
pub fn nearest<'n>(wrong: &str, names: impl IntoIterator<Item = &'n str>) -> Option<&'n str> {
    let score = |name: &'n str| {
        let slips = strsim::damerau_levenshtein(wrong, name);
        let likeness = strsim::jaro_winkler(wrong, name);
        let is_rest = |rest: &str| rest.starts_with('_') || rest.ends_with('_');
        let is_end = name.strip_prefix(wrong).or_else(|| name.strip_suffix(wrong)).is_some_and(is_rest);
        let is_part = is_end || name.split('_').any(|part| part == wrong);
        // One error in two letters is few: `rn` is close to `run`.
        let letters = wrong.chars().count();
        let few = if letters == 2 { 1 } else { letters / 3 };
        let is_near = likeness > 0.75 || slips <= few || is_part;
        is_near.then_some((likeness - slips as f64 * 0.01, name))
    };
    // Of equally close names, the first one.
    let nearer = |best: (f64, &'n str), other: (f64, &'n str)| if other.0 > best.0 { other } else { best };
    if wrong.len() > NAME_MAX {
        return None;
    }
    names.into_iter().filter_map(score).reduce(nearer).map(|(_, name)| name)
}

/// Hint at the nearest name, ``; did you mean `near`?``, or nothing if no name is close.
pub fn did_you_mean<'n>(wrong: &str, names: impl IntoIterator<Item = &'n str>) -> String {
    nearest(wrong, names).map_or_else(String::new, |near| format!("; did you mean `{near}`?"))
}

/// Quoted names, separated by commas.
pub fn list(names: &[&str]) -> String {
    names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ")
}

/// Message for an unknown key, with the nearest known one.
pub fn unknown_key(wrong: &str, known: &[&str]) -> String {
    match nearest(wrong, known.iter().copied()) {
        Some(near) => format!("unknown key; did you mean `{near}`?"),
        None if known.is_empty() => "unknown key; expected none".to_owned(),
        None => format!("unknown key; expected one of {}", list(known)),
    }
}

/// Message for an unexpected name.
pub(crate) fn unknown_name(wrong: &str, known: &[&str]) -> String {
    let hint = did_you_mean(wrong, known.iter().copied());
    format!("expected one of {}, found \"{wrong}\"{hint}", list(known))
}

/// True if a text can be shown in one line: it is not blank and has no control characters.
pub(crate) fn is_shown(text: &str) -> bool {
    !text.trim().is_empty() && !text.contains(char::is_control)
}

/// Describes a value in a message.
pub(crate) fn describe(value: &Value) -> String {
    match value {
        Value::String(text) => format!("the text {text:?}"),
        Value::Float(x) if x.is_finite() => number(*x),
        Value::Datetime(date) => format!("the date {date}"),
        Value::Array(items) => format!("an array of {}", items.len()),
        Value::Table(_) => "a table".to_owned(),
        Value::Integer(_) | Value::Float(_) | Value::Boolean(_) => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let written = [0.0, 0.25, -3.0, 86_400_000.0, 1e-7, 1e308, -2.5e20, f64::NAN];
        assert_eq!(written.map(number), ["0", "0.25", "-3", "86400000", "1e-7", "1e308", "-2.5e20", "NaN"]);
    }

    #[test]
    fn nearest_name_is_one_typo_or_many_common_letters_away() {
        let names = ["planner", "predictor", "gate", "fps", "emulated_detector", "added_latency_ms"];
        for (wrong, near) in [
            ("planer", Some("planner")),
            ("predict", Some("predictor")),
            ("gaet", Some("gate")),
            ("fsp", Some("fps")),
            ("detector", Some("emulated_detector")),
            ("latency_ms", Some("added_latency_ms")),
            ("world", None),
            ("", None),
        ] {
            assert_eq!(nearest(wrong, names), near, "{wrong}");
        }
    }

    #[test]
    fn values_are_described_in_terms_of_toml() {
        let table: toml::Table =
            "v = [nan, -inf, 1e308, 3, true, 1979-05-27, \"x\", [1], {}]".parse().unwrap();
        let said: Vec<String> = table["v"].as_array().unwrap().iter().map(describe).collect();
        assert_eq!(
            said,
            [
                "nan",
                "-inf",
                "1e308",
                "3",
                "true",
                "the date 1979-05-27",
                "the text \"x\"",
                "an array of 1",
                "a table"
            ]
        );
    }
}
