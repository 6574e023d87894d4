use clap::Parser;
use serde_json::Value;
use swerve_core::ParamError;
use swerve_geom::Pose2;
use swerve_msg::{PredictedPose, Prediction, PredictionList, Track};
use swerve_stack::{NamedPredictor, NoKeys, PredictorSetup};

use super::*;

#[derive(Parser)]
struct Cli {
    #[command(flatten)]
    args: PredictionArgs,
}

fn run(dir: &Path, more: &[&str]) -> anyhow::Result<String> {
    run_with(&Registry::standard(), dir, more)
}

fn run_with(registry: &Registry, dir: &Path, more: &[&str]) -> anyhow::Result<String> {
    let dir = dir.to_string_lossy();
    let words = ["eval", &dir, "--format", "eth_ucy"].into_iter().chain(more.iter().copied());
    text(&Cli::try_parse_from(words)?.args, registry)
}

/// Everybody goes on with the velocity of the track; without covariances.
struct Steady;

impl Predictor for Steady {
    fn predict(&mut self, tracks: &TrackList, horizon: &Horizon, _: Ground<'_>) -> PredictionList {
        let of = |track: &Track| {
            let pose = |k: i64| {
                let after = horizon.step * k;
                let point = track.pose.point() + track.velocity_mps * after.as_secs();
                let pose = Pose2::new(point.x_m, point.y_m, track.pose.heading_rad);
                PredictedPose { at: tracks.stamp + after, pose }
            };
            let path = (0..=horizon.steps as i64).map(pose).collect();
            let Track { id, kind, extent, .. } = *track;
            Prediction::single(id, kind, extent, path)
        };
        PredictionList {
            stamp: tracks.stamp,
            predictions: tracks.tracks.iter().map(of).collect(),
            joint: false,
        }
    }
}

impl NamedPredictor for Steady {
    const NAME: &'static str = "steady";
    type Params = NoKeys;

    fn defaults(_: PredictorSetup<'_>) -> NoKeys {
        NoKeys {}
    }

    fn with_params(_: NoKeys, _: PredictorSetup<'_>) -> Result<Self, ParamError> {
        Ok(Self)
    }
}

#[test]
fn predictor_without_covariances_has_distances_but_no_densities() {
    let dir = tempfile::tempdir().unwrap();
    recording(dir.path());
    let registry = Registry::standard().with_predictor::<Steady>();
    let json = run_with(&registry, dir.path(), &["--predictor", "steady", "--json"]).unwrap();
    let report: Value = serde_json::from_str(&json).unwrap();
    assert!((report["all"]["fde_m"].as_f64().unwrap() - 1.25).abs() < 1e-9, "{json}");
    assert!(report["all"]["nll"].is_null() && report["all"]["coverage"].is_null(), "{json}");
    let table = run_with(&registry, dir.path(), &["--predictor", "steady"]).unwrap();
    assert!(table.lines().nth(1).unwrap().trim_end().ends_with('-'), "{table}");
    let all = run_with(&registry, dir.path(), &[]).unwrap();
    assert_eq!(all.lines().count(), 2 + PredictorName::ALL.len(), "{all}");
}

/// Two pedestrians walk straight on, one of them with a missing frame, and a third turns aside by 2.5 m at the end.
fn recording(dir: &Path) {
    recording_at(dir, [0.0, 0.0], "");
}

/// The same recording around an origin, with a text in front.
fn recording_at(dir: &Path, [east, north]: [f64; 2], prefix: &str) {
    let mut text = prefix.to_owned();
    for frame in 0..20 {
        let along = 0.5 * f64::from(frame);
        text += &format!("{} 1 {} {north}\n", 10 * frame, east + along);
        let aside = if frame == 19 { 2.5 } else { 0.0 };
        text += &format!("{} 2 {} {}\n", 10 * frame, east + along, north + 9.0 + aside);
        if frame != 9 {
            text += &format!("{} 3 {east} {}\n", 10 * frame, north + 20.0 + along);
        }
    }
    std::fs::write(dir.join("walk.txt"), text).unwrap();
}

#[test]
fn figures_do_not_depend_on_utm_coordinates_or_a_byte_order_mark() {
    let (here, there) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    recording(here.path());
    // Multiples of 0.5 m, so that the tracks are equal to the last bit.
    recording_at(there.path(), [691_000.5, 5_335_000.0], "\u{feff}");
    for predictor in PredictorName::ALL {
        let figures = |dir: &tempfile::TempDir| -> Value {
            let json = run(dir.path(), &["--predictor", predictor.name(), "--json"]).unwrap();
            serde_json::from_str::<Value>(&json).unwrap()["all"].take()
        };
        let (here, there) = (figures(&here), figures(&there));
        for key in ["ade_m", "fde_m", "missed"] {
            let [here, there] = [&here, &there].map(|of| of[key].as_f64().unwrap());
            assert!((here - there).abs() < 1e-3, "{} {key}: {here} here, {there} there", predictor.name());
        }
    }
}

#[test]
fn errors_are_reported_by_file_and_step() {
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
    // Single modes are joint modes: both pedestrians are in one scene.
    close(&file["world"]["scenes"], 1.0);
    close(&file["world"]["min_fde_m"], 1.25);
    close(&file["world"]["missed"], 0.5);
    // All predictors in one table; a window of the `schoeller` protocol may end after fewer steps.
    let table = run(dir.path(), &["--protocol", "schoeller", "--observe", "2", "--predict", "4"]).unwrap();
    assert_eq!(table.lines().count(), 1 + PredictorName::ALL.len());
    assert!(table.lines().nth(2).unwrap().starts_with("constant_velocity"), "{table}");
}

/// Two pedestrians walk towards each other until one steps aside; a straight prediction collides. Two others collide.
#[test]
fn predicted_and_recorded_collisions_are_counted_separately() {
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
    // Modes of `mfp` are joint, those of `imm` and `multipath` are not.
    assert_eq!(figures("mfp")["world"]["scenes"], 1);
    let best = |key: &str| figures("mfp")["world"][key].as_f64().unwrap();
    assert!(best("min_fde_m") <= best("fde_m") && best("min_fde_m") < best("brier_min_fde_m"));
    assert!(figures("imm")["world"].is_null() && figures("multipath")["world"].is_null());
}

#[test]
fn unusable_recordings_are_reported_in_one_line() {
    let dir = tempfile::tempdir().unwrap();
    let said = |more: &[&str]| run(dir.path(), more).unwrap_err().to_string();
    assert!(said(&[]).ends_with("expected files that end in .txt, found none"));
    assert!(
        said(&["--predictor", "oracle"])
            .contains("expected \"all\" or one of \"linear\", \"constant_velocity\"")
    );
    std::fs::write(dir.path().join("a.txt"), "0 1 2 3\n0 1 x 3\n").unwrap();
    assert!(said(&[]).ends_with("a.txt:2: x: expected a number of at most 10000000, found `x`"));
    // A recording without long enough tracks is not an error.
    std::fs::write(dir.path().join("a.txt"), "0 1 2 3\n").unwrap();
    assert!(run(dir.path(), &["--predictor", "imm"]).unwrap().lines().nth(1).unwrap().contains(" 0 "));
}

/// A lane of 200 m, heading east.
const MAP: &str = "<commonRoad><lanelet id=\"1\">\
    <leftBound><point><x>0</x><y>2</y></point><point><x>200</x><y>2</y></point></leftBound>\
    <rightBound><point><x>0</x><y>-2</y></point><point><x>200</x><y>-2</y></point></rightBound>\
    </lanelet></commonRoad>";

/// Scenarios with one car each that drives east and drifts slowly to the left.
fn scenarios(dir: &Path) {
    let mut text = "scenario,id,type,length_m,width_m,step,x_m,y_m,heading_rad,speed_mps\n".to_owned();
    for (name, y_m) in [("A-1", 0.0), ("A-2", 30.0), ("B-1", 0.0)] {
        for step in 0..60 {
            let x_m = 20.0 + f64::from(step);
            text += &format!("{name},1,car,4.5,1.8,{step},{x_m},{},0,10\n", y_m + 0.01 * f64::from(step));
        }
    }
    std::fs::write(dir.join("drives.csv"), text).unwrap();
}

#[test]
fn recordings_get_lanes_of_maps_beside_them() {
    let dir = tempfile::tempdir().unwrap();
    scenarios(dir.path());
    let more =
        ["--format", "commonroad_csv", "--observe", "10", "--predict", "50", "--predictor", "lane_idm"];
    let report = || {
        let dir = dir.path().to_string_lossy().into_owned();
        let words = ["eval", &dir].into_iter().chain(more).chain(["--json"]);
        text(&Cli::try_parse_from(words)?.args, &Registry::standard())
    };
    let lanes = || serde_json::from_str::<Value>(&report().unwrap()).unwrap()["files"][0]["lanes"].clone();
    let counts = |own: u32, placed: u32, without: u32| serde_json::json!({ "own": own, "placed": placed, "without": without });
    assert_eq!(lanes(), counts(0, 0, 3));
    let maps = dir.path().join("maps");
    std::fs::create_dir(&maps).unwrap();
    std::fs::write(maps.join("A-1.xml"), MAP).unwrap();
    assert_eq!(lanes(), counts(1, 1, 1), "its own, one of the same site, none of there");
    std::fs::write(maps.join("A-3.xml"), MAP.replace("</lanelet>", "")).unwrap();
    let message = report().unwrap_err().to_string();
    assert!(message.contains("A-3.xml:1:207: "), "{message}");
    // Maps of other sites are not read.
    std::fs::rename(maps.join("A-3.xml"), maps.join("C-3.xml")).unwrap();
    assert_eq!(lanes(), counts(1, 1, 1));
}
