//! Pictures of all scenarios with their causal chains: no overlapping elements.

use std::path::{Path, PathBuf};

use swerve_drive::{Recording, RunInput, drive_pipeline, load, run_start, set_up, story};
use swerve_eval::Milestone;
use swerve_log::Recorder;
use swerve_report::story::Story;
use swerve_stack::pipeline::Pipeline;

use crate::Logged;

/// Actors that came within this distance are labelled, metres.
const NAMED_M: f64 = 4.0;

/// A text of a figure with its bounding box: left, top, right, bottom, pixels.
#[derive(Debug, PartialEq)]
struct Label {
    text: String,
    room: [f64; 4],
}

/// All texts of a figure except vertical ones, with the widths given in the figure.
fn labels(svg: &str) -> Vec<Label> {
    let mut labels: Vec<Label> = Vec::new();
    for line in svg.lines().filter(|line| line.starts_with("<text") && !line.contains("rotate(")) {
        let of = |name: &str| line.split(&format!("{name}=\"")).nth(1).unwrap().split('"').next().unwrap();
        let number = |name: &str| of(name).parse::<f64>().unwrap();
        let text = line.split('>').nth(1).unwrap().split('<').next().unwrap();
        let text = text.replace("&lt;", "<").replace("&amp;", "&");
        let (x, y, size) = (number(" x"), number(" y"), number("font-size"));
        let width = number("textLength");
        let left = match of("text-anchor") {
            "middle" => x - 0.5 * width,
            "end" => x - width,
            _ => x,
        };
        // The outline of a text is the same text again.
        let label = Label { text, room: [left, y - 0.72 * size, left + width, y + 0.15 * size] };
        if labels.last() != Some(&label) {
            labels.push(label);
        }
    }
    labels
}

/// Bounding box of each diamond of a track.
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

/// The numbers in a line of a figure after `name`.
fn numbers_after(line: &str, name: &str) -> Vec<f64> {
    let way = line.split(name).nth(1).unwrap().split('"').next().unwrap();
    way.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-'))
        .filter_map(|n| n.parse().ok())
        .collect()
}

/// The line segments of plans: start and end point.
fn plan_lines(svg: &str) -> Vec<[f64; 4]> {
    let is_plan = |line: &&str| {
        line.starts_with("<path")
            && line.contains("stroke-width=\"2\"")
            && line.contains("stroke-opacity=\"0.8\"")
    };
    let pieces = |line: &str| {
        let n = numbers_after(line, "d=\"");
        n.windows(4).step_by(2).map(|n| [n[0], n[1], n[2], n[3]]).collect::<Vec<_>>()
    };
    svg.lines().filter(is_plan).flat_map(pieces).collect()
}

/// The labels of the top view crossed by a plan line that no plate hides there.
fn struck_through<'a>(svg: &str, labels: &'a [Label]) -> Vec<&'a Label> {
    let plates: Vec<[f64; 4]> = svg
        .lines()
        .filter(|line| line.starts_with("<rect") && line.contains("fill-opacity=\"0.9\""))
        .map(|line| {
            let of = |name: &str| numbers_after(line, name)[0];
            let (x, y) = (of(" x=\""), of(" y=\""));
            [x, y, x + of(" width=\""), y + of(" height=\"")]
        })
        .collect();
    let plans = plan_lines(svg);
    let is_in = |r: &[f64; 4], [x, y]: [f64; 2]| x > r[0] && x < r[2] && y > r[1] && y < r[3];
    let crosses = |r: &[f64; 4], [ax, ay, bx, by]: &[f64; 4]| {
        (0..=40).map(|k| f64::from(k) / 40.0).any(|t| is_in(r, [ax + t * (bx - ax), ay + t * (by - ay)]))
    };
    let is_hidden = |r: &[f64; 4]| {
        plates.iter().any(|p| p[0] <= r[0] && p[1] <= r[1] + 1.0 && p[2] >= r[2] && p[3] >= r[3] - 1.0)
    };
    let is_struck =
        |label: &&Label| !is_hidden(&label.room) && plans.iter().any(|piece| crosses(&label.room, piece));
    // The numbers of plans are drawn on discs.
    let is_number = |label: &&Label| label.text.parse::<u32>().is_ok();
    labels.iter().filter(|label| !is_number(label)).filter(is_struck).collect()
}

/// True if a label is a time, such as `4.5` or `4.5 s`.
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
    let outcome = drive_pipeline(pipeline, config.seed, 1, &mut [&mut story, &mut recording]).unwrap();
    recording.finish().unwrap();
    // With its causal chain, as `swerve run` draws it.
    let why = Logged::read(&path, &swerve_stack::Registry::standard(), None).unwrap().why(&outcome.metrics);
    story.conclude(&outcome.metrics, Some(&why.unwrap()));
    let svg = swerve_report::story::draw(&story).svg();
    (story, svg)
}

/// All shipped scenarios, those of `scenarios/` beside this file, and those among the test data.
fn scenarios() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folders = ["scenarios", "scenarios/everyday", "crates/swerve-why/src/tests/scenarios"];
    let others = ["scenarios", "field/everyday", "field/scenarios"];
    let folders = folders.map(|folder| Some(root.join(folder))).into_iter();
    let mut files: Vec<PathBuf> = Vec::new();
    for folder in folders.chain(others.map(swerve_tests::data_or_skip)).flatten() {
        files.extend(std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()));
    }
    // The folders also contain studies. Among traffic, there is no place for the names of all.
    let is_other = |file: &Path| {
        let text = std::fs::read_to_string(file).unwrap();
        text.contains("[[axis]]") || text.contains("[traffic]")
    };
    files.retain(|file| file.extension().is_some_and(|e| e == "toml") && !is_other(file));
    files.sort();
    files
}

#[test]
fn labels_do_not_overlap_or_leave_the_picture_in_any_scenario() {
    let files = scenarios();
    assert!(files.len() >= 45, "{files:?}");
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
        let struck = struck_through(&svg, &labels);
        assert!(struck.is_empty(), "{}: struck through: {struck:?}", file.display());
        // Each step of the chain is labelled on the time axis or in the view; the end may come long after the car has
        // left the view.
        let steps = story.why.iter().flat_map(|why| &why.steps);
        for step in steps.filter(|step| step.what != Milestone::End) {
            let named = format!("{} {:.3} s", step.what.name().replace('_', " "), step.at_s);
            let is_told = labels.iter().any(|l| l.text.contains(&named) || l.text.ends_with("before this"));
            assert!(is_told, "{}: {named} has no label: {labels:?}", file.display());
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
        // The deciding actor is labelled in the picture.
        if let Some(hero) = story.metrics.as_ref().and_then(|m| m.deciding_actor()) {
            let said = format!("to {} ", hero.name);
            let hit = format!("with {} ", hero.name);
            let is_told = labels.iter().any(|l| l.text.contains(&said) || l.text.contains(&hit));
            assert!(is_told, "{}: {} has no label", file.display(), hero.name);
        }
    }
}

#[test]
fn picture_of_a_gate_stop_shows_the_stop_and_no_actor() {
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

/// The view shows a roundabout in full, not only the exit where a person stood.
#[test]
fn roundabout_is_in_view_as_a_whole() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/tests/scenarios/roundabout.toml");
    let (story, svg) = picture(&file, &[]);
    if let Some(folder) = std::env::var_os("SWERVE_STORY_DIR") {
        std::fs::write(Path::new(&folder).join("roundabout_alone.svg"), &svg).unwrap();
    }
    // 270 degrees of a circle of 20 m: the path through it, and so the view, is at least as wide as the circle, 40 m.
    let ego: Vec<(f64, f64)> = story.ego.iter().map(|ego| (ego.pose.x_m, ego.pose.y_m)).collect();
    let width = |of: fn(&(f64, f64)) -> f64| {
        let all = ego.iter().map(of);
        all.clone().fold(f64::NEG_INFINITY, f64::max) - all.fold(f64::INFINITY, f64::min)
    };
    assert!(width(|p| p.1) > 39.0, "the scenario has a roundabout");
    // The times along it are labelled: it takes 94 m at 6 m/s and more, from 12 s to 28 s.
    let labels = labels(&svg);
    for second in [15, 20, 25] {
        let text = format!("{second}.0 s");
        assert!(labels.iter().any(|label| label.text == text), "no {text}: {labels:?}");
    }
}
