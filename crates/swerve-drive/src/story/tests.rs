//! The pictures of all scenarios: nothing lies on anything else.

use std::path::{Path, PathBuf};

use super::*;
use crate::load::{RunInput, load};

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

fn picture(scenario: &Path) -> (Story, String) {
    let input = RunInput { scenario: scenario.into(), config: Vec::new(), set: Vec::new(), seed: None };
    let (config, scenario) = load(&swerve_stack::Registry::standard(), &input).unwrap();
    let pipeline = Pipeline::build(&config, &scenario).unwrap();
    let mut story = story(&config, &scenario, &pipeline);
    let outcome = crate::drive_pipeline(pipeline, config.seed, 1, &mut [&mut story]).unwrap();
    story.conclude(&outcome.metrics, None);
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
        let (story, svg) = picture(&file);
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
                let s = b.room;
                let meet = r[0] < s[2] && s[0] < r[2] && r[1] < s[3] && s[1] < r[3];
                assert!(!meet, "{}: {a:?} lies on {b:?}", file.display());
            }
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
