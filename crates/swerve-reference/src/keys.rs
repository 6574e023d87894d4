//! `swerve keys`: lists the keys of a configuration or another file.

use std::fmt::Write as _;

use anyhow::bail;
use schemars::schema_for;
use swerve_report::output::print;
use swerve_stack::Registry;
use swerve_stack::config::Config;
use swerve_text::did_you_mean;

use crate::files::FileKind;
use crate::key::{Choice, Key};
use crate::schema::{self, Arrays};
use crate::{limits, params};

/// `swerve keys`.
#[derive(clap::Args, Debug)]
pub struct KeysArgs {
    /// Keys that begin with this (planning, camera.NAME), or whose name, values or description contain this word
    /// (weather)
    prefix: Option<String>,
    /// File whose keys are listed [default: config; the others if it has no such key]
    #[arg(long, value_name = "FILE", conflicts_with = "schema")]
    of: Option<FileKind>,
    /// Print JSON
    #[arg(long, conflicts_with_all = ["markdown", "schema"])]
    json: bool,
    /// Print a Markdown page
    #[arg(long, conflicts_with = "schema")]
    markdown: bool,
    /// Print the JSON schema of a file, for editors that check what is typed (taplo) [default: config]
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "config", conflicts_with = "prefix")]
    schema: Option<FileKind>,
}

/// Lists keys.
///
/// # Errors
/// If there is no key of that name.
pub fn run(args: &KeysArgs, registry: &Registry) -> anyhow::Result<()> {
    if let Some(kind) = args.schema {
        return print(&(serde_json::to_string_pretty(&kind.schema(registry))? + "\n"));
    }
    let (all, others): (Vec<Key>, &[FileKind]) = match args.of.unwrap_or(FileKind::Config) {
        FileKind::Config => (keys(registry), &[FileKind::Scenario, FileKind::Study, FileKind::Timing]),
        kind => (of_file(kind, registry), &[]),
    };
    let Some(asked) = &args.prefix else { return told(args, &all.iter().collect::<Vec<_>>()) };
    let found = find(&all, asked);
    if !found.is_empty() {
        return told(args, &found);
    }
    for kind in others.iter().filter(|_| args.of.is_none()) {
        let of_other = of_file(*kind, registry);
        let found = find(&of_other, asked);
        if !found.is_empty() {
            eprintln!("no key of a configuration; of a {} file:", kind.name());
            return told(args, &found);
        }
    }
    let names = all.iter().flat_map(|key| [key.key.as_str(), key.name()]);
    let words = all.iter().flat_map(|key| key.name().split('_'));
    bail!("no key `{asked}`{}", did_you_mean(asked, names.chain(words)))
}

fn told(args: &KeysArgs, found: &[&Key]) -> anyhow::Result<()> {
    if args.json {
        return print(&(serde_json::to_string_pretty(found)? + "\n"));
    }
    print(&if args.markdown { page(found) } else { text(found) })
}

/// Every key of another file; an entry of an array of tables is `NAME`.
fn of_file(kind: FileKind, registry: &Registry) -> Vec<Key> {
    schema::keys(&kind.schema(registry), "", None, Arrays::Within)
}

/// Every key of a configuration.
pub fn keys(registry: &Registry) -> Vec<Key> {
    let mut keys = schema::keys(&schema_for!(Config), "", None, Arrays::Whole);
    for key in &mut keys {
        key.choices.extend(limits::known_names(&key.key));
        key.choices.extend(kinds(&key.key, registry));
        key.choices.extend(custom(key, registry));
    }
    keys.extend(params::keys(registry));
    let detector = keys.iter_mut().filter(|key| key.key == "operator.NAME.detector");
    detector.for_each(|key| key.choices.extend(custom(key, registry)));
    // Kinds with common keys, such as those of `[operator.NAME]`, are listed in one place.
    keys.sort_by(|a, b| (&a.key, &a.only_with).cmp(&(&b.key, &b.only_with)));
    keys
}

/// Operator kinds of the registry.
fn kinds(key: &str, registry: &Registry) -> Vec<Choice> {
    let choice = |name: &str, doc: &str| Choice { name: name.to_owned(), doc: doc.to_owned() };
    let kinds = registry.kinds().filter(|_| key == "operator.NAME.kind");
    kinds.map(|kind| choice(kind.node().kind, kind.node().doc)).collect()
}

/// Algorithms of the registry beyond the built-in ones, which the type of the key lists.
fn custom(key: &Key, registry: &Registry) -> Vec<Choice> {
    let names = limits::algorithms(&key.key, registry).into_iter();
    let custom = names.filter(|name| key.choices.iter().all(|choice| choice.name != *name));
    custom.map(|name| Choice { name: name.to_owned(), doc: String::new() }).collect()
}

/// Page of all keys.
pub fn whole_page(registry: &Registry) -> String {
    page(&keys(registry).iter().collect::<Vec<_>>())
}

/// Keys that match a request.
fn find<'a>(all: &'a [Key], asked: &str) -> Vec<&'a Key> {
    let begins = |key: &&Key| {
        let rest = key.key.strip_prefix(asked);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.') || asked.ends_with('.'))
    };
    let found: Vec<&Key> = all.iter().filter(begins).collect();
    if !found.is_empty() {
        return found;
    }
    let word = asked.to_lowercase();
    let has = |key: &&Key| {
        let named = key.choices.iter().any(|choice| choice.name.contains(&word));
        named || key.key.contains(&word) || key.doc.to_lowercase().contains(&word)
    };
    all.iter().filter(has).collect()
}

/// Two lines per key: type and description; also the meaning of every value if few keys are requested.
fn text(keys: &[&Key]) -> String {
    const FEW: usize = 3;
    let mut text = String::new();
    for key in keys {
        let default = key.default.as_ref().map(|default| format!(" = {default}")).unwrap_or_default();
        let with = key.only_with.as_ref().map(|with| format!("  [{with}]")).unwrap_or_default();
        let _written = writeln!(text, "{}{default}{with}\n    {}", key.key, what_it_takes(key));
        if !key.doc.is_empty() {
            let _written = writeln!(text, "    {}", key.doc);
        }
        if keys.len() <= FEW {
            let width = key.choices.iter().map(|choice| choice.name.len()).max().unwrap_or(0);
            for choice in &key.choices {
                let line = format!("      {:width$}  {}", choice.name, choice.doc);
                let _written = writeln!(text, "{}", line.trim_end());
            }
        }
    }
    text
}

/// Type, unit and range; the names if the values are names.
fn what_it_takes(key: &Key) -> String {
    let names: Vec<&str> = key.choices.iter().map(|choice| choice.name.as_str()).collect();
    let mut told = match (key.form.as_str(), names.is_empty()) {
        ("name", false) => format!("one of {}", names.join(", ")),
        (form, true) => form.to_owned(),
        (form, false) => format!("{form}: {}", names.join(", ")),
    };
    if let Some(unit) = key.unit.filter(|_| key.form.contains("number")) {
        told += &format!(", {unit}");
    }
    if let Some(range) = &key.range {
        told += &format!("; {range}");
    }
    told
}

/// Page with one table for each part of a configuration.
fn page(keys: &[&Key]) -> String {
    let mut text = "# Keys of a configuration\n\n\
        Made by `swerve keys --markdown`; `swerve keys PREFIX` shows a part of it, `swerve keys WORD` finds a word, and \
        `swerve keys --schema` is the JSON schema for editors; `--schema scenario`, `study` and `timing` are those of \
        the other files.\n\
        `NAME` is a name that you choose. Brackets contain the setting that a key requires.\n\n\
        Later configurations (`-c`), `--set` and the `set` of a study follow one rule: a table is merged key by key into \
        the earlier one; any other value replaces it. The tables `runtime`, `deadline` and `trigger` are one value each.\n"
        .to_owned();
    let mut part = "";
    for key in keys {
        let own = key.key.split('.').next().unwrap_or_default();
        if own != part {
            part = own;
            let _written =
                writeln!(text, "\n## {part}\n\n| key | default | takes | what for |\n|---|---|---|---|");
        }
        let with = key.only_with.as_ref().map(|with| format!(" [{with}]")).unwrap_or_default();
        let cells = [
            &format!("`{}`{with}", key.key),
            key.default.as_deref().unwrap_or(""),
            &what_it_takes(key),
            &key.doc,
        ];
        let cells = cells.map(|cell| cell.replace('|', "\\|"));
        let _written = writeln!(text, "| {} |", cells.join(" | "));
    }
    text
}

#[cfg(test)]
mod tests {
    use swerve_stack::Setup;
    use swerve_text::parse_assignment;

    use super::*;

    fn all() -> Vec<Key> {
        keys(&Registry::standard())
    }

    fn key<'a>(all: &'a [Key], key: &str) -> &'a Key {
        all.iter().find(|one| one.key == key).unwrap_or_else(|| panic!("no {key}"))
    }

    #[test]
    fn key_has_its_type_default_unit_range_and_description() {
        let all = all();
        let dt = key(&all, "sim.dt_ms");
        assert_eq!((dt.form.as_str(), dt.default.as_deref(), dt.unit), ("number", Some("5.0"), Some("ms")));
        assert!(dt.range.as_ref().unwrap().contains("20"), "{:?}", dt.range);
        assert!(dt.doc.starts_with("Step, ms"), "{}", dt.doc);
        let weather = key(&all, "render.weather");
        assert_eq!(weather.choices.len(), 15);
        let at = key(&all, "camera.NAME.at_m");
        assert_eq!((at.form.as_str(), at.unit), ("array of 3 x number", Some("m")));
        assert!(
            key(&all, "perception.detector").choices.iter().any(|one| one.name == "efficientdet-d3@v100")
        );
        assert!(key(&all, "operator.NAME.kind").choices.iter().any(|one| one.name == "camera_objects"));
        assert!(all.iter().any(|one| one.only_with.as_deref() == Some("planner = \"fot\"")));
    }

    #[test]
    fn every_key_has_a_description_and_accepts_its_default() {
        let all = all();
        assert!(all.len() > 300, "{}", all.len());
        let silent: Vec<&str> = all.iter().filter(|key| key.doc.is_empty()).map(|key| &*key.key).collect();
        assert!(silent.is_empty(), "without a doc comment: {silent:?}");
        let texts = all.iter().flat_map(|key| key.choices.iter().map(|one| &one.doc).chain([&key.doc]));
        let linked: Vec<&String> = texts.filter(|doc| doc.contains("[`") || doc.contains("::")).collect();
        assert!(linked.is_empty(), "links to items of the code: {linked:?}");
        for key in all.iter().filter(|key| key.only_with.is_none() && !key.key.contains("NAME")) {
            // Long defaults are abbreviated, and required values are empty.
            let is_whole = |text: &&String| !text.starts_with('a') && **text != "\"\"";
            let Some(default) = key.default.as_ref().filter(is_whole) else { continue };
            let set = parse_assignment(&format!("{}={default}", key.key)).unwrap();
            let problems = Setup::load(None, &[set]).err().unwrap_or_default();
            let of_key = problems.iter().find(|problem| problem.key == key.key);
            assert_eq!(of_key, None, "{} = {default}", key.key);
        }
    }

    #[test]
    fn every_key_of_the_default_configuration_is_listed() {
        let all = all();
        let table = toml::Table::try_from(Config::default()).unwrap();
        fn leaves(at: &str, value: &toml::Value, into: &mut Vec<String>) {
            match value {
                toml::Value::Table(inner) if !inner.is_empty() => {
                    inner.iter().for_each(|(key, value)| leaves(&format!("{at}.{key}"), value, into));
                }
                _ => into.push(at.trim_start_matches('.').to_owned()),
            }
        }
        let mut wanted = Vec::new();
        leaves("", &toml::Value::Table(table), &mut wanted);
        let is_listed = |key: &String| {
            all.iter().any(|one| {
                let (mut a, mut b) = (one.key.split('.'), key.split('.'));
                a.by_ref().zip(b.by_ref()).all(|(a, b)| a == b || a == "NAME") && a.next().is_none()
            })
        };
        let missing: Vec<_> = wanted.iter().filter(|key| !is_listed(key)).collect();
        // Empty tables of named entries.
        let missing: Vec<_> =
            missing.iter().filter(|key| !all.iter().any(|one| one.key.starts_with(&***key))).collect();
        assert!(missing.is_empty(), "{missing:?}");
    }

    #[test]
    fn word_finds_keys_by_name_value_or_description() {
        let all = all();
        let found = |asked: &str| find(&all, asked).iter().map(|key| key.key.clone()).collect::<Vec<_>>();
        assert!(found("sim").iter().all(|key| key.starts_with("sim.")));
        assert!(found("clear_noon").contains(&"render.weather".to_owned()));
        assert!(found("added_latency").contains(&"planning.added_latency_ms".to_owned()));
        assert!(found("sim").len() > 3 && found("planing.planer").is_empty());
        let of_scenarios = of_file(FileKind::Scenario, &Registry::standard());
        let verdict = find(&of_scenarios, "expect.verdict")[0];
        let stopped = verdict.choices.iter().find(|one| one.name == "stopped").unwrap();
        assert!(stopped.doc.contains("stood safely"), "{verdict:?}");
        assert!(verdict.choices.iter().all(|one| !one.doc.is_empty()) && verdict.choices.len() == 6);
        assert_eq!((verdict.form.as_str(), verdict.doc.as_str()), ("name", "How the run goes."));
        assert!(!find(&of_scenarios, "actor.NAME.s_m").is_empty(), "entries of arrays are listed");
        for kind in [FileKind::Study, FileKind::Timing] {
            assert!(of_file(kind, &Registry::standard()).len() > 10, "{kind:?}");
        }
    }
}
