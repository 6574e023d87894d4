use std::path::Path;
use std::sync::atomic::AtomicBool;

use swerve_stack::Registry;

use super::chart::Chart;
use super::score::{mean_iou, share_right};
use super::*;
use crate::Bench;
use crate::cells::{CellStore, Runner};

const CAMERA: &str =
    "set.camera.front = { at_m = [2.4, 0.0, 1.8], width_px = 160, height_px = 90, fov_deg = 90.0 }";
const DETECTOR: &str =
    "set = { perception.detector = \"efficientdet-d3@v100\", sensing.range_person_m = 125 }";

/// Study of a straight road of 40 m with 30 pedestrians.
fn bench(base: &str, timely: &str, axes: &str) -> anyhow::Result<Bench> {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("small.toml");
    let text = format!(
        "[base]\nscenario = \"person_crossing\"\n{base}\n[timely]\nlength_m = 40.0\nwalkers = 30\n{timely}\n{axes}"
    );
    std::fs::write(&file, text)?;
    Bench::open(&Registry::default(), &file, &[])
}

fn speeds(of: &str) -> String {
    format!("[[axis]]\nkey = \"ego.speed_mps\"\nvalues = [{of}]\n[[axis]]\nkey = \"seed\"\nvalues = [1]\n")
}

fn results(bench: &Bench) -> Vec<Option<CellResult>> {
    bench.study.cells.iter().map(|cell| Some(bench.run_cell(cell, None).unwrap())).collect()
}

/// Medians of a series at a run time, by cell.
fn medians(results: &[Option<CellResult>], series: &str, at: f64) -> Vec<f64> {
    let reading = |result: &CellResult| {
        let found = result.timely.iter().find(|r| r.series == series && r.at == at);
        let found = found.unwrap_or_else(|| panic!("{series} at {at}"));
        assert!(!found.values.is_empty(), "{series} at {at}");
        crate::curve::quartiles(found.values.clone())[1]
    };
    results.iter().flatten().map(reading).collect()
}

#[test]
fn truth_is_perfect_at_once_and_degrades_with_run_time_and_speed() {
    let timely = "measures = [\"miou\", \"ap50\"]\nrun_times_ms = [0, 20, 100]\njudge_ms = 200";
    let bench = bench(CAMERA, timely, &speeds("5, 20")).unwrap();
    let results = results(&bench);
    for series in ["mIoU start", "mIoU end", "AP50 start", "AP50 end"] {
        assert_eq!(medians(&results, series, 0.0), [1.0, 1.0], "{series}");
        let [soon, late] = [20.0, 100.0].map(|at| medians(&results, series, at));
        assert!(soon[0] > late[0] && soon[1] > late[1], "{series} over time: {soon:?} {late:?}");
        assert!(late[0] > late[1], "{series} over speed: {late:?}");
    }
    // With streaming, frames also wait for the processor.
    let [start, end] = ["mIoU start", "mIoU end"].map(|series| medians(&results, series, 100.0));
    assert!(start[1] >= end[1], "{start:?} {end:?}");
}

#[test]
fn forest_starts_below_truth_and_degrades_less_with_run_time() {
    let timely = "measures = [\"grouped_miou\", \"forest_miou\"]\nrun_times_ms = [0, 100]\njudge_ms = 400";
    let camera = CAMERA.replace("160", "640").replace("90,", "360,");
    let bench = bench(&camera, timely, &speeds("20")).unwrap();
    let results = results(&bench);
    let [truth, forest] = ["mIoU of 7 classes start", "mIoU of the forest start"]
        .map(|series| [0.0, 100.0].map(|at| medians(&results, series, at)[0]));
    assert_eq!(truth[0], 1.0);
    assert!(truth[1] > forest[1] && forest[0] > forest[1], "{truth:?} {forest:?}");
    assert!((0.4..0.95).contains(&forest[0]), "{forest:?}");
    assert!(truth[0] - truth[1] > forest[0] - forest[1], "{truth:?} {forest:?}");
}

#[test]
fn emulated_detector_and_trackers_degrade_with_run_time() {
    let timely =
        "measures = [\"detector_ap50\", \"sort\", \"bytetrack\"]\nof_published = [0, 1, 3]\njudge_ms = 50";
    let bench = bench(DETECTOR, timely, &speeds("8")).unwrap();
    let results = results(&bench);
    for series in ["detector AP50 start", "detector AP50 end", "MOTA SORT", "HOTA ByteTrack", "IDF1 SORT"] {
        let [now, soon, late] = [0.0, 1.0, 3.0].map(|at| medians(&results, series, at)[0]);
        assert!(now > soon && soon > late, "{series}: {now} {soon} {late}");
        assert!(now > 0.2 && now < 1.0, "{series}: {now}");
    }
}

#[test]
fn image_detector_degrades_with_its_measured_run_time() {
    let timely = "measures = [\"detector_ap50\"]\nof_published = [0, 4]\njudge_ms = 250\nwithin_m = 25";
    let rung = "config = \"camera_objects\"\nset.operator.camera_objects.rung = \"ground\"";
    let bench = bench(rung, timely, &speeds("10")).unwrap();
    let results = results(&bench);
    let [now, late] = [0.0, 4.0].map(|at| medians(&results, "detector AP50 start", at)[0]);
    assert!(now > late && (0.3..1.0).contains(&now), "{now} {late}");
}

#[test]
fn results_are_reproducible_and_stored() {
    let timely = "measures = [\"miou\", \"ap50\"]\nrun_times_ms = [10]\njudge_ms = 1000";
    let bench = bench(CAMERA, timely, &speeds("20")).unwrap();
    let first = results(&bench);
    assert_eq!(first, results(&bench));
    let out = tempfile::tempdir().unwrap();
    let (store, stop) = (CellStore::open(out.path()).unwrap(), AtomicBool::new(false));
    let runner = Runner { store: &store, threads: 1, shard: None, reports: false, stop: &stop };
    let kept = runner.run(&bench.study, |c| bench.fingerprint(c), |c, _| bench.run_cell(c, None)).unwrap();
    let again =
        runner.run(&bench.study, |c| bench.fingerprint(c), |_, _| unreachable!("it is kept")).unwrap();
    assert_eq!((&kept, &again), (&first, &first));
}

#[test]
fn charts_go_over_run_time_or_over_an_axis() {
    let timely = "measures = [\"detector_ap50\"]\nof_published = [0, 1]\njudge_ms = 200";
    let axes = "[[axis]]\nname = \"detector\"\nkey = \"perception.detector\"\n\
                values = [\"efficientdet-d0@v100\", \"efficientdet-d6@v100\"]\n";
    for (over, contests, points) in [("", 0, 2), ("over = \"speed_mps\"", 4, 2)] {
        let bench = bench("", &format!("{timely}\n{over}"), &format!("{axes}{}", speeds("10, 20"))).unwrap();
        let results = results(&bench);
        let chart = Chart::of(&bench.study, bench.study.timely.as_ref().unwrap(), &results);
        let (csv, text, svg) = (chart.csv(), chart.text(), chart.draw().svg());
        assert_eq!(text.matches("\nbest").count(), contests, "{text}");
        // Two anchors, two run times, two speeds, two detectors: one row each.
        assert_eq!(csv.lines().count(), 1 + 16, "{csv}");
        assert_eq!(svg.matches("fill-opacity=\"0.12\"").count(), 16 / points, "{svg}");
        assert!(text.contains("efficientdet-d6@v100"), "{text}");
    }
}

#[test]
fn wrong_tables_are_reported_with_their_line() {
    let good = "measures = [\"ap50\"]\nrun_times_ms = [0, 10]";
    for (timely, expected) in [
        ("measures = []\nrun_times_ms = [0]", "small.toml:7: timely.measures: expected at least one measure"),
        ("measures = [\"miu\"]\nrun_times_ms = [0]", "small.toml:7: timely.measures[0]: expected one of"),
        ("measures = [\"miou\"]", "timely.run_times_ms: expected numbers here or in `of_published`"),
        (
            "measures = [\"miou\"]\nrun_times_ms = [0, 0]",
            "small.toml:8: timely.run_times_ms: expected rising numbers",
        ),
        ("measures = [\"miou\"]\nrun_times_ms = [-1]", "expected rising numbers from 0 to 5000"),
        (&format!("{good}\njudge_ms = 0"), "small.toml:9: timely.judge_ms: expected 1 to 10000, found 0"),
        (&format!("{good}\nover = \"sped\""), "small.toml:9: timely.over: no axis of the name `sped`"),
        (&format!("{good}\nwalker = 3"), "did you mean `walkers`?"),
        (
            &format!("{good}\n[budget]\nmax_ms = 100"),
            "timely: not with budget, curve, plot, ranking or timely_prediction",
        ),
    ] {
        let error = bench(CAMERA, timely, &speeds("20")).err().map(|e| format!("{e:#}")).unwrap_or_default();
        assert!(error.contains(expected), "{timely}\n{error}");
    }
    for (base, timely, speed, expected) in [
        ("", good, "20", "camera: expected one camera to draw the images of, found 0"),
        (
            "",
            "measures = [\"sort\"]\nrun_times_ms = [0]",
            "20",
            "perception.detector: expected one to emulate",
        ),
        ("", "measures = [\"sort\"]\nof_published = [1]", "20", "`truth` has no published run time"),
        (CAMERA, good, "0", "ego.speed_mps: expected a speed above 0, found 0"),
    ] {
        let bench = bench(base, timely, &speeds(speed)).unwrap();
        let error = bench.run_cell(&bench.study.cells[0], None).unwrap_err();
        assert!(format!("{error:#}").contains(expected), "{timely}\n{error:#}");
    }
}

#[test]
fn overlaps_match_hand_counts() {
    // Road 7 and sidewalk 8: 2 of 3 and 0 of 1 pixels shared.
    assert_eq!(mean_iou(&[7, 7, 8, 0], &[7, 7, 7, 0]), Some((2.0 / 3.0 + 0.0) / 2.0));
    assert_eq!(mean_iou(&[0], &[0]), None);
    let (near, far) = ((1, [0.0, 0.0, 10.0, 10.0]), (2, [50.0, 0.0, 60.0, 10.0]));
    let moved = (1, [4.0, 0.0, 14.0, 10.0]);
    for (there, seen, share) in [
        (vec![near, far], vec![near, far], Some(1.0)),
        (vec![near, far], vec![moved, far], Some(0.5)),
        (vec![near], vec![], Some(0.0)),
        (vec![], vec![near], Some(0.0)),
        (vec![], vec![], None),
    ] {
        assert_eq!(share_right(&there, &seen), share, "{there:?} {seen:?}");
    }
}

#[test]
fn processor_takes_the_next_frame_when_it_is_free() {
    let frames: Vec<Time> = (0..8).map(|k| Time::from_ms(5 * k)).collect();
    for (after_ms, taken) in [(0, vec![0, 1, 2, 3, 4, 5, 6, 7]), (5, (0..8).collect()), (12, vec![0, 3, 6])] {
        assert_eq!(back_to_back(&frames, Span::from_ms(after_ms)), taken, "{after_ms}");
    }
}

#[test]
fn built_in_studies_are_valid() {
    for name in [
        "timely_segmentation",
        "timely_detection",
        "timely_speed",
        "detector_tradeoff",
        "tracker_tradeoff",
        "detector_tradeoff_rungs",
        "tracker_tradeoff_rungs",
    ] {
        let bench = Bench::open(&Registry::default(), Path::new(name), &[]).unwrap();
        assert!(bench.study.timely.is_some() && !bench.study.cells.is_empty(), "{name}");
    }
}
