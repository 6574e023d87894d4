//! Logs in Foxglove: topics and formats, read by third-party libraries.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Value, json};
use swerve::replay::replay;
use swerve_drive::{drive, read_scenario};
use swerve_foxglove::Figures;
use swerve_log::Log;
use swerve_stack::Setup;
use swerve_stack::config::Images;
use tempfile::TempDir;

use crate::common::{config, record, root, scenario_file, sets};

/// Two seconds of the street scenario.
fn short_street(folder: &Path) -> PathBuf {
    let text = std::fs::read_to_string(scenario_file("street")).unwrap();
    let short = text.replacen("[expect]", "[end]\ntimeout_s = 2.0\n\n[expect]", 1);
    assert_ne!(short, text);
    let file = folder.join("street.toml");
    std::fs::write(&file, short).unwrap();
    file
}

/// Columns and rows of the showcase's cameras, reduced, and their fields of view.
const CAMERAS: [(&str, u32, u32, f64); 6] = [
    ("front_left", 200, 150, 70.0),
    ("front_right", 200, 150, 70.0),
    ("left", 160, 90, 100.0),
    ("right", 160, 90, 100.0),
    ("rear", 160, 90, 100.0),
    ("above", 160, 90, 60.0),
];
const COLUMNS: u32 = 300;

/// The showcase with small images.
fn showcase(more: &[&str]) -> Setup {
    let sizes = CAMERAS.iter().flat_map(|(name, width, height, _)| {
        [format!("camera.{name}.width_px={width}"), format!("camera.{name}.height_px={height}")]
    });
    let all: Vec<String> = sizes
        .chain([format!("lidar.roof_lidar.params.columns={COLUMNS}")])
        .chain(more.iter().map(|set| (*set).to_owned()))
        .collect();
    let all: Vec<&str> = all.iter().map(String::as_str).collect();
    let file = root().join("configs/showcase.toml");
    Setup::load(Some(&file), &sets(&all)).unwrap_or_else(|problems| panic!("{problems:?}"))
}

/// A log of the short street.
fn log_of(config: &Setup) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.mcap");
    record(config, &short_street(folder.path()), &log, 1);
    (folder, log)
}

/// Topics of a log, with their schemas.
fn topics(log: &Path) -> BTreeSet<(String, String)> {
    let bytes = std::fs::read(log).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let schema = |c: &mcap::Channel<'_>| c.schema.as_ref().map_or_else(String::new, |s| s.name.clone());
    summary.channels.values().map(|channel| (channel.topic.clone(), schema(channel))).collect()
}

/// All texts in a layout that name a topic, including keys.
fn named(value: &Value, found: &mut BTreeSet<String>) {
    let mut take = |text: &str| {
        if text.starts_with('/') {
            found.insert(text.to_owned());
        }
    };
    match value {
        Value::String(text) => take(text),
        Value::Array(items) => items.iter().for_each(|item| named(item, found)),
        Value::Object(entries) => {
            entries.keys().for_each(|key| take(key));
            entries.values().for_each(|item| named(item, found));
        }
        _ => {}
    }
}

/// Panels named in the arrangement of a layout.
fn panels<'a>(layout: &'a Value, found: &mut BTreeSet<&'a str>) {
    match layout {
        Value::String(panel) => {
            found.insert(panel);
        }
        _ => ["first", "second"].iter().for_each(|side| panels(&layout[side], found)),
    }
}

fn check_layout(name: &str, log: &Path) {
    let text = std::fs::read_to_string(root().join("configs/foxglove").join(name)).unwrap();
    let layout: Value = serde_json::from_str(&text).unwrap();
    let (mut arranged, configured) = (BTreeSet::new(), layout["configById"].as_object().unwrap());
    panels(&layout["layout"], &mut arranged);
    assert_eq!(arranged, configured.keys().map(String::as_str).collect(), "{name}");
    let topics: BTreeSet<String> = topics(log).into_iter().map(|(topic, _)| topic).collect();
    let figures = format!("{:?}", Figures::default());
    let mut found = BTreeSet::new();
    named(&layout, &mut found);
    for path in &found {
        let (topic, field) = path.split_once('.').map_or((path.as_str(), None), |(t, f)| (t, Some(f)));
        assert!(topics.contains(topic), "{name}: the log has no topic {topic}, only {topics:?}");
        if let Some(field) = field {
            assert!(figures.contains(&format!(" {field}: ")), "{name}: {topic} has no field {field}");
        }
    }
    assert!(found.len() >= 10, "{name}: only {found:?}");
}

#[test]
fn layouts_name_topics_of_the_logs() {
    let (_folder, log) = log_of(&showcase(&["log.images=jpeg"]));
    check_layout("showcase.json", &log);
    let (_folder, log) = log_of(&config(&[]));
    check_layout("drive.json", &log);
}

#[test]
fn foxglove_data_affects_no_run_and_no_replay() {
    let (folder, with) = log_of(&showcase(&["log.images=jpeg"]));
    let shown = Log::read(&with).unwrap();
    let config = showcase(&["log.foxglove=false"]);
    let plain = folder.path().join("plain.mcap");
    let file = folder.path().join("street.toml");
    let outcome = record(&config, &file, &plain, 1);
    let plain_log = Log::read(&plain).unwrap();
    assert_eq!(shown.end.as_ref().unwrap().digest, outcome.digest);
    assert_eq!(shown.records.len(), plain_log.records.len());
    assert!(!topics(&plain).iter().any(|(topic, _)| topic.starts_with("/view")));
    assert!(topics(&with).iter().any(|(topic, _)| topic == "/view/front_left/image"));
    let tracker = "tracker";
    assert!(replay(&shown, tracker, &[], 1).unwrap().is_same());
    let unobserved = drive(&config, &read_scenario(&file).unwrap()).unwrap();
    assert_eq!(unobserved.digest, outcome.digest);
}

#[test]
fn jpeg_without_a_destination_is_refused() {
    let told = |set: &[&str]| Setup::load(None, &sets(set)).unwrap_err()[0].to_string();
    assert!(told(&["log.images=jpeg", "log.foxglove=false"]).contains("log.foxglove"));
    assert!(told(&["log.images=jpeg", "log.jpeg_quality=0"]).contains("expected 1 to 100"));
}

/// Folder where `tests/readers/install` puts the readers; `None`, with a printed reason, if it is missing.
fn readers() -> Option<PathBuf> {
    let folder = root().join("target/readers");
    let there = folder.join("python/bin/python").exists() && folder.join("node/node_modules/@mcap").exists();
    if !there {
        swerve_tests::skipped_without_tool("run tests/readers/install first");
    }
    there.then_some(folder)
}

fn run(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let (said, complained) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{command:?}\n{said}\n{complained}");
    said.into_owned()
}

/// Reads a log with both libraries, which must agree on its contents.
fn read_by_others(folder: &Path, log: &Path, expected: &Value) {
    let facts = log.with_extension("json");
    std::fs::write(&facts, expected.to_string()).unwrap();
    let scripts = root().join("tests/readers");
    let python = folder.join("python/bin/python");
    let said = run(Command::new(python).arg(scripts.join("read.py")).arg(log).arg(&facts));
    // Node looks for packages beside the script.
    let script = folder.join("node/read.mjs");
    std::fs::copy(scripts.join("read.mjs"), &script).unwrap();
    let said_too = run(Command::new("node").arg(script).arg(log));
    let read = |said: &str| -> String {
        let last = said.lines().last().unwrap_or_default();
        last.split_once(" read").map_or_else(|| panic!("{said}"), |(read, _)| read.to_owned())
    };
    assert_eq!(read(&said), read(&said_too));
}

#[test]
#[ignore = "readers in Python and JavaScript"]
fn other_libraries_read_every_message() {
    let Some(folder) = readers() else { return };
    for images in ["jpeg", "lossless"] {
        let config = showcase(&[&format!("log.images={images}")]);
        let raw_images_min = if config.log.images == Images::Lossless { 30 } else { 0 };
        let (_kept, log) = log_of(&config);
        let camera = |&(name, width_px, height_px, fov_deg): &(&str, u32, u32, f64)| {
            (name.to_owned(), json!({ "width_px": width_px, "height_px": height_px, "fov_deg": fov_deg }))
        };
        let cameras: serde_json::Map<String, Value> = CAMERAS.iter().map(camera).collect();
        let clouds = json!({ "/view/roof_lidar/points": { "points_min": 32 * COLUMNS, "rings": 64 } });
        let expected = json!({
            "cameras": cameras, "clouds": clouds, "annotations_min": 20, "raw_images_min": raw_images_min,
        });
        read_by_others(&folder, &log, &expected);
    }
}
