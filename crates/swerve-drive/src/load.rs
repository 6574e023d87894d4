//! Loading and checking of the files named on a command line.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use swerve_report::output::tell;
use swerve_scenario::{Scenario, split_sets};
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_stack::config::Config;
use swerve_stack::config::programs::Layer;
use swerve_text::{Document, Problems, did_you_mean, parse_assignment, parse_assignments};

use crate::shipped::{FILES, Kind, Shipped, plain};
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

/// Reads and checks the files named on a command line for a simulated drive; reports the scenario's warnings on standard
/// error. The simulated car takes the place of the vehicle of a configuration with `[live]`.
///
/// # Errors
/// All errors in the files, or a configuration of a recorded drive.
pub fn load(registry: &Registry, input: &RunInput) -> anyhow::Result<(Setup, Scenario)> {
    read(registry, input, true)
}

/// Same as [`load`], with the vehicle of a configuration with `[live]`: for a drive that is described and not driven.
pub(crate) fn load_as_written(registry: &Registry, input: &RunInput) -> anyhow::Result<(Setup, Scenario)> {
    read(registry, input, false)
}

fn read(registry: &Registry, input: &RunInput, is_simulated: bool) -> anyhow::Result<(Setup, Scenario)> {
    let mut sets = parse_assignments(&input.set)?;
    if let Some(seed) = input.seed {
        sets.push(("seed".into(), toml::Value::Integer(seed)));
    }
    let (of_scenario, of_config) = split_sets(&sets);
    let mut config = read_config(registry, &input.config, &of_config, is_simulated)?;
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

/// Configuration of files and assignments. For a simulated drive, `[live]` is left out.
fn read_config(
    registry: &Registry,
    files: &[PathBuf],
    sets: &[(String, toml::Value)],
    is_simulated: bool,
) -> anyhow::Result<Setup> {
    let problems = |problems: Problems| problems_error(&problems);
    if !is_simulated {
        return Kind::Config.config(registry, files, sets).map_err(problems);
    }
    let (mut document, mut layers) =
        Kind::Config.layers(files).map_err(|problem| problems_error(&[problem]))?;
    let is_of = |key: &str, table: &str| key == table || key.starts_with(&format!("{table}."));
    if document.table.contains_key("source") || sets.iter().any(|(key, _)| is_of(key, "source")) {
        let message = "a recorded drive has no simulated car: expected `swerve live`";
        return Err(problems_error(&[document.problem("source", message.to_owned())]));
    }
    let sets: Vec<_> = sets.iter().filter(|(key, _)| !is_of(key, "live")).cloned().collect();
    if document.table.contains_key("live") {
        let message = "has no effect: the simulated car takes the place of the vehicle";
        tell(&format!("note: {}", document.problem("live", message.to_owned())));
        document.table.remove("live");
    }
    layers.push(Layer::of_sets("--set", &sets, None));
    let mut config = Setup::from_document_with(registry, &document, &sets).map_err(problems)?;
    config.trust(&layers);
    Ok(config)
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
    let mut config = read_config(registry, files, &sets, true)?;
    code.start(&mut config)?;
    Ok(config)
}

/// The paths of the built-in TOML files of a folder that does not exist, such as `configs/live`; otherwise the given path.
pub fn files_of(given: &Path) -> Vec<PathBuf> {
    let folder = plain(given).filter(|_| !given.exists()).map(|folder| folder + "/");
    let is_in = |file: &&Shipped| {
        file.path.ends_with(".toml") && folder.as_ref().is_some_and(|folder| file.path.starts_with(folder))
    };
    let found: Vec<PathBuf> = FILES.iter().filter(is_in).map(|file| file.path.into()).collect();
    if found.is_empty() { vec![given.to_owned()] } else { found }
}

/// True if a file of a folder belongs to another program, such as a Cargo manifest: none of its tables and values has a
/// name known to Swerve.
pub fn is_foreign(path: &Path) -> bool {
    const OURS: [&str; 7] = ["road", "map", "expect", "actor", "base", "axis", "span_ms"];
    let Ok(document) = Document::read(path) else { return false };
    let is_ours = |key: &String| {
        OURS.contains(&key.as_str())
            || swerve_text::keys::<Config>("").is_some_and(|keys| keys.contains(&key.as_str()))
    };
    !document.table.is_empty() && !document.table.keys().any(is_ours)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CodeArgs;

    fn read(files: &[&str], set: &[&str], is_simulated: bool) -> anyhow::Result<Setup> {
        let files: Vec<PathBuf> = files.iter().map(PathBuf::from).collect();
        let sets = parse_assignments(&set.iter().map(ToString::to_string).collect::<Vec<_>>())?;
        read_config(&Registry::standard(), &files, &sets, is_simulated)
    }

    #[test]
    fn folder_that_does_not_exist_is_that_of_built_in_files() {
        let folder = files_of(Path::new("nowhere/../configs/live"));
        assert!(
            folder.len() >= 7 && folder.iter().all(|file| file.starts_with("configs/live")),
            "{folder:?}"
        );
        assert_eq!(files_of(Path::new("configs/lives")), [Path::new("configs/lives")]);
        assert_eq!(files_of(Path::new("")), [Path::new("")]);
    }

    /// The configuration of a vehicle is tried on the simulated car first.
    #[test]
    fn simulated_car_takes_the_place_of_a_vehicle() {
        for name in ["autoware", "configs/live/autoware.toml", "live/autoware_lidar"] {
            let config = read(&[name], &["gate.enabled=true", "live.enable=at_start"], true).unwrap();
            assert!(config.live.is_none() && config.gate.enabled, "{name}");
            assert!(read(&[name], &[], false).unwrap().live.is_some(), "{name}");
        }
        let recorded = read(&["autoware"], &["source.rosbag=drive.mcap"], true).err().unwrap().to_string();
        assert!(recorded.contains("source: a recorded drive has no simulated car"), "{recorded}");
        let code = CodeArgs { allow_code: false };
        assert!(load_config(&Registry::standard(), &["autoware".into()], &[], code).unwrap().live.is_none());
    }
}
