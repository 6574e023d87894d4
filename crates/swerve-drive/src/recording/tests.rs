use std::path::{Path, PathBuf};
use std::process::Command;

use swerve_log::{Bag, Log};
use swerve_stack::Registry;
use tempfile::TempDir;

use super::*;
use crate::{RunInput, drive_recorded, load};

/// Log of a shipped scenario with these settings.
fn log_of(scenario: &str, set: &[&str]) -> (TempDir, PathBuf) {
    let input = RunInput {
        scenario: scenario.into(),
        config: Vec::new(),
        set: set.iter().map(|&set| set.to_owned()).collect(),
        seed: None,
        allow_code: false,
    };
    let (config, scenario) = load(&Registry::standard(), &input).unwrap();
    let pipeline = Pipeline::build(&config, &scenario).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let mut recorder = Recorder::create(&path, &run_start(&config, &scenario, &input.scenario)).unwrap();
    set_up(&mut recorder, &config, &pipeline);
    let mut recording = Recording::new(recorder, pipeline.clock, pipeline.graph.stop_handle());
    drive_recorded(pipeline, config.seed, 1, (&mut [&mut recording], &mut [])).unwrap();
    recording.finish().unwrap();
    (folder, path)
}

const TOPIC: &str = "/osi/ground_truth";

/// Number of messages of OSI in a log.
fn osi_messages(path: &Path) -> usize {
    let mut bag = Bag::open(path).unwrap();
    let mut count = 0;
    while let Some(message) = bag.next_message().unwrap() {
        count += usize::from(bag.topics()[message.topic].name == TOPIC);
    }
    count
}

#[test]
fn osi_messages_change_neither_digest_nor_record() {
    let (_with, osi) = log_of("maps/light_red", &["log.osi=true"]);
    let (_plain, plain) = log_of("maps/light_red", &[]);
    let [of_osi, of_plain] = [&osi, &plain].map(|path| Log::read(path).unwrap());
    let digest = |log: &Log| log.end.as_ref().unwrap().digest;
    assert_eq!(digest(&of_osi), digest(&of_plain));
    let publications = |log: &Log| log.all_publications().cloned().collect::<Vec<_>>();
    assert_eq!(publications(&of_osi), publications(&of_plain));
    let states = of_osi.publications("world").count();
    assert!(states > 100);
    assert_eq!([osi_messages(&osi), osi_messages(&plain)], [states, 0]);
}

#[test]
fn several_egos_have_the_first_as_their_host() {
    let (_kept, path) = log_of("maps/two_egos", &["log.osi=true", "log.foxglove=false"]);
    let log = Log::read(&path).unwrap();
    let (messages, states) = (osi_messages(&path), log.publications("world.from_south").count());
    // Until the scenario is over for it.
    assert!(100 < messages && messages <= states, "{messages} of {states}");
}

/// `tests/readers/read_osi.py` compares with the record; `tests/readers/install` installs ASAM's packages.
#[test]
#[ignore = "a reader in Python"]
fn reader_of_asam_finds_the_states_of_the_record() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let python = root.join("target/readers/python/bin/python");
    if !python.exists() {
        return swerve_tests::skipped_without_tool("run tests/readers/install first");
    }
    for scenario in ["maps/light_red", "person_behind_truck", "maps/traffic"] {
        let (_kept, log) = log_of(scenario, &["log.osi=true"]);
        let read =
            Command::new(&python).arg(root.join("tests/readers/read_osi.py")).arg(&log).output().unwrap();
        let [said, complained] = [&read.stdout, &read.stderr].map(|text| String::from_utf8_lossy(text));
        assert!(read.status.success(), "{scenario}\n{said}\n{complained}");
    }
}

#[test]
fn message_about_a_log_of_another_version_names_both() {
    let mut start = RunStart { version: env!("CARGO_PKG_VERSION").into(), ..RunStart::default() };
    assert_eq!(of_version(&start), "");
    start.version = "0.1.0".into();
    let of_other = of_version(&start);
    assert!(
        of_other.starts_with(" of swerve 0.1.0; this is 0.2") && of_other.ends_with("upgrade.md"),
        "{of_other}"
    );
}
