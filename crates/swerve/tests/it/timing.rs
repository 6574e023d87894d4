//! The engine against the reference model in `tests/reference/`: every publication of every stored pipeline.

use std::path::{Path, PathBuf};

use serde_json::Value;
use swerve_timing::{self, Pipeline, Publication};

/// Folder of the cases; `SWERVE_TIMING_CASES` names another one, for campaigns over pipelines that are not stored.
fn folder() -> PathBuf {
    match std::env::var_os("SWERVE_TIMING_CASES") {
        Some(folder) => folder.into(),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/reference/timing"),
    }
}

fn files() -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder()).expect("the folder of cases is there");
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.expect("a readable entry").path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "json"));
    files.sort();
    files
}

/// A publication in the form of the stored cases.
fn row(p: &Publication) -> Value {
    let ns = |stamp: &Option<swerve_core::Time>| Value::from(stamp.map(|t| t.ns()));
    let mut row = vec![
        p.operator.into(),
        ns(&p.stamp),
        p.watermark.ns().into(),
        p.visible_at.ns().into(),
        ns(&p.reused_from),
    ];
    if p.stamp.is_some() {
        row.push(p.reads.iter().map(ns).collect());
    }
    Value::Array(row)
}

fn published(pipeline: &Pipeline, threads: usize) -> Vec<Value> {
    let trace = swerve_timing::simulate(pipeline, 1, threads).expect("a checked pipeline runs");
    trace.publications.iter().map(row).collect()
}

/// The first publication that differs, with the preceding ones at the same instant.
fn difference(case: &Value) -> Option<String> {
    let toml = case["toml"].as_str().expect("a case holds its pipeline");
    let pipeline = swerve_timing::parse("case.toml", toml).expect("a stored pipeline is good");
    let expected = case["publications"].as_array().expect("a case holds what it publishes");
    let got = published(&pipeline, 1);
    let i = (0..expected.len().max(got.len())).find(|&i| expected.get(i) != got.get(i))?;
    let context: Vec<String> =
        expected[i.saturating_sub(4)..i].iter().map(|row| format!("    same {row}")).collect();
    let show = |rows: &[Value]| rows.get(i).map_or_else(|| "nothing".to_owned(), Value::to_string);
    let (want, have) = (show(expected), show(&got));
    Some(format!(
        "{}: publication {i}\n{}\n    want {want}\n    got  {have}\n{toml}",
        case["name"],
        context.join("\n")
    ))
}

#[test]
fn engine_matches_the_publications_of_the_reference_model() {
    let mut count = 0;
    let mut differences = Vec::new();
    for file in files() {
        let text = std::fs::read_to_string(&file).expect("a readable file");
        let cases: Vec<Value> = serde_json::from_str(&text).expect("a list of cases");
        count += cases.len();
        differences.extend(cases.iter().filter_map(difference));
    }
    assert!(count > 0, "no cases in {}", folder().display());
    let shown: Vec<&str> = differences.iter().take(5).map(String::as_str).collect();
    assert!(
        differences.is_empty(),
        "{} of {count} cases differ; the first:\n{}",
        differences.len(),
        shown.join("\n")
    );
    println!("{count} cases, none differs");
}
