//! Words of messages: the nearest name, short numbers.

/// A number as a reader would write it, without hundreds of digits.
pub fn number(x: f64) -> String {
    let is_plain = x == 0.0 || (1e-6..1e15).contains(&x.abs()) || !x.is_finite();
    if is_plain { x.to_string() } else { format!("{x:e}") }
}

/// Adds "did you mean" to serde's "unknown field `x`, expected one of `y`, `z`".
pub fn with_nearest_name(message: &str) -> String {
    let message = message.trim_end();
    let mut names = message.split('`').skip(1).step_by(2);
    let unknown = message.starts_with("unknown ").then(|| names.next()).flatten();
    match unknown.and_then(|wrong| nearest(wrong, names)) {
        Some(name) => format!("{message} (did you mean `{name}`?)"),
        None => message.to_owned(),
    }
}

/// The name most like `wrong`, when one is like it at all.
pub fn nearest<'a>(wrong: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    names
        .into_iter()
        .map(|name| (strsim::jaro_winkler(wrong, name), name))
        .filter(|(likeness, _)| *likeness > 0.7)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let written = [0.0, 0.25, -3.0, 86_400_000.0, 1e-7, 1e308, -2.5e20, f64::NAN];
        assert_eq!(written.map(number), ["0", "0.25", "-3", "86400000", "1e-7", "1e308", "-2.5e20", "NaN"]);
    }
}
