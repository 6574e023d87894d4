//! Replay of logs: unchanged, altered, under other settings, from damaged files.

use std::path::{Path, PathBuf};

use swerve::replay::replay;
use swerve_core::{Span, Time};
use swerve_flow::{Decision, DropReason};
use swerve_log::{Log, LogError, Record};
use swerve_msg::ObstacleList;
use tempfile::TempDir;

use crate::common::{config, record, scenario_file, sets};

/// A recorded run in which plans take time and overlap.
struct Recorded {
    folder: TempDir,
}

impl Recorded {
    fn of(scenario: &Path) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let config = config(&[
            "operator.planner.runtime={ normal_ms = [70, 20] }",
            "operator.planner.policy=\"pipelined(4, overtaking)\"",
        ]);
        record(&config, scenario, &folder.path().join("log.mcap"), 1);
        Self { folder }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("log.mcap")
    }

    fn log(&self) -> Log {
        Log::read(&self.path()).unwrap()
    }
}

#[test]
fn every_cut_verifies_on_any_number_of_threads() {
    let log = Recorded::of(&scenario_file("person_crossing")).log();
    for operator in ["tracker", "predictor", "planner", "controller"] {
        assert!(replay(&log, operator, &[], 1).unwrap().is_same(), "from {operator}");
    }
    assert!(replay(&log, "tracker", &[], 4).unwrap().is_same(), "4 threads");
}

#[test]
fn scenario_file_is_not_needed() {
    let elsewhere = tempfile::tempdir().unwrap();
    let file = elsewhere.path().join("gone.toml");
    std::fs::copy(scenario_file("person_crossing"), &file).unwrap();
    let recorded = Recorded::of(&file);
    drop(elsewhere);
    assert!(!file.exists());
    assert!(replay(&recorded.log(), "tracker", &[], 1).unwrap().is_same());
}

/// Flips the lowest bit of the payload's first full-length coordinate: still an obstacle list, but a different one.
fn flip_one_bit(payload: &[u8]) -> Option<Vec<u8>> {
    let read = |bytes: &[u8]| -> Option<ObstacleList> { ciborium::from_reader(bytes).ok() };
    let before = read(payload)?;
    (0..payload.len().saturating_sub(8)).filter(|&at| payload[at] == 0xfb).find_map(|at| {
        let mut flipped = payload.to_vec();
        flipped[at + 8] ^= 1;
        let after = read(&flipped)?;
        let moved = after.stamp == before.stamp && after.obstacles != before.obstacles;
        moved.then_some(flipped)
    })
}

#[test]
fn one_flipped_bit_in_a_sensor_message_is_detected() {
    let mut log = Recorded::of(&scenario_file("person_crossing")).log();
    let mut flipped = false;
    for record in &mut log.records {
        if let Record::Publication(p) = record
            && p.stream.operator == "obstacles"
            && let Some(payload) = flip_one_bit(&p.payload_cbor)
        {
            let bits: u32 =
                payload.iter().zip(p.payload_cbor.iter()).map(|(a, b)| (a ^ b).count_ones()).sum();
            assert_eq!(bits, 1);
            p.payload_cbor = payload.into();
            flipped = true;
            break;
        }
    }
    assert!(flipped, "no sensor message holds an obstacle");
    for operator in ["tracker", "planner"] {
        assert!(!replay(&log, operator, &[], 1).unwrap().is_same(), "from {operator}");
    }
}

#[test]
fn other_settings_differ_from_the_log_and_the_logged_ones_do_not() {
    let log = Recorded::of(&scenario_file("person_crossing")).log();
    let with = |set: &str| replay(&log, "planner", &sets(&[set]), 1).unwrap().is_same();
    assert!(!with("planning.planner=waypoint"));
    assert!(!with("operator.planner.runtime={ fixed_ms = 10 }"));
    assert!(with("planning.planner=fot"));
    let wrong = replay(&log, "planner", &sets(&["planning.planner=fott"]), 1);
    let message = wrong.err().map(|e| format!("{e:#}")).unwrap();
    assert!(message.contains("did you mean `fot`?"), "{message}");
}

#[test]
fn damaged_logs_are_one_error_that_names_the_file() {
    let recorded = Recorded::of(&scenario_file("person_crossing"));
    let whole = std::fs::read(recorded.path()).unwrap();
    let damaged = recorded.folder.path().join("damaged.mcap");
    let error = |bytes: &[u8]| {
        std::fs::write(&damaged, bytes).unwrap();
        Log::read(&damaged).expect_err("damaged on purpose")
    };
    for part in [0.0, 0.001, 0.3, 0.7, 0.999] {
        let cut = (part * whole.len() as f64) as usize;
        let error = error(&whole[..cut]);
        assert!(matches!(error, LogError::Damaged { .. } | LogError::Incomplete { .. }), "{error:?}");
        let message = error.to_string();
        assert!(message.contains("damaged.mcap") && message.lines().count() == 1, "cut at {cut}: {message}");
    }
    for part in [0.2, 0.5, 0.8] {
        let mut bytes = whole.clone();
        bytes[(part * whole.len() as f64) as usize] ^= 0x10;
        let message = error(&bytes).to_string();
        assert!(message.contains("damaged at byte") && message.lines().count() == 1, "{message}");
    }
}

/// Keys of all nested maps.
fn keys(value: &ciborium::Value, into: &mut std::collections::BTreeSet<String>) {
    match value {
        ciborium::Value::Map(entries) => entries.iter().for_each(|(key, value)| {
            into.extend(key.as_text().map(str::to_owned));
            keys(value, into);
        }),
        ciborium::Value::Array(values) => values.iter().for_each(|value| keys(value, into)),
        _ => {}
    }
}

#[test]
fn schemas_name_every_field_of_their_messages() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let config = config(&[
        "log.sensors=[\"gnss\", \"imu\", \"odometry\", \"collisions\", \"lane_invasions\", \"red_lights\", \"roof\", \"front\"]",
        "lidar.roof={ rate_hz = 1 }",
        "camera.front={ width_px = 64, height_px = 48, period_ms = 1000, outputs = [\"rgb\", \"depth\", \"semantic\", \"instance\"] }",
        "log.images=lossless",
    ]);
    record(&config, &scenario_file("person_crossing"), &path, 1);
    let mut streams = std::collections::BTreeSet::new();
    for record in Log::read(&path).unwrap().records {
        let Record::Publication(publication) = record else { continue };
        let (stream, form) = (&publication.stream.stream, &publication.stream.form);
        assert!(form.starts_with("payload = ") && !form.contains(" any"), "{stream}: {form}");
        let mut named = std::collections::BTreeSet::new();
        keys(&ciborium::from_reader(&*publication.payload_cbor).unwrap(), &mut named);
        for name in &named {
            assert!(
                name == "left_out" || form.contains(&format!("{name}: ")),
                "{stream}: no {name} in\n{form}"
            );
        }
        streams.insert(stream.clone());
    }
    assert!(streams.len() >= 18, "{streams:?}");
    let bytes = std::fs::read(&path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let of_decisions =
        summary.channels.values().find(|channel| channel.topic == "/swerve/decisions").unwrap();
    let schema = of_decisions.schema.as_ref().unwrap();
    let rules = core::str::from_utf8(&schema.data).unwrap();
    for decision in every_decision() {
        let written = ciborium::Value::serialized(&decision).unwrap();
        let mut named = std::collections::BTreeSet::new();
        keys(&written, &mut named);
        let name = written.as_map().unwrap()[0].1.as_text().unwrap().to_owned();
        let start = format!("{name} = {{ decision: \"{name}\", ");
        let rule = rules.lines().find(|line| line.starts_with(&start)).unwrap_or_else(|| panic!("{name}"));
        let fields: Vec<&str> = rule[start.len()..].split(": ").collect();
        let fields = fields.iter().rev().skip(1).map(|part| part.rsplit(' ').next().unwrap().to_owned());
        assert_eq!(fields.chain(["decision".to_owned()]).collect::<std::collections::BTreeSet<_>>(), named);
    }
}

/// One decision of each kind.
fn every_decision() -> [Decision; 9] {
    let (operator, stamp, at) = ("planner".to_owned(), Time::ZERO, Time::ZERO);
    [
        Decision::Begin { wall_clock: true },
        Decision::Arrival { operator: operator.clone(), stamp: None, at },
        Decision::RunTime { operator: operator.clone(), stamp, run_time: Span::from_ms(1) },
        Decision::Deadline { operator: operator.clone(), stamp, at, offers: 1 },
        Decision::Drop { operator: operator.clone(), stamp, at, reason: DropReason::Skipped },
        Decision::Stop { operator: operator.clone(), stamp, units: 1 },
        Decision::Lost { operator: operator.clone(), stamp, why: "gone".into() },
        Decision::Restarted { operator, stamp },
        Decision::End { at },
    ]
}

#[test]
fn truncated_log_is_replayed_up_to_its_last_complete_instant() {
    let recorded = Recorded::of(&scenario_file("person_crossing"));
    let whole = std::fs::read(recorded.path()).unwrap();
    for bytes in [whole.len() * 3 / 10, whole.len() * 7 / 10, whole.len() - 1] {
        std::fs::write(recorded.path(), &whole[..bytes]).unwrap();
        let (log, damage) = Log::salvage(&recorded.path()).unwrap();
        assert!(damage.is_some() && log.whole_until() > Time::ZERO);
        assert!(replay(&log, "tracker", &[], 1).unwrap().is_same(), "{bytes} bytes");
    }
}
