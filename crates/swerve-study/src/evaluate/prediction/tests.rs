use clap::Parser;
use serde_json::Value;

use super::*;

#[derive(Parser)]
struct Cli {
    #[command(flatten)]
    args: PredictionArgs,
}

fn run(dir: &Path, more: &[&str]) -> anyhow::Result<String> {
    let dir = dir.to_string_lossy();
    let words = ["eval", &dir, "--format", "eth_ucy"].into_iter().chain(more.iter().copied());
    told(&Cli::try_parse_from(words)?.args)
}

/// Two who walk straight on, one of them past a gap, and one who turns by 2 m at the end.
fn recording(dir: &Path) {
    let mut text = String::new();
    for frame in 0..20 {
        text += &format!("{} 1 {} 0\n", 10 * frame, 0.5 * f64::from(frame));
        let aside = if frame == 19 { 2.5 } else { 0.0 };
        text += &format!("{} 2 {} {}\n", 10 * frame, 0.5 * f64::from(frame), 9.0 + aside);
        if frame != 9 {
            text += &format!("{} 3 0 {}\n", 10 * frame, 20.0 + 0.5 * f64::from(frame));
        }
    }
    std::fs::write(dir.join("walk.txt"), text).unwrap();
}

#[test]
fn errors_of_a_recording_are_told_by_file_and_step() {
    let dir = tempfile::tempdir().unwrap();
    recording(dir.path());
    let json = run(dir.path(), &["--predictor", "constant_velocity", "--json"]).unwrap();
    let report: Value = serde_json::from_str(&json).unwrap();
    let file = &report["files"][0];
    assert_eq!((&file["file"], &file["windows"]), (&"walk.txt".into(), &2.into()));
    let close =
        |at: &Value, value: f64| assert!((at.as_f64().unwrap() - value).abs() < 1e-9, "{at} is {value}");
    close(&file["fde_m"], 1.25);
    close(&file["ade_m"], 1.25 / 12.0);
    close(&file["missed"], 0.5);
    close(&file["coverage"][3], 0.5);
    close(&file["by_step"][11]["rms_m"], (2.5_f64 * 2.5 / 2.0).sqrt());
    close(&file["by_step"][11]["ahead_s"], 4.8);
    assert_eq!(file["timely"].as_array().unwrap().len(), 5 * 6, "0 to 4 s, six latencies; 4.5 s is within");
    close(&file["timely"][29]["error_m"], 1.25 * 0.25);
    close(&file["collisions"], 0.0);
    close(&file["by_step"][10]["missed"], 0.0);
    close(&file["by_step"][11]["missed"], 0.5);
    // One mode each is a mode of all: both are in one scene.
    close(&file["world"]["scenes"], 1.0);
    close(&file["world"]["min_fde_m"], 1.25);
    close(&file["world"]["missed"], 0.5);
    // All of them in a table; a single step after the present for who is cut short.
    let table = run(dir.path(), &["--protocol", "schoeller", "--observe", "2", "--predict", "4"]).unwrap();
    assert_eq!(table.lines().count(), 1 + PredictorName::ALL.len());
    assert!(table.lines().nth(2).unwrap().starts_with("constant_velocity"), "{table}");
}

/// Two who walk towards each other, until one steps aside: straight on they meet. And two who walk into each other.
#[test]
fn collisions_are_told_apart_from_those_that_happened() {
    let dir = tempfile::tempdir().unwrap();
    let mut text = String::new();
    for frame in 0..20 {
        let (at, aside) = (0.5 * f64::from(frame), f64::from(u8::from(frame > 7)));
        let rows = [(1, at, 0.0), (2, 9.5 - at, 2.0 * aside), (3, at, 20.0), (4, 9.5 - at, 20.0)];
        for (who, x, y) in rows {
            text += &format!("{} {who} {x} {y}\n", 10 * frame);
        }
    }
    std::fs::write(dir.path().join("meet.txt"), text).unwrap();
    let figures = |name: &str| -> Value {
        let json = run(dir.path(), &["--predictor", name, "--json"]).unwrap();
        serde_json::from_str::<Value>(&json).unwrap()["all"].take()
    };
    let straight = figures("constant_velocity");
    let of = |key: &str| straight[key].as_f64().unwrap();
    assert_eq!((of("collisions"), of("collisions_in_truth"), of("collisions_alone")), (1.0, 0.5, 0.5));
    // Modes of `mfp` go together, those of `imm` and `multipath` do not.
    assert_eq!(figures("mfp")["world"]["scenes"], 1);
    let best = |key: &str| figures("mfp")["world"][key].as_f64().unwrap();
    assert!(best("min_fde_m") <= best("fde_m") && best("min_fde_m") < best("brier_min_fde_m"));
    assert!(figures("imm")["world"].is_null() && figures("multipath")["world"].is_null());
}

#[test]
fn what_cannot_be_judged_is_said_in_one_line() {
    let dir = tempfile::tempdir().unwrap();
    let said = |more: &[&str]| run(dir.path(), more).unwrap_err().to_string();
    assert!(said(&[]).ends_with("expected files that end in .txt, found none"));
    assert!(said(&["--predictor", "oracle"]).contains("expected all or one of linear, constant_velocity"));
    std::fs::write(dir.path().join("a.txt"), "0 1 2 3\n0 1 x 3\n").unwrap();
    assert!(said(&[]).ends_with("a.txt:2: x: expected a number of at most 1000000, found `x`"));
    // Nobody for long enough is no error.
    std::fs::write(dir.path().join("a.txt"), "0 1 2 3\n").unwrap();
    assert!(run(dir.path(), &["--predictor", "imm"]).unwrap().lines().nth(1).unwrap().contains(" 0 "));
}
