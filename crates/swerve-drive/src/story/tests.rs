//! The pictures of all scenarios: nothing lies on anything else.

use std::path::{Path, PathBuf};

use swerve_eval::Milestone;
use swerve_log::Recorder;

use super::*;
use crate::load::{RunInput, load};
use crate::recording::{Recording, run_start, set_up};
use crate::why::Logged;

/// Whoever came as near as this is named, metres.
const NAMED_M: f64 = 4.0;

/// A text of a figure, with the room that it takes: left, top, right, bottom, pixels.
#[derive(Debug, PartialEq)]
struct Label {
    text: String,
    room: [f64; 4],
}

/// All texts of a figure but those that stand on end; letters of Helvetica are half as wide as they are high.
fn labels(svg: &str) -> Vec<Label> {
    let mut labels: Vec<Label> = Vec::new();
    for line in svg.lines().filter(|line| line.starts_with("<text") && !line.contains("rotate(")) {
        let of = |name: &str| line.split(&format!("{name}=\"")).nth(1).unwrap().split('"').next().unwrap();
        let number = |name: &str| of(name).parse::<f64>().unwrap();
        let text = line.split('>').nth(1).unwrap().split('<').next().unwrap();
        let text = text.replace("&lt;", "<").replace("&amp;", "&");
        let (x, y, size) = (number(" x"), number(" y"), number("font-size"));
        let each = if line.contains("font-weight") { 0.55 } else { 0.5 };
        let width = each * size * text.chars().count() as f64;
        let left = match of("text-anchor") {
            "middle" => x - 0.5 * width,
            "end" => x - width,
            _ => x,
        };
        // The rim of a text is the same text once more.
        let label = Label { text, room: [left, y - 0.72 * size, left + width, y + 0.15 * size] };
        if labels.last() != Some(&label) {
            labels.push(label);
        }
    }
    labels
}

/// The room of each diamond of a track.
fn diamonds(svg: &str) -> Vec<[f64; 4]> {
    let is_track = |line: &&str| line.contains("fill=\"#FFFFFF\" stroke=\"#7B3FA0\"");
    let room = |line: &str| {
        let way = line.split("d=\"").nth(1).unwrap().split('"').next().unwrap();
        let numbers = way.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-'));
        let n: Vec<f64> = numbers.filter_map(|n| n.parse().ok()).collect();
        [n[0], n[3], n[4], n[7]]
    };
    svg.lines().filter(is_track).map(room).collect()
}

fn meet(r: &[f64; 4], s: &[f64; 4]) -> bool {
    r[0] < s[2] && s[0] < r[2] && r[1] < s[3] && s[1] < r[3]
}

/// Whether a label is an instant, such as `4.5` or `4.5 s`.
fn is_time(label: &Label) -> bool {
    let text = label.text.strip_suffix(" s").unwrap_or(&label.text);
    text.contains('.') && text.parse::<f64>().is_ok()
}

fn picture(scenario: &Path, set: &[&str]) -> (Story, String) {
    let set = set.iter().map(|&set| set.to_owned()).collect();
    let input =
        RunInput { scenario: scenario.into(), config: Vec::new(), set, seed: None, allow_code: false };
    let (config, scenario) = load(&swerve_stack::Registry::standard(), &input).unwrap();
    let pipeline = Pipeline::build(&config, &scenario).unwrap();
    let mut story = story(&config, &scenario, &pipeline);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let mut recorder = Recorder::create(&path, &run_start(&config, &scenario, &input.scenario)).unwrap();
    set_up(&mut recorder, &config, &pipeline);
    let mut recording = Recording::new(recorder, pipeline.clock, pipeline.graph.stop_handle());
    let outcome = crate::drive_pipeline(pipeline, config.seed, 1, &mut [&mut story, &mut recording]).unwrap();
    recording.finish().unwrap();
    // With its chain, as `swerve run` draws it.
    let why = Logged::read(&path, &swerve_stack::Registry::standard()).unwrap().why(&outcome.metrics);
    story.conclude(&outcome.metrics, Some(&why.unwrap()));
    let svg = swerve_report::story::draw(&story).svg();
    (story, svg)
}

/// The scenarios of the house, those of `scenarios/` beside this file, and, where they lie beside the checkout, others.
fn scenarios() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folders = ["scenarios", "crates/swerve-drive/src/story/scenarios", "../shared/data/scenarios"];
    let mut files: Vec<PathBuf> = Vec::new();
    for folder in folders {
        match std::fs::read_dir(root.join(folder)) {
            Ok(entries) => files.extend(entries.map(|entry| entry.unwrap().path())),
            Err(_) => println!("skipped: {folder} is not there"),
        }
    }
    files.retain(|file| file.extension().is_some_and(|e| e == "toml"));
    files.sort();
    files
}

#[test]
fn no_label_lies_on_another_or_beyond_the_edge_in_any_scenario() {
    let files = scenarios();
    assert!(files.len() >= 12, "{files:?}");
    for file in files {
        let (story, svg) = picture(&file, &[]);
        if let Some(folder) = std::env::var_os("SWERVE_STORY_DIR") {
            let name = Path::new(file.file_stem().unwrap()).with_extension("svg");
            std::fs::write(Path::new(&folder).join(name), &svg).unwrap();
        }
        let number = |name: &str| -> f64 {
            svg.split(&format!("{name}=\"")).nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
        };
        let (width, height) = (number("width"), number("height"));
        let labels = labels(&svg);
        assert!(labels.len() > 20, "{}: {}", file.display(), labels.len());
        for (k, a) in labels.iter().enumerate() {
            let r = a.room;
            let is_within = r[0] >= 0.0 && r[1] >= 0.0 && r[2] <= width && r[3] <= height;
            assert!(is_within, "{}: {a:?} is beyond {width} x {height}", file.display());
            for b in &labels[..k] {
                assert!(!meet(&r, &b.room), "{}: {a:?} lies on {b:?}", file.display());
            }
        }
        // Each step of the chain is named, on the time axis or before it; the end may come when the car has long left
        // the view.
        let steps = story.why.iter().flat_map(|why| &why.steps);
        for step in steps.filter(|step| step.what != Milestone::End) {
            let named = format!("{} {:.3} s", step.what.name().replace('_', " "), step.at_s);
            let is_told = labels.iter().any(|l| l.text.contains(&named) || l.text.ends_with("before this"));
            assert!(is_told, "{}: {named} is not told: {labels:?}", file.display());
        }
        let tracks = diamonds(&svg);
        for label in labels.iter().filter(|label| is_time(label)) {
            let hidden = tracks.iter().find(|track| meet(track, &label.room));
            assert_eq!(hidden, None, "{}: {label:?} lies on a track", file.display());
        }
        for actor in story.metrics.iter().flat_map(|m| &m.actors).filter(|a| a.min_distance_m <= NAMED_M) {
            let is_named = labels.iter().any(|l| l.text.contains(&actor.name));
            assert!(is_named, "{}: no name of {}", file.display(), actor.name);
        }
        // What the story is about is in the picture, by its name.
        if let Some(hero) = story.metrics.as_ref().and_then(|m| m.deciding_actor()) {
            let said = format!("to {} ", hero.name);
            let hit = format!("with {} ", hero.name);
            let is_told = labels.iter().any(|l| l.text.contains(&said) || l.text.contains(&hit));
            assert!(is_told, "{}: {} is not told", file.display(), hero.name);
        }
    }
}

#[test]
fn where_the_gate_decided_the_picture_is_of_its_stop_and_of_no_actor() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/person_behind_truck.toml");
    let (_, svg) = picture(&file, &["gate.enabled=true", "gate.emergency_at_ms=2000"]);
    if let Some(folder) = std::env::var_os("SWERVE_STORY_DIR") {
        std::fs::write(Path::new(&folder).join("gate.svg"), &svg).unwrap();
    }
    let labels = labels(&svg);
    assert!(labels.iter().any(|label| label.text == "2.0 s"), "{labels:?}");
    assert!(labels.iter().all(|label| !label.text.contains("closest")), "{labels:?}");
    assert!(labels.iter().any(|label| label.text == "STOPPED"), "{labels:?}");
}
