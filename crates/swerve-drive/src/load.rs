//! Loading and checking of the files named on a command line.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use swerve_report::output::tell;
use swerve_scenario::{Scenario, split_sets};
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_stack::config::Config;
use swerve_text::{did_you_mean, parse_assignment, parse_assignments};

use crate::shipped::Kind;
use crate::trust::CodeArgs;

/// Scenario, configuration and overrides of a run.
#[derive(clap::Args, Clone, Debug)]
pub struct RunInput {
    /// Scenario file (TOML, CommonRoad 2020a as .xml, .xml.gz or .pb, or a .sumocfg of SUMO), or the name of a built-in one, see `swerve scenarios`
    pub scenario: PathBuf,
    /// Configuration file (TOML), or the name of a built-in one, such as paper. Repeatable: later files override
    /// earlier ones; missing keys have defaults
    #[arg(short, long)]
    pub config: Vec<PathBuf>,
    /// Set a key of the configuration (planning.planner=rrt_star) or the scenario (actor.person.speed_mps=4). A
    /// table, KEY={...}, changes the keys that it names
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Random seed
    #[arg(long, allow_negative_numbers = true, value_parser = clap::value_parser!(i64).range(0..))]
    pub seed: Option<i64>,
    /// Start programs named in configurations from outside the current folder: process.NAME.start, python and
    /// interpreter
    // Not flattened: clap does not allow an optional group of arguments to contain another one.
    #[arg(long)]
    pub allow_code: bool,
}

impl RunInput {
    /// Consent to start programs.
    pub fn code(&self) -> CodeArgs {
        CodeArgs { allow_code: self.allow_code }
    }
}

/// Joins several problems to one error.
pub fn problems_error<P: ToString>(problems: &[P]) -> anyhow::Error {
    let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
    anyhow!(lines.join("\n"))
}

/// Reads a scenario from a file or by its name; reports all its problems in one error.
pub fn read_scenario(path: &Path) -> anyhow::Result<Scenario> {
    read_scenario_with(path, &[])
}

/// Same as [`read_scenario`], with single keys changed.
fn read_scenario_with(path: &Path, sets: &[(String, toml::Value)]) -> anyhow::Result<Scenario> {
    let (document, map) = Kind::scenario(path)?;
    let of_sumo = crate::sumo::left_out(&document, map.as_ref().filter(|_| crate::sumo::is_config(path)))
        .map_err(|problem| problems_error(&[problem]))?;
    let sets = [&of_sumo, sets].concat();
    let scenario = Scenario::parse_on(&document.file, &document.text, map.as_ref(), &sets)
        .map_err(|problems| problems_error(&problems))?;
    let names: Vec<String> = Config::pipeline_names().collect();
    let known = |name: &&String| names.contains(name);
    let unknown: Vec<&String> =
        scenario.expect.iter().filter_map(|e| e.pipeline.as_ref()).filter(|name| !known(name)).collect();
    if unknown.is_empty() {
        return Ok(scenario);
    }
    let problem = |name: &&String| {
        let near = did_you_mean(name, names.iter().map(String::as_str));
        let message = format!("unknown pipeline `{name}`, expected one of {}{near}", names.join(", "));
        document.problem(&format!("expect.pipeline.{name}"), message)
    };
    Err(problems_error(&unknown.iter().map(problem).collect::<Vec<_>>()))
}

/// Reads and checks the files named on a command line; reports the scenario's warnings on standard error.
pub fn load(registry: &Registry, input: &RunInput) -> anyhow::Result<(Setup, Scenario)> {
    let mut sets = parse_assignments(&input.set)?;
    if let Some(seed) = input.seed {
        sets.push(("seed".into(), toml::Value::Integer(seed)));
    }
    let (of_scenario, of_config) = split_sets(&sets);
    let mut config = Kind::Config
        .config(registry, &input.config, &of_config)
        .map_err(|problems| problems_error(&problems))?;
    input.code().apply(&mut config);
    let scenario = read_scenario_with(&input.scenario, &of_scenario)?;
    for warning in config.beyond_domain() {
        tell(&format!("warning: {warning}"));
    }
    for warning in scenario.warnings() {
        tell(&format!("warning: {}: {warning}", input.scenario.display()));
    }
    Ok((config, scenario))
}

/// Reports on standard error, a line each, the keys of a command line and its files that have no effect.
pub fn note_idle(config: &Setup, input: &RunInput) {
    let (_, sets) = split_sets(&parse_assignments(&input.set).unwrap_or_default());
    for (key, value) in sets {
        let mut given = toml::Table::new();
        if swerve_text::set(&mut given, &key, value).is_ok() {
            config.idle(&given).iter().for_each(|(key, why)| tell(&format!("note: --set: {key}: {why}")));
        }
    }
    // A pipe is read once.
    let files = input.config.iter().filter(|path| path.is_file() || !path.exists());
    for document in files.filter_map(|path| Kind::Config.document(path).ok()) {
        for (key, why) in config.idle(&document.table) {
            tell(&format!("note: {}", document.problem(&key, why)));
        }
    }
}

/// Reads configuration files for a drive, with the assignments and the consent of a command line; reports the programs
/// that it starts.
///
/// # Errors
/// All errors in the configuration, or a program without the user's consent.
pub fn load_config(
    registry: &Registry,
    files: &[PathBuf],
    set: &[String],
    code: CodeArgs,
) -> anyhow::Result<Setup> {
    let sets = parse_assignments(set)?;
    let config = Kind::Config.config(registry, files, &sets);
    let mut config = config.map_err(|problems| problems_error(&problems))?;
    code.start(&mut config)?;
    Ok(config)
}

/// Collects the operators whose run times are set with `--set`.
///
/// # Errors
/// If a word is not an assignment, or sets a key inside another's value.
pub fn operators_with_runtime(words: &[String]) -> anyhow::Result<BTreeSet<String>> {
    let mut table = toml::Table::new();
    for word in words {
        let (key, value) = parse_assignment(word)?;
        swerve_text::set(&mut table, &key, value)
            .map_err(|(key, message)| anyhow!("--set: {key}: {message}"))?;
    }
    let operators = table.get("operator").and_then(toml::Value::as_table).into_iter().flatten();
    let named = operators.filter(|(_, settings)| settings.get("runtime").is_some());
    Ok(named.map(|(name, _)| name.clone()).collect())
}
