//! Programs that a configuration starts, and the user's consent to them.
//!
//! A parsed configuration may start no program. Consent is given afterwards, by [`Setup::trust`](crate::Setup::trust) for the
//! layers that the user vouches for, or by [`Setup::allow_programs`](crate::Setup::allow_programs) for all of it.

use core::fmt;
use std::collections::BTreeMap;
use std::path::Path;

use swerve_text::{Document, set};

use super::Config;
use super::process::{ProcessConfig, with_whole_paths};

/// A program that a configuration starts.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct NamedProgram {
    /// The key that names it, such as `process.far.start`.
    pub key: String,
    /// The program and its arguments.
    pub words: Vec<String>,
}

/// Keys of a process that name programs, with their values.
type Names = BTreeMap<&'static str, toml::Value>;

/// One of the texts that make up a configuration.
#[derive(Clone)]
pub struct Layer {
    /// Name in messages.
    file: String,
    /// Reason to start no program that it names; `None` for one of the user's own texts.
    doubt: Option<String>,
    document: Option<Document>,
    table: toml::Table,
}

impl Layer {
    /// A file, with the reason to start no program that it names.
    pub fn of_file(document: Document, doubt: Option<String>) -> Self {
        let table = with_whole_paths(document.table.clone(), document.folder());
        Self { file: document.file.clone(), doubt, document: Some(document), table }
    }

    /// Assignments that `file` makes.
    pub fn of_sets(file: &str, sets: &[(String, toml::Value)], doubt: Option<String>) -> Self {
        let mut table = toml::Table::new();
        for (key, value) in sets {
            // An invalid assignment names nothing.
            let _unset = set(&mut table, key, value.clone());
        }
        let table = with_whole_paths(table, Path::new(""));
        Self { file: file.to_owned(), doubt, document: None, table }
    }

    /// Returns true if a table may name programs.
    pub fn names_programs(table: &toml::Table) -> bool {
        table.contains_key("process")
    }

    fn names(&self, process: &str, key: &str) -> Option<&toml::Value> {
        self.table.get("process")?.get(process)?.get(key)
    }

    /// `key` of this file with its line.
    fn place(&self, key: &str) -> String {
        match &self.document {
            Some(document) => document.problem(key, "").to_string().trim_end_matches([':', ' ']).to_owned(),
            None => format!("{}: {key}", self.file),
        }
    }
}

/// Processes whose programs may be started, by name, and the refusals of the others.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Consent {
    allowed: BTreeMap<String, Names>,
    refused: BTreeMap<String, String>,
}

impl ProcessConfig {
    fn names(&self) -> Names {
        let mut names = Names::new();
        if !self.start.is_empty() {
            names.insert("start", self.start.clone().into());
        }
        names.extend(self.python.clone().map(|python| ("python", python.into())));
        let interpreter = self.interpreter.as_ref().map(|path| path.to_string_lossy().into_owned());
        names.extend(interpreter.map(|interpreter| ("interpreter", interpreter.into())));
        names
    }

    fn program(&self, name: &str) -> Option<NamedProgram> {
        let of = |key: &str, words| Some(NamedProgram { key: format!("process.{name}.{key}"), words });
        if !self.start.is_empty() {
            return of("start", self.start.clone());
        }
        let python = self.python.as_ref()?;
        let interpreter = self.interpreter.as_ref();
        let interpreter = interpreter.map_or_else(|| "python3".into(), |path| path.display().to_string());
        let words = [&interpreter, "-m", "swerve", "worker", python];
        of("python", words.map(str::to_owned).to_vec())
    }
}

impl Config {
    /// Programs that it starts, in the order of their processes.
    pub fn programs(&self) -> impl Iterator<Item = NamedProgram> {
        self.process.iter().filter_map(|(name, process)| process.program(name))
    }

    /// Returns true if a process is started by a program that it names.
    pub fn names_program(&self, process: &str) -> bool {
        self.process.get(process).is_some_and(|config| config.program(process).is_some())
    }
}

impl Consent {
    /// Consent to all programs that a configuration names.
    pub(crate) fn to_all(config: &Config) -> Self {
        let all = config.process.iter().map(|(name, process)| (name.clone(), process.names()));
        Self { allowed: all.collect(), refused: BTreeMap::new() }
    }

    /// Consent to the programs named by the user's own texts; `layers` are all texts of the configuration, later ones
    /// overriding earlier ones. A value that no layer has is refused.
    pub(crate) fn by_layers(config: &Config, layers: &[Layer]) -> Self {
        let mut consent = Self::default();
        for (name, process) in &config.process {
            let names = process.names();
            match names.iter().find_map(|(key, value)| refusal(layers, name, key, value)) {
                Some(why) => consent.refused.insert(name.clone(), why),
                None => consent.allowed.insert(name.clone(), names).map(|_| String::new()),
            };
        }
        consent
    }

    /// Reason to start no program for a process: the user has not consented to it.
    pub(crate) fn refusal(&self, config: &Config, process: &str) -> Option<Refusal> {
        let config = config.process.get(process)?;
        let program = config.program(process)?;
        if self.allowed.get(process) == Some(&config.names()) {
            return None;
        }
        let why = self.refused.get(process).cloned();
        let why = why.unwrap_or_else(|| format!("{}: {UNNAMED}", program.key));
        Some(Refusal { why, words: program.words })
    }
}

/// The refusal of a program.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Refusal {
    /// File, line, key and reason.
    pub why: String,
    /// The command line.
    pub words: Vec<String>,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; not started: expected --allow-code to run `{}`", self.why, shown(&self.words))
    }
}

const UNNAMED: &str = "named by no file of yours";

/// Reason to distrust the value of one key, if there is one.
fn refusal(layers: &[Layer], process: &str, key: &str, value: &toml::Value) -> Option<String> {
    let whole = format!("process.{process}.{key}");
    let Some(layer) = layers.iter().rev().find(|layer| layer.names(process, key).is_some()) else {
        return Some(format!("{whole}: {UNNAMED}"));
    };
    if layer.names(process, key) != Some(value) {
        return Some(format!("{}: changed since it was read", layer.place(&whole)));
    }
    layer.doubt.as_ref().map(|doubt| format!("{}: {doubt}", layer.place(&whole)))
}

/// Command line for display: words that a shell would split or change are quoted, control characters escaped.
pub fn shown(words: &[String]) -> String {
    let word = |word: &String| {
        let plain = |c: char| c.is_alphanumeric() || "./_-=+:,@%".contains(c);
        let escaped: String = word.chars().map(escaped).collect();
        if !word.is_empty() && word.chars().all(plain) { escaped } else { format!("'{escaped}'") }
    };
    words.iter().map(word).collect::<Vec<_>>().join(" ")
}

fn escaped(c: char) -> String {
    if c.is_control() { c.escape_default().to_string() } else { c.to_string() }
}

/// Keys whose values start programs or name files and shared memory; `*` stands for any name.
const OUTSIDE: [&str; 7] = [
    "process",
    "shared_memory",
    "localization.map",
    "prediction.weights",
    "source",
    "live",
    "operator.*.detector",
];

/// Key that starts programs or names files or shared memory, if an assignment sets one in whole or in part.
pub fn reaches_outside(key: &str, value: &toml::Value) -> Option<&'static str> {
    let mut table = toml::Table::new();
    // Invalid assignments are refused by the reader of configurations.
    set(&mut table, key, value.clone()).ok()?;
    OUTSIDE.into_iter().find(|outside| has(&toml::Value::Table(table.clone()), outside))
}

fn has(value: &toml::Value, path: &str) -> bool {
    let (first, rest) = path.split_once('.').map_or((path, None), |(first, rest)| (first, Some(rest)));
    let Some(table) = value.as_table() else { return false };
    let mut within = table.iter().filter(|(name, _)| first == "*" || *name == first);
    within.any(|(_, value)| rest.is_none_or(|rest| has(value, rest)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup::Setup;

    const FAR: &str = "[process.far]\noperators = [\"planner\"]\nstart = [\"ssh\", \"far\"]\n";

    fn document(file: &str, text: &str) -> Document {
        Document::parse(file, text).unwrap()
    }

    fn config(text: &str, sets: &[(String, toml::Value)]) -> Setup {
        Setup::from_document(&document("c.toml", text), sets).unwrap()
    }

    fn start(words: &[&str]) -> Vec<(String, toml::Value)> {
        let words: Vec<toml::Value> = words.iter().map(|word| (*word).into()).collect();
        vec![("process.far.start".into(), words.into())]
    }

    #[test]
    fn parsed_configuration_starts_no_program_until_the_user_consents() {
        let mut config = config(FAR, &[]);
        let why = config.refusal("far").unwrap().to_string();
        assert!(why.contains("process.far.start") && why.ends_with("to run `ssh far`"), "{why}");
        config.trust(&[Layer::of_file(document("c.toml", FAR), None)]);
        assert_eq!(config.refusal("far"), None);
        config.process.get_mut("far").unwrap().start.push("rm".into());
        assert!(config.refusal("far").is_some(), "consent is to this command line and no other");
        config.allow_programs();
        assert_eq!(config.refusal("far"), None);
        let text = FAR.replace("start", "#start");
        let own = Setup::from_document(&document("c.toml", &text), &[]).unwrap();
        assert_eq!(own.refusal("far"), None, "this program itself needs no consent");
    }

    #[test]
    fn last_layer_that_names_a_program_decides() {
        let doubt = || Some("somebody else's".to_owned());
        let evil = start(&["evil"]);
        let cases = [
            (config(FAR, &[]), vec![Layer::of_file(document("c.toml", FAR), doubt())], Some("c.toml:3")),
            (
                config(FAR, &evil),
                vec![
                    Layer::of_file(document("c.toml", FAR), None),
                    Layer::of_sets("study.toml", &evil, doubt()),
                ],
                Some("study.toml: process.far.start"),
            ),
            (
                config(FAR, &evil),
                vec![Layer::of_file(document("c.toml", FAR), doubt()), Layer::of_sets("--set", &evil, None)],
                None,
            ),
            (config(FAR, &evil), vec![Layer::of_file(document("c.toml", FAR), None)], Some("changed since")),
            (config(FAR, &[]), vec![], Some("named by no file")),
        ];
        for (k, (mut config, layers, expected)) in cases.into_iter().enumerate() {
            config.trust(&layers);
            let why = config.refusal("far").map(|refusal| refusal.why);
            assert_eq!(why.is_some(), expected.is_some(), "{k}: {why:?}");
            assert!(why.unwrap_or_default().contains(expected.unwrap_or_default()), "{k}");
        }
    }

    #[test]
    fn command_line_is_shown_without_control_characters() {
        let words = ["sh", "-c", "echo \u{1b}[2J; id\r"].map(str::to_owned);
        assert_eq!(shown(&words), "sh -c 'echo \\u{1b}[2J; id\\r'");
    }

    #[test]
    fn keys_that_reach_outside_are_found_in_every_form() {
        let of = |text: &str| {
            let (key, value) = swerve_text::parse_assignment(text).unwrap();
            reaches_outside(&key, &value)
        };
        for (text, expected) in [
            ("process.p.start=[\"sh\"]", "process"),
            ("process={p={python=\"a.py:A\"}}", "process"),
            ("process.p={interpreter=\"a\"}", "process"),
            ("localization={map=\"/etc/passwd\"}", "localization.map"),
            ("localization.map=/etc/passwd", "localization.map"),
            ("operator={x={kind=\"camera_objects\",detector=\"/a\"}}", "operator.*.detector"),
            ("operator.x.detector=/a", "operator.*.detector"),
            ("live.route=/a", "live"),
            ("source.rosbag=/a", "source"),
            ("shared_memory.name=a", "shared_memory"),
        ] {
            assert_eq!(of(text), Some(expected), "{text}");
        }
        for text in ["planning.planner=fot", "localization.method=truth", "operator.planner.runtime=1"] {
            assert_eq!(of(text), None, "{text}");
        }
    }
}
