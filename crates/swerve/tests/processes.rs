//! Runs over several processes of this very program.

use std::path::{Path, PathBuf};

use swerve::config::Config;
use swerve::config::text::parse_assignment;
use swerve::pipeline::Pipeline;
use swerve::process::Processes;
use swerve::run::{Outcome, drive, drive_pipeline, read_scenario};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn scenario_file(name: &str) -> PathBuf {
    root().join("scenarios").join(name).with_extension("toml")
}

fn config(file: Option<&str>, sets: &[&str]) -> Config {
    let sets: Vec<_> = sets.iter().map(|set| parse_assignment(set).unwrap()).collect();
    let file = file.map(|name| root().join("configs").join(name).with_extension("toml"));
    Config::load(file.as_deref(), &sets).unwrap_or_else(|problems| panic!("{problems:?}"))
}

/// Drives over the processes of `config`.
fn drive_split(config: &Config, scenario: &str, threads: usize) -> Outcome {
    let file = scenario_file(scenario);
    let mut pipeline = Pipeline::build(config, &read_scenario(&file).unwrap()).unwrap();
    let text = std::fs::read_to_string(&file).unwrap();
    let program = Path::new(env!("CARGO_BIN_EXE_swerve"));
    let processes = Processes::start(program, config, &text, &mut pipeline).unwrap();
    let outcome = drive_pipeline(pipeline, config.seed, threads, &mut []).unwrap();
    assert!(processes.traffic().calls > 20, "{:?}", processes.traffic());
    outcome
}

#[test]
fn two_processes_drive_as_one() {
    let split = config(Some("two_processes"), &[]);
    assert_eq!(split.process.len(), 2);
    let scenario = read_scenario(&scenario_file("person_behind_truck")).unwrap();
    let together = drive(&Config { process: Default::default(), ..split.clone() }, &scenario).unwrap();
    for threads in [1, 2] {
        let outcome = drive_split(&split, "person_behind_truck", threads);
        assert_eq!(outcome.digest, together.digest);
        assert_eq!(outcome.report.operators, together.report.operators);
    }
}
