use std::path::PathBuf;

use clap::Parser;
use serde_json::Value;
use tempfile::TempDir;

use super::*;

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    args: EvalArgs,
}

pub(super) struct Folder(TempDir);

impl Folder {
    pub(super) fn with(files: &[(&str, &str)]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Output of `swerve eval` for a command line in which `@` is the folder.
    pub(super) fn eval(&self, words: &str, as_json: bool) -> anyhow::Result<String> {
        let words = words.replace('@', &format!("{}/", self.0.path().display()));
        let json = as_json.then_some("--json");
        let line = Line::try_parse_from(std::iter::once("eval").chain(words.split(' ')).chain(json))?;
        Ok(output(&line.args, &swerve_stack::Registry::standard())?.0)
    }

    pub(super) fn numbers(&self, words: &str) -> Value {
        serde_json::from_str(&self.eval(words, true).unwrap()).unwrap()
    }

    /// Problem with which the command ends after its output.
    pub(super) fn problem(&self, words: &str) -> Option<String> {
        let place = format!("{}/", self.0.path().display());
        let words = words.replace('@', &place);
        let line = Line::try_parse_from(std::iter::once("eval").chain(words.split(' '))).unwrap();
        let (_, problem) = output(&line.args, &swerve_stack::Registry::standard()).unwrap();
        problem.map(|problem| problem.replace(&place, ""))
    }

    pub(super) fn error(&self, words: &str) -> String {
        let place = format!("{}/", self.0.path().display());
        format!("{:#}", self.eval(words, true).unwrap_err()).replace(&place, "")
    }
}

/// A pedestrian who moves 10 px per frame, in frames 1, 2 and 4.
const WALK: &str = "1,5,0,0,40,80,1\n2,5,10,0,40,80,1\n4,5,30,0,40,80,1\n";

#[test]
fn tracking_accepts_rows_in_any_order() {
    let back = "4,1,30,0,40,80,0.9,-1,-1,-1\n\n1,1,0.0,0,40,80\n2,1,10,0,40,80,0.4\n";
    let ignored = format!("{WALK}2,9,500,0,40,80,0\n");
    let folder = Folder::with(&[("gt.txt", &ignored), ("back.txt", back), ("empty.txt", "")]);
    let perfect = folder.numbers("tracking @gt.txt @back.txt");
    assert_eq!((&perfect["clear"]["mota"], &perfect["hota"]["hota"]), (&1.0.into(), &1.0.into()));
    assert_eq!(perfect["identity"]["true_positives"], 3);
    let nothing = folder.numbers("tracking @gt.txt @empty.txt");
    assert_eq!((&nothing["clear"]["mota"], &nothing["clear"]["false_negatives"]), (&0.0.into(), &3.into()));
    assert_eq!(nothing["identity"]["idp"], Value::Null);
    let ghosts = folder.numbers("tracking @empty.txt @back.txt");
    assert_eq!((&ghosts["clear"]["mota"], &ghosts["clear"]["false_positives"]), (&Value::Null, &3.into()));
    let neither = folder.numbers("tracking @empty.txt @empty.txt");
    assert_eq!((&neither["truth_boxes"], &neither["found_boxes"]), (&0.into(), &0.into()));
    let table = folder.eval("tracking @gt.txt @back.txt", false).unwrap();
    assert!(table.lines().any(|line| line.split_whitespace().eq(["clear.mota", "1.0000"])), "{table}");
}

#[test]
fn late_results_are_compared_with_the_later_truth() {
    let folder =
        Folder::with(&[("gt.txt", "1,5,0,0,40,80\n2,5,10,0,40,80\n3,5,20,0,40,80\n4,5,30,0,40,80\n")]);
    let timely = |anchor: &str| {
        let words = format!("tracking @gt.txt @gt.txt --runtime-ms 120 --anchor {anchor}");
        let clear = folder.numbers(&words)["clear"].clone();
        let overlap = clear["motp"].as_f64().map(|share| (share * 1e6).round() / 1e6);
        ["true_positives", "false_positives", "false_negatives"]
            .map(|name| clear[name].as_u64().unwrap())
            .into_iter()
            .map(|n| n as f64)
            .chain(overlap)
            .collect::<Vec<f64>>()
    };
    // The pedestrian is 20 px further after 200 ms, 10 px after 100 ms: overlaps of 20/60, too little for a match, and
    // of 30/50.
    assert_eq!(timely("start"), [0.0, 2.0, 2.0]);
    assert_eq!(timely("start --snap round"), [3.0, 0.0, 0.0, 0.6]);
    assert_eq!(timely("end"), [0.0, 2.0, 4.0]);
    assert_eq!(timely("end --snap round"), [3.0, 0.0, 1.0, 0.6]);
    assert_eq!(timely("end --period-ms 1000"), [3.0, 0.0, 1.0, 0.6]);
}

#[test]
fn wrong_rows_are_reported_with_their_line() {
    for (rows, says) in [
        (
            "1,5,0,0,40\n",
            "bad.txt:1: expected at least 6 columns between commas (frame,id,left,top,width,height), found 5",
        ),
        ("1,5,0,0,40,80\n\n2,5,x,0,40,80\n", "bad.txt:3: left: expected a finite number, found `x`"),
        ("1,5,0,NaN,40,80\n", "bad.txt:1: top: expected a finite number, found `NaN`"),
        ("0,5,0,0,40,80\n", "bad.txt:1: frame: expected a whole number from 1 to 10000000, found 0"),
        ("1.5,5,0,0,40,80\n", "bad.txt:1: frame: expected a whole number"),
        ("1,-1,0,0,40,80\n", "bad.txt:1: id: expected at least 0, found -1"),
        ("1,5,0,0,-40,80\n", "bad.txt:1: width: expected at least 0, found -40"),
        ("1,5,0,0,40,80\n1,5,9,0,40,80\n", "bad.txt:2: frame 1 has two boxes of identity 5, expected one"),
    ] {
        let folder = Folder::with(&[("gt.txt", WALK), ("bad.txt", rows)]);
        for words in ["tracking @gt.txt @bad.txt", "tracking @bad.txt @gt.txt"] {
            let error = folder.error(words);
            assert!(error.starts_with(says), "{error}\nexpected: {says}");
        }
    }
    let folder = Folder::with(&[("gt.txt", WALK)]);
    assert!(folder.error("tracking @none.txt @gt.txt").starts_with("none.txt: cannot be read"));
    assert!(folder.error("tracking @gt.txt @gt.txt --anchor end").contains("--runtime-ms"));
    std::fs::write(folder.path("bytes.txt"), b"1,5,0,0,40,80\n\xff").unwrap();
    assert_eq!(folder.error("tracking @gt.txt @bytes.txt"), "bytes.txt:2: expected text in UTF-8");
}

const COCO: &str = r#"{
 "images": [{"id": 7}, {"id": 3}],
 "categories": [{"id": 1, "name": "person"}, {"id": 2, "name": "car"}, {"id": 4, "name": "boat"}],
 "annotations": [
  {"id": 1, "image_id": 3, "category_id": 1, "bbox": [0, 0, 20, 40], "area": 800, "iscrowd": 0},
  {"id": 2, "image_id": 7, "category_id": 2, "bbox": [50, 50, 100, 100]}
 ]
}"#;

#[test]
fn coco_files_give_the_metrics_of_coco() {
    let found = r#"[{"image_id": 3, "category_id": 1, "bbox": [0, 0, 20, 40], "score": 0.9}]"#;
    let folder = Folder::with(&[("gt.json", COCO), ("found.json", found), ("none.json", "[]")]);
    let report = folder.numbers("detection @gt.json @found.json --format coco");
    assert_eq!((&report["all"]["ap"], &report["all"]["ap_small"]), (&0.5.into(), &1.0.into()));
    assert_eq!(
        (&report["classes"]["person"]["ar_1"], &report["classes"]["car"]["ar_1"]),
        (&1.0.into(), &0.0.into())
    );
    assert_eq!(report["classes"]["boat"]["ap"], Value::Null);
    assert_eq!(folder.numbers("detection @gt.json @none.json --format coco")["all"]["ap"], 0.0);
    let table = folder.eval("detection @gt.json @found.json --format coco", false).unwrap();
    assert!(
        table.lines().any(|l| l.split_whitespace().eq(["ap50", "0.5000", "-", "0.0000", "1.0000"])),
        "{table}"
    );
}

#[test]
fn wrong_coco_files_are_reported_with_their_place() {
    let one = |text: &str| format!("[\n {text}]");
    for (found, says) in [
        (String::new(), "bad.json:1: it ends too early"),
        (one("7"), "bad.json:2: [0]: expected an object with `image_id`"),
        (
            one(r#"{"image_id": 3, "category_id": 1, "bbox": [0, 0, 20, 40]}"#),
            "bad.json:2: [0].score: is missing",
        ),
        (
            one(r#"{"image_id": 3, "category_id": 1, "bbox": [0, NaN, 20, 40], "score": 1}"#),
            "bad.json:2: [0].bbox[1]: it is not JSON: expected value",
        ),
        (
            one(r#"{"image_id": 3, "category_id": 1, "bbox": [0, 0, -20, 40], "score": 1}"#),
            "bad.json:2: [0].bbox: expected a width",
        ),
        (
            one(r#"{"image_id": 4, "category_id": 1, "bbox": [0, 0, 20, 40], "score": 1}"#),
            "bad.json: [0].image_id: expected an image of gt.json, found 4",
        ),
        (
            one(r#"{"image_id": 3, "category_id": 1, "bbox": [0, 0, 20, 40], "score": NaN}"#),
            "bad.json:2: [0].score: it is not JSON: expected value",
        ),
    ] {
        let folder = Folder::with(&[("gt.json", COCO), ("bad.json", &found)]);
        let error = folder.error("detection @gt.json @bad.json --format coco");
        assert!(error.starts_with(says), "{error}\nexpected: {says}");
    }
}

#[test]
fn results_of_other_categories_do_not_count_and_are_noted() {
    let result = |category: u32, score: f64| {
        format!(r#"{{"image_id": 3, "category_id": {category}, "bbox": [0, 0, 20, 40], "score": {score}}}"#)
    };
    let alone = format!("[{}]", result(1, 0.4));
    // The others have higher scores at the same place.
    let others = format!("[{},{},{},{}]", result(9, 0.9), result(1, 0.4), result(9, 0.8), result(90, 1.0));
    let logits = format!("[{},{}]", result(1, 0.4), result(2, 7.5));
    let folder = Folder::with(&[
        ("gt.json", COCO),
        ("alone.json", &alone),
        ("others.json", &others),
        ("logits.json", &logits),
    ]);
    let all = |file: &str| folder.numbers(&format!("detection @gt.json @{file} --format coco"));
    assert_eq!(all("others.json")["all"], all("alone.json")["all"]);
    assert_eq!(all("alone.json")["notes"], Value::Null);
    let notes = all("others.json")["notes"].to_string();
    assert!(notes.contains("gt.json does not have are not evaluated: 9 (2), 90 (1)"), "{notes}");
    let notes = all("logits.json")["notes"].to_string();
    assert!(notes.contains("[1].score: expected 0 to 1, found 7.5 (1 such scores"), "{notes}");
    let table = folder.eval("detection @gt.json @others.json --format coco", false).unwrap();
    assert!(table.contains("9 (2), 90 (1)"), "{table}");
}

#[test]
fn byte_order_marks_are_skipped() {
    let mark = |text: &str| format!("\u{feff}{text}");
    let found = format!("{CAR} 0.9\n");
    let results = r#"[{"image_id": 3, "category_id": 1, "bbox": [0, 0, 20, 40], "score": 0.9}]"#;
    let (labels, found, coco, results, walk) =
        (mark(CAR), mark(&found), mark(COCO), mark(results), mark(WALK));
    let folder = Folder::with(&[
        ("gt/0.txt", &labels),
        ("det/0.txt", &found),
        ("gt.json", &coco),
        ("found.json", &results),
        ("walk.txt", &walk),
    ]);
    assert_eq!(folder.numbers("detection @gt @det --format kitti")[0]["r11"], 1.0 / 11.0);
    assert_eq!(folder.numbers("detection @gt.json @found.json --format coco")["all"]["ap"], 0.5);
    assert_eq!(folder.numbers("tracking @walk.txt @walk.txt")["clear"]["mota"], 1.0);
}

const CAR: &str = "Car 0.0 0 -1.5 100 100 200 160 1.5 1.6 4.0 1 1 20 0.1";

#[test]
fn kitti_folders_give_average_precision() {
    let (labels, found) = (format!("{CAR}\n"), format!("{CAR} 0.9\n"));
    let folder =
        Folder::with(&[("gt/000000.txt", &labels), ("det/000000.txt", &found), ("gt/readme.md", "")]);
    let report = folder.numbers("detection @gt @det --format kitti");
    let easy = &report[0];
    assert_eq!((&easy["class"], &easy["level"]), (&"car".into(), &"easy".into()));
    // One threshold of forty-one: with a single car only recall 0 is reached.
    assert_eq!((&easy["r11"], &easy["r40"]), (&(1.0 / 11.0).into(), &0.0.into()));
    assert_eq!(report[3]["r40"], Value::Null);
    assert!(folder.eval("detection @gt @det --format kitti", false).unwrap().contains("pedestrian"));
}

#[test]
fn kitti_results_of_other_types_do_not_count() {
    let found = format!("{CAR} 0.9\n{} 0.99\n", CAR.replace("Car", "Wheelbarrow"));
    let alone = format!("{CAR} 0.9\n");
    let folder = Folder::with(&[("gt/0.txt", CAR), ("det/0.txt", &found), ("alone/0.txt", &alone)]);
    let of = |found: &str| folder.numbers(&format!("detection @gt @{found} --format kitti"));
    assert_eq!(of("det"), of("alone"));
    // In the ground truth, an unknown type would otherwise go unnoticed.
    let error = folder.error("detection @det @det --format kitti");
    assert!(error.starts_with("det/0.txt:2: type: expected one of KITTI's, found `Wheelbarrow`"), "{error}");
}

#[test]
fn wrong_kitti_folders_are_reported_with_file_and_line() {
    for (found, says) in [
        (CAR.to_owned(), "det/0.txt:1: expected 16 columns (type truncated"),
        (format!("{CAR} 1\n{CAR} inf"), "det/0.txt:2: score: expected a finite number, found `inf`"),
        (
            format!("{CAR} 1").replace("Car", "Cra"),
            "det/0.txt:1: type: expected one of KITTI's, found `Cra`; did you mean `Car`?",
        ),
        (
            format!("{CAR} 1").replace("200 160", "90 160"),
            "det/0.txt:1: left top right bottom: expected edges in order",
        ),
    ] {
        let folder = Folder::with(&[("gt/0.txt", CAR), ("det/0.txt", &found)]);
        let error = folder.error("detection @gt @det --format kitti");
        assert!(error.starts_with(says), "{error}\nexpected: {says}");
    }
    let folder = Folder::with(&[("gt/0.txt", CAR), ("gt/1.txt", ""), ("det/0.txt", ""), ("none/readme", "")]);
    let error = folder.error("detection @gt @det --format kitti");
    assert_eq!(error, "det: expected a file 1.txt, as the other folder has one; it may be empty");
    assert!(
        folder
            .error("detection @none @det --format kitti")
            .ends_with("expected label files (.txt), found none")
    );
}

/// A square yard with two more walls and a post, or an endless corridor, as PLY files around an origin. The source is
/// the target moved by `by_m` along x.
fn clouds(is_corridor: bool, by_m: f64, [east, north]: [f64; 2]) -> Folder {
    let mut scene = Vec::new();
    let at = |k: i32| 0.2 * f64::from(k);
    for i in -100..=100 {
        for j in 0..20 {
            scene.push([at(i), at(5 * j) - 9.4, 0.0]);
            scene.extend([[at(i), -9.7, at(j)], [at(i), 9.6, at(j)]]);
            if !is_corridor {
                scene.extend([[-20.3, at(i).clamp(-9.7, 9.6), at(j)], [20.1, at(i).clamp(-9.7, 9.6), at(j)]]);
                scene.push([6.1 + 0.02 * at(i), 2.3, at(j)]);
            }
        }
    }
    let ply = |points: &[[f64; 3]], off_m: f64| {
        let mut text = format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nend_header\n",
            points.len()
        );
        points.iter().for_each(|[x, y, z]| text += &format!("{} {} {z}\n", x + east + off_m, y + north));
        text
    };
    let source: Vec<_> = scene.iter().filter(|point| point[0].abs() < 12.0).copied().collect();
    let truth = format!("1 0 0 {}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n", -by_m);
    Folder::with(&[
        ("target.ply", &ply(&scene, 0.0)),
        ("source.ply", &ply(if is_corridor { &source } else { &scene }, by_m)),
        ("three.ply", &ply(&scene[..3], 0.0)),
        ("truth.txt", &truth),
    ])
}

impl Folder {
    /// Report of `swerve eval registration`, and the reason for its exit code.
    fn registered(&self, source: &str, method: &str) -> anyhow::Result<(Value, Option<String>)> {
        let at = |name: &str| self.path(name).display().to_string();
        let words = ["eval", "registration", &at(source), &at("target.ply"), "--method", method];
        let more = ["--reference", &at("truth.txt"), "--json"];
        let line = Line::try_parse_from(words.into_iter().chain(more))?;
        let What::Registration(args) = &line.args.what else { panic!("registration was asked for") };
        let (text, problem) = registration::told(args)?;
        let report: Value = serde_json::from_str(&text)?;
        assert!(
            problem.as_deref().unwrap_or_default().ends_with(report["problem"].as_str().unwrap_or_default())
        );
        Ok((report, problem))
    }
}

#[test]
fn registration_does_not_depend_on_the_origin() {
    for origin in [[0.0, 0.0], [1000.0, -1000.0], [691_000.0, 5_335_000.0]] {
        let folder = clouds(false, 0.15, origin);
        for method in ["ndt", "ndt7", "icp"] {
            let (report, problem) = folder.registered("source.ply", method).unwrap();
            let [m, deg] = ["error_m", "error_deg"].map(|key| report[key].as_f64().unwrap());
            // With point-to-point matching, the point spacing of 0.2 m affects the result.
            let most_m = if method == "icp" { 0.05 } else { 0.02 };
            assert!(m < most_m && deg < 0.02, "{origin:?} {method}: {m} m, {deg}°");
            assert_eq!(problem, None, "{origin:?} {method}");
        }
    }
}

#[test]
fn unusable_registration_gives_its_reason() {
    for method in ["ndt", "ndt7", "icp"] {
        let corridor = clouds(true, 0.4, [0.0, 0.0]).registered("source.ply", method).unwrap().1;
        assert!(corridor.as_ref().is_some_and(|why| why.contains("degenerate: ")), "{method}: {corridor:?}");
        let far = clouds(false, 10.0, [0.0, 0.0]).registered("source.ply", method);
        let far = far.map_or_else(|error| Some(error.to_string()), |(_, problem)| problem);
        // At the wrong place the end walls match nothing, which may leave a direction undetermined.
        let is_said = |why: &String| why.contains("not converged") || why.contains("degenerate: ");
        assert!(far.as_ref().is_some_and(is_said), "{method}: {far:?}");
        let three = clouds(false, 0.0, [0.0, 0.0]).registered("three.ply", method);
        let three = three.map_or_else(|error| Some(error.to_string()), |(_, problem)| problem);
        let is_said = |why: &String| why.contains("degenerate: ") || why.contains("no match: too few");
        assert!(three.as_ref().is_some_and(is_said), "{method}: {three:?}");
    }
}
