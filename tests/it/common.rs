//! Scenarios, configurations and recorded runs.

use std::path::{Path, PathBuf};

use swerve_drive::{Outcome, drive_pipeline, read_scenario, run_start, set_up};
use swerve_log::Recorder;
use swerve_stack::Setup;
use swerve_stack::pipeline::Pipeline;
use swerve_text::parse_assignment;

/// Root of the repository.
pub(crate) fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// The file of a shipped scenario.
pub(crate) fn scenario_file(name: &str) -> PathBuf {
    root().join("scenarios").join(name).with_extension("toml")
}

/// `--set` assignments, parsed.
pub(crate) fn sets(assignments: &[&str]) -> Vec<(String, toml::Value)> {
    assignments.iter().map(|a| parse_assignment(a).unwrap()).collect()
}

/// The default configuration with some assignments.
pub(crate) fn config(assignments: &[&str]) -> Setup {
    Setup::load(None, &sets(assignments)).unwrap_or_else(|problems| panic!("{problems:?}"))
}

/// Runs the scenario in `file` and records it to `log`.
pub(crate) fn record(config: &Setup, file: &Path, log: &Path, threads: usize) -> Outcome {
    let pipeline = Pipeline::build(config, &read_scenario(file).unwrap()).unwrap();
    let _earlier = std::fs::remove_file(log);
    let mut recorder = Recorder::create(log, &run_start(config, &pipeline.scenario, file)).unwrap();
    set_up(&mut recorder, config, &pipeline);
    let outcome = drive_pipeline(pipeline, config.seed, threads, &mut [&mut recorder]).unwrap();
    recorder.finish().unwrap();
    outcome
}
