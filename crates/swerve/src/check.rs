//! `swerve check`: reports all problems of all files at once, without running anything.

use std::path::{Path, PathBuf};

use anyhow::bail;
use swerve_drive::shipped::Kind;
use swerve_drive::{files_of, is_foreign, trust};
use swerve_gpu::{self as gpu, AdapterKind};
use swerve_lidar::LidarEngine;
use swerve_report::output::{quoted, tell};
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_stack::config::Config;
use swerve_stack::config::programs::Layer;
use swerve_stack::pipeline::drawn;
use swerve_study::Bench;
use swerve_text::{Document, Problem, Problems, parse_assignments};

/// `swerve check`.
#[derive(clap::Args, Debug)]
pub(crate) struct CheckArgs {
    /// Files, folders or built-in files to check [default: scenarios and configs]
    paths: Vec<PathBuf>,
    /// Set a key of the configurations, as for `swerve run` and `swerve live`
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

/// Folders checked by default.
const FOLDERS: [&str; 2] = ["scenarios", "configs"];

/// Cargo files of a package, which are not configurations.
const CARGOS: [&str; 2] = ["Cargo.toml", "rust-toolchain.toml"];

/// Suggests a command for a folder without these.
fn hint() -> String {
    let entries = std::fs::read_dir(".").into_iter().flatten().flatten().map(|entry| entry.file_name());
    let names = entries.map(|name| name.to_string_lossy().into_owned());
    let mut ours: Vec<String> = names
        .filter(|name| name.ends_with(".toml") && !name.starts_with('.') && !CARGOS.contains(&name.as_str()))
        .collect();
    ours.sort();
    let ours: Vec<String> = ours.iter().map(|name| quoted(name)).collect();
    match ours.is_empty() {
        true => "`swerve new my_project` makes some to begin with".to_owned(),
        false => format!("`swerve check {}`", ours.join(" ")),
    }
}

/// Checks files and folders.
pub(crate) fn run(args: &CheckArgs, registry: &Registry) -> anyhow::Result<()> {
    let (mut files, mut foreign) = (Vec::new(), Vec::new());
    let default: Vec<PathBuf> = FOLDERS.iter().map(PathBuf::from).filter(|folder| folder.is_dir()).collect();
    if args.paths.is_empty() && default.is_empty() {
        bail!(
            "there is no folder {}: expected the files to check ({})",
            FOLDERS.join(" and no folder "),
            hint()
        );
    }
    let given = if args.paths.is_empty() { &default } else { &args.paths };
    for path in given {
        if path.is_dir() {
            let found = swerve_report::files::toml_files(path)?;
            let (others, ours): (Vec<_>, Vec<_>) = found.into_iter().partition(|file| is_foreign(file));
            files.extend(ours);
            foreign.extend(others);
        } else {
            files.extend(files_of(path));
        }
    }
    if !foreign.is_empty() {
        let names: Vec<String> = foreign.iter().map(|file| file.display().to_string()).collect();
        tell(&format!("left out, as none of their keys is one of Swerve's: {}", names.join(", ")));
    }
    if files.is_empty() {
        let folders: Vec<String> = given.iter().map(|path| path.display().to_string()).collect();
        bail!("{}: no .toml file in this folder: expected files to check", folders.join(", "));
    }
    let (sets, mut faults) = (parse_assignments(&args.set)?, Vec::new());
    for file in &files {
        // A study repeats the problems of its scenario and configuration, which may be among the files.
        let new: Vec<String> =
            problems(registry, file, &sets).into_iter().filter(|p| !faults.contains(p)).collect();
        faults.extend(new);
    }
    let files = counted(files.len(), "file");
    if faults.is_empty() {
        return swerve_report::output::print(&format!("{files}, no problem\n"));
    }
    for fault in &faults {
        tell(fault);
    }
    bail!("{} in {files}", counted(faults.len(), "problem"))
}

fn counted(n: usize, what: &str) -> String {
    if n == 1 { format!("{n} {what}") } else { format!("{n} {what}s") }
}

/// Reads a file, or the built-in one of this name.
fn read(path: &Path) -> Result<Document, Problem> {
    const KINDS: [Kind; 5] = [Kind::Scenario, Kind::Config, Kind::Live, Kind::Study, Kind::Timing];
    if swerve_drive::commonroad::is_scenario(path) {
        return swerve_drive::commonroad::document(path);
    } else if swerve_drive::sumo::is_config(path) {
        return swerve_drive::sumo::document(path);
    } else if path.exists() {
        return Document::read(path);
    }
    let found = KINDS.into_iter().find_map(|kind| kind.document(path).ok());
    found.map_or_else(|| Kind::Scenario.document(path), Ok)
}

/// Detects the kind of a file from its top-level keys and returns its problems.
fn problems(registry: &Registry, path: &Path, sets: &[(String, toml::Value)]) -> Vec<String> {
    let document = match read(path) {
        Ok(document) => document,
        Err(problem) => return vec![problem.to_string()],
    };
    let has = |key: &str| document.table.contains_key(key);
    let report = |problems: Problems| problems.iter().map(ToString::to_string).collect();
    if has("road") || has("map") || has("expect") || has("actor") {
        match swerve_drive::read_scenario(path) {
            Ok(scenario) => {
                // Not a problem: old names of verdicts are still accepted.
                let old = scenario.old_verdicts();
                old.iter().for_each(|old| tell(&format!("note: {}: {old}", path.display())));
                let warnings = scenario.warnings();
                warnings.iter().for_each(|one| tell(&format!("warning: {}: {one}", path.display())));
                if let Some(traffic) = scenario.traffic {
                    let left_out = drawn(&Setup::default(), &scenario).left_out();
                    if left_out > 0 {
                        let count = traffic.count();
                        let what = format!("traffic: no place for {left_out} of {count} road users (seed 0)");
                        tell(&format!("warning: {}: {what}", path.display()));
                    }
                }
                Vec::new()
            }
            Err(error) => error.to_string().lines().map(str::to_owned).collect(),
        }
    } else if has("base") || has("axis") {
        match Bench::check(registry, path) {
            Ok(study) => {
                list_notes(path, study.programs());
                Vec::new()
            }
            Err(error) => format!("{error:#}").lines().map(str::to_owned).collect(),
        }
    } else if document.table.get("operator").is_some_and(toml::Value::is_array) || has("span_ms") {
        report(swerve_timing::read_file(path).err().unwrap_or_default())
    } else {
        let config = Setup::from_document_with(registry, &document, sets);
        let mut all: Vec<String> = report(match config {
            Ok(mut config) => {
                let doubt = Kind::Config.doubt(path, &document.text);
                config.trust(&[Layer::of_file(document.clone(), doubt)]);
                list_notes(path, trust::programs_with_doubts(&config));
                list_notes(path, lacks(&config));
                let warnings = config.beyond_domain();
                warnings.iter().for_each(|one| tell(&format!("warning: {}: {one}", path.display())));
                no_adapter(&document, &config)
            }
            Err(problems) => problems,
        });
        if path.exists() && !sets.iter().any(|(key, _)| key == "live.route") {
            all.extend(swerve_live::route_problems(path, &document));
        }
        all
    }
}

/// Lists facts about a file that are not problems, such as the programs that it starts.
fn list_notes(path: &Path, notes: impl IntoIterator<Item = String>) {
    notes.into_iter().for_each(|note| tell(&format!("note: {}: {note}", path.display())));
}

/// Keys that request a graphics adapter.
fn on_adapters(config: &Config) -> Vec<(String, AdapterKind)> {
    let rendering = config.render.backend.in_virtual_time().adapter();
    let mut asked: Vec<_> = rendering.map(|kind| ("render.backend".to_owned(), kind)).into_iter().collect();
    let on_gpu = config.lidar.iter().filter(|(_, lidar)| lidar.engine == LidarEngine::Gpu);
    asked.extend(on_gpu.map(|(name, _)| (format!("lidar.{name}.engine"), AdapterKind::Gpu)));
    asked
}

/// Reports the keys that request a missing graphics adapter.
fn no_adapter(document: &Document, config: &Config) -> Problems {
    let asked = on_adapters(config);
    // A program without the feature knows no adapter of this machine: see `lacks`.
    if asked.is_empty() || gpu::MISSING.is_some() {
        return Problems::new();
    }
    let adapters = gpu::probe();
    let told = |(key, kind): (String, AdapterKind)| {
        let none = adapters.choose(kind).err()?;
        Some(document.problem(&key, format!("{none} (on this machine; `swerve doctor` has details)")))
    };
    asked.into_iter().filter_map(told).collect()
}

/// Lists the keys that need a feature which this program was built without.
fn lacks(config: &Config) -> impl Iterator<Item = String> {
    let gpu = on_adapters(config).into_iter().map(|(key, _)| (key, gpu::MISSING));
    let processes = config.process.keys().map(|name| (format!("process.{name}"), swerve_ipc::MISSING));
    // A recorded drive has no vehicle.
    let vehicle = (config.live.is_some() && config.source.is_none()).then_some("live");
    let driver = config.is_driven_over_ros2().then_some("ego.driver");
    let ros2 = vehicle.into_iter().chain(driver).map(|key| (key.to_owned(), swerve_ros2::bridge::MISSING));
    gpu.chain(processes).chain(ros2).filter_map(|(key, missing)| Some(format!("{key}: {}", missing?)))
}
