//! The configuration of a single operator: the tables of its kind as changed by `[operator.NAME]`.

use swerve_text::nearest;
use toml::{Table, Value};

use crate::config::Config;
use crate::config::resolved::Resolved;
use crate::kind::{KeyProblems, OperatorKind};
use crate::registry::Registry;
use crate::setup::Setup;

/// Keys of `[operator.NAME]` common to all operators, with their descriptions.
pub const COMMON_KEYS: [(&str, &str); 10] = [
    ("kind", "what it is; that of the pipeline's operator of this name when absent"),
    ("enabled", "false takes it out of the pipeline"),
    ("reads", "the streams that it reads, by port; found by their type when absent"),
    (
        "runtime",
        "what a step takes: { fixed_ms = 5 }, cycle_ms, normal_ms, log_normal_ms, percentiles_ms, work, measured",
    ),
    (
        "policy",
        "what becomes of frames that find it busy: \"skip_to_latest\", \"queue(N)\", \"pipelined(N)\"",
    ),
    ("deadline", "{ ms = 50, anchor = \"arrival\", reaction = \"skip\" }; none when absent"),
    (
        "every_ms",
        "period of a timer that it runs on, with the newest input; on arrival of its input when absent",
    ),
    (
        "rungs",
        "its ladder: [{ name = \"fast\", ms = 5, KEY = VALUE }, ...]; a step takes the finest that meets the deadline",
    ),
    ("uses", "the [resource.NAME] that its steps hold a slot of"),
    ("delay_ms", "from the publication of its messages to their readers"),
];

/// Returns true if every operator has this key.
fn is_common(key: &str) -> bool {
    COMMON_KEYS.iter().any(|(common, _)| *common == key)
}

/// The configuration and resolved settings for an operator of this kind with these own keys; `None` where the keys
/// change nothing.
pub(crate) fn view(
    setup: &Setup,
    name: &str,
    kind: &dyn OperatorKind,
    keys: &Table,
) -> Result<Option<(Setup, Resolved)>, KeyProblems> {
    let node = kind.node();
    let own = |(key, message): (String, String)| {
        let dot = if key.is_empty() { "" } else { "." };
        (format!("operator.{name}{dot}{key}"), message)
    };
    if keys.is_empty() {
        return Ok(None);
    }
    if node.sections.is_empty() {
        let wrong: KeyProblems = kind.problems(keys, &setup.registry).into_iter().map(own).collect();
        return if wrong.is_empty() { Ok(None) } else { Err(wrong) };
    }
    let mut table = Table::try_from(&setup.config).expect("a configuration is plain tables and values");
    // The `[operator]` tables are applied separately.
    table.remove("operator");
    let mut wrong = KeyProblems::new();
    for (key, value) in keys {
        match with_key(&table, node.sections, key, value) {
            Ok(changed) => table = changed,
            Err(message) => wrong.push(own((key.clone(), with_common_key(key, message)))),
        }
    }
    if !wrong.is_empty() {
        return Err(wrong);
    }
    let changed: Config = swerve_text::read(&table).expect("every key of it was read");
    let changed = setup.with_config(Config { operator: setup.operator.clone(), ..changed });
    let (before, _) = resolved(setup);
    let (after, resolved) = resolved(&changed);
    let is_new = |(key, message): &(String, String)| !before.contains(&(key.clone(), message.clone()));
    let in_section = |(key, message): (String, String)| {
        let section = node.sections.iter().find_map(|section| key.strip_prefix(&format!("{section}.")));
        section.map(|rest| own((rest.to_owned(), message)))
    };
    let wrong: KeyProblems = after.into_iter().filter(is_new).filter_map(in_section).collect();
    if wrong.is_empty() { Ok(Some((changed, resolved))) } else { Err(wrong) }
}

/// All problems of a configuration's values, and the resolved settings.
fn resolved(setup: &Setup) -> (KeyProblems, Resolved) {
    let mut problems = setup.problems_of_values();
    let resolved = Resolved::new(setup, &mut problems);
    (problems, resolved)
}

/// Replaces an "unknown key" message, which considers the kind's keys only, if a common key is close.
fn with_common_key(key: &str, message: String) -> String {
    match nearest(key, COMMON_KEYS.map(|(key, _)| key)) {
        Some(near) if message.starts_with("unknown key") => format!("unknown key; did you mean `{near}`?"),
        _ => message,
    }
}

/// A configuration's table with a key set in the first of `sections` that has it.
fn with_key(table: &Table, sections: &[&str], key: &str, value: &Value) -> Result<Table, String> {
    let mut told = None;
    for section in sections {
        let mut changed = table.clone();
        if let Some(Value::Table(inner)) = changed.get_mut(*section) {
            match (inner.get_mut(key), value) {
                (Some(Value::Table(old)), Value::Table(new)) => old.extend(new.clone()),
                _ => drop(inner.insert(key.to_owned(), value.clone())),
            }
        }
        let wrong = swerve_text::read::<Config>(&changed).err().unwrap_or_default();
        let Some((_, message)) = wrong.into_iter().next() else { return Ok(changed) };
        // The message of a section that has the key is the most specific.
        if told.is_none() || !message.starts_with("unknown key") {
            told = Some(message);
        }
    }
    Err(told.unwrap_or_else(|| "unknown key".into()))
}

/// Moves the keys of operators whose kind has named tables into these: `[operator.front] kind = "camera"` becomes
/// `[camera.front]`.
pub(crate) fn gather_named_sections(table: &mut Table, registry: &Registry) {
    let Some(Value::Table(operators)) = table.get_mut("operator") else { return };
    let mut gathered = Vec::new();
    for (name, operator) in operators.iter_mut() {
        let Value::Table(own) = operator else { continue };
        let kind = own.get("kind").and_then(Value::as_str).and_then(|kind| registry.kind(kind));
        let Some(section) = kind.and_then(|kind| kind.node().named_section) else { continue };
        let keys: Vec<String> = own.keys().filter(|key| !is_common(key)).cloned().collect();
        let entry: Table = keys.into_iter().filter_map(|key| own.remove_entry(&key)).collect();
        own.remove("kind");
        gathered.push((section, name.clone(), entry));
    }
    for (section, name, entry) in gathered {
        let tables = table.entry(section).or_insert_with(|| Value::Table(Table::new()));
        let Value::Table(tables) = tables else { continue };
        let known = tables.entry(name).or_insert_with(|| Value::Table(Table::new()));
        if let Value::Table(known) = known {
            known.extend(entry);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::OperatorConfig;

    #[test]
    fn common_keys_are_the_ones_that_every_operator_reads() {
        let every = "kind = \"x\"\nenabled = true\nreads = { a = \"b\" }\nruntime = { zero = true }\npolicy = \"p\"\n\
                     deadline = { ms = 1 }\nevery_ms = 1\nrungs = [{ name = \"a\", ms = 1 }]\nuses = \"r\"\ndelay_ms = 1\n";
        let own: OperatorConfig = swerve_text::built_in(every);
        assert!(own.keys.is_empty(), "{:?}", own.keys);
        let mut keys: Vec<String> = Table::try_from(&own).unwrap().keys().cloned().collect();
        keys.sort_by_key(|key| COMMON_KEYS.iter().position(|(common, _)| common == key));
        assert_eq!(keys, COMMON_KEYS.map(|(key, _)| key));
    }
}
