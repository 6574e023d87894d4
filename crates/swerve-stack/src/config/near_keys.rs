//! Keys found by a part of their name.

use swerve_text::{KeyProblem, nearest};

use super::Config;

/// Number of keys in a message.
const KEYS_MAX: usize = 5;

impl Config {
    /// Keys of the configuration's tables with this name or, if there are none, with this word in their names.
    pub fn keys_like(word: &str) -> Vec<String> {
        let word = word.replace('-', "_");
        let mut all = Vec::new();
        below("", &mut all);
        let last = |key: &str| key.rsplit('.').next().unwrap_or(key).to_owned();
        let with = |is_one: &dyn Fn(&str) -> bool| -> Vec<String> {
            all.iter().filter(|key| is_one(&last(key))).cloned().collect()
        };
        let named = with(&|name| name == word);
        if !named.is_empty() || word.len() < 3 {
            return named;
        }
        let containing = with(&|name| name.split('_').any(|part| part == word));
        if !containing.is_empty() {
            return containing;
        }
        // By a typing error in one name only.
        let names: Vec<String> = all.iter().map(|key| last(key)).collect();
        let near = nearest(&word, names.iter().map(String::as_str)).map(str::to_owned);
        near.map_or_else(Vec::new, |near| with(&|name| name == near))
    }
}

/// Adds the keys of a table and of the tables within it.
fn below(table: &str, all: &mut Vec<String>) {
    const DEPTH_MAX: usize = 3;
    for key in swerve_text::keys::<Config>(table).unwrap_or_default() {
        let key = if table.is_empty() { (*key).to_owned() } else { format!("{table}.{key}") };
        if key.split('.').count() < DEPTH_MAX {
            below(&key, all);
        }
        all.push(key);
    }
}

/// The problem of an unknown key without a table; if other tables have such keys, with these.
pub(crate) fn with_near_keys((key, message): KeyProblem) -> KeyProblem {
    if key.contains(['.', '[']) || !message.starts_with("unknown key; expected one of") {
        return (key, message);
    }
    let near = Config::keys_like(&key);
    if near.is_empty() {
        return (key, message);
    }
    let shown: Vec<String> = near.iter().take(KEYS_MAX).map(|key| format!("`{key}`")).collect();
    let more = if near.len() > KEYS_MAX { ", ..." } else { "" };
    let message = format!(
        "unknown key; did you mean {}{more}? (`swerve keys {key}` lists all with this word)",
        shown.join(", ")
    );
    (key, message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_found_by_name_part_and_typing_error() {
        assert_eq!(Config::keys_like("planner"), ["planning.planner"]);
        assert!(Config::keys_like("latency").contains(&"planning.added_latency_ms".to_owned()));
        assert_eq!(Config::keys_like("discretization"), ["planning.discretisation"]);
        assert!(Config::keys_like("zebra_crossing_xyz").is_empty());
    }

    #[test]
    fn unknown_key_without_its_table_is_answered_with_the_whole_key() {
        let message = with_near_keys(("latency".into(), "unknown key; expected one of \"seed\"".into())).1;
        assert!(
            message.starts_with("unknown key; did you mean `")
                && message.contains("`planning.added_latency_ms`"),
            "{message}"
        );
    }
}
