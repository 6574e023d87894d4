use std::path::Path;

use swerve_core::digest_of;
use swerve_stack::config::Config;
use swerve_stack::pipeline::Pipeline;

use super::*;
use crate::drive_pipeline;

fn scenario() -> Scenario {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/person_behind_truck.toml");
    Scenario::read(&file).unwrap()
}

/// Drives the first tenth of a second with pictures; gives the run's digest and the pictures.
fn pictures(folder: &Path, threads: usize) -> (swerve_core::Digest, Vec<Vec<u8>>) {
    let (mut config, scenario) = (Config::default(), scenario());
    config.render.threads = threads;
    let mut pipeline = Pipeline::build(&config, &scenario).unwrap();
    pipeline.until = Time::ZERO + Span::from_ms(100);
    let mut frames = Frames::create(folder, "a drive".into(), &pipeline.scenario, &config).unwrap();
    let outcome = drive_pipeline(pipeline, config.seed, 1, &mut [&mut frames]).unwrap();
    let count = frames.finish().unwrap();
    let read = |k: usize| std::fs::read(folder.join(format!("{k:05}.png"))).unwrap();
    (outcome.digest, (0..count).map(read).collect())
}

#[test]
fn pictures_are_the_same_bytes_on_any_number_of_threads_and_change_nothing_in_the_run() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("00099.png"), "of an earlier run").unwrap();
    std::fs::write(folder.path().join("notes.png"), "not ours").unwrap();
    let (digest, one) = pictures(folder.path(), 1);
    assert_eq!(one.len(), 3);
    assert_ne!(digest_of(&one[0]), digest_of(&one[2]), "the ego moves");
    assert!(!folder.path().join("00099.png").exists() && folder.path().join("notes.png").exists());
    let (again, two) = pictures(folder.path(), 2);
    assert!(one == two);
    assert_eq!(digest, again);
    let mut pipeline = Pipeline::build(&Config::default(), &scenario()).unwrap();
    pipeline.until = Time::ZERO + Span::from_ms(100);
    assert_eq!(drive_pipeline(pipeline, 1, 1, &mut []).unwrap().digest, digest);
}

#[test]
fn a_picture_that_cannot_be_written_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().join("frames");
    let (config, scenario) = (Config::default(), scenario());
    let mut frames = Frames::create(&inside, String::new(), &scenario, &config).unwrap();
    std::fs::remove_dir(&inside).unwrap();
    let mut pipeline = Pipeline::build(&config, &scenario).unwrap();
    pipeline.until = Time::ZERO;
    drive_pipeline(pipeline, 1, 1, &mut [&mut frames]).unwrap();
    let error = format!("{:#}", frames.finish().unwrap_err());
    assert!(error.contains("00000.png"), "{error}");
}
