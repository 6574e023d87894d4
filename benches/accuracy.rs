//! Accuracy of perception, with a lower limit for each figure: held-out rendered streets by camera and lidar, and the
//! test limits for real images, rendered streets and other programs' results. Missing images are rendered first: some
//! minutes, once. `-- tests` prints only the figures of the tests; `-- drives` also runs the ladder study, which takes
//! an hour of two cores and can be resumed.

use std::path::Path;
use std::process::Command;

use swerve_benches::{Goal, Rows, is_asked_to_measure, print};
use swerve_learn::train::{HeldOut, held_out, lidar_cars};

const VISION: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../crates/swerve-vision");
/// Folder of the images.
const DATA: &str = concat!(env!("CARGO_TARGET_TMPDIR"), "/held_out");

/// Minimum of the best rung, by set and class.
const FLOORS: [(&str, &str, f64); 4] = [
    ("clear_noon", "pedestrian", 0.90),
    ("soft_rain_sunset", "pedestrian", 0.85),
    ("clear_noon", "car", 0.87),
    ("soft_rain_sunset", "car", 0.75),
];

/// Parses a table cell; 0 if it is not a number.
fn number(cell: &str) -> f64 {
    cell.parse().unwrap_or(0.0)
}

/// Rows of rung, set, class, AP50, objects.
fn detector(rows: &mut Rows) {
    let recipe = Path::new(VISION).join("detectors/street.toml");
    let table =
        held_out(HeldOut::Detector, &recipe, Path::new(DATA)).expect("the recipe is in the repository");
    for (set, class, floor) in FLOORS {
        let of = |row: &&Vec<String>| row[1] == set && row[2] == class;
        let best = table.iter().filter(of).max_by(|a, b| number(&a[3]).total_cmp(&number(&b[3])));
        let Some(row) = best else { continue };
        let what = format!("camera AP50, {set}, {class}, best rung");
        rows.row(&what, number(&row[3]), &format!("{} ({})", row[3], row[0]), Goal::Least(floor));
    }
    for row in table.iter().filter(|row| row[0] == "fastest") {
        let goal =
            if row[1] == "clear_noon" && row[2] == "pedestrian" { Goal::Least(0.55) } else { Goal::None };
        rows.row(
            &format!("camera AP50, {}, {}, rung fastest", row[1], row[2]),
            number(&row[3]),
            &row[3],
            goal,
        );
    }
}

/// Rows of set, mean overlap, overlap by class.
fn segmentation(rows: &mut Rows) {
    let recipe = Path::new(VISION).join("segmentations/street.toml");
    let table =
        held_out(HeldOut::Segmentation, &recipe, Path::new(DATA)).expect("the recipe is in the repository");
    let Some((head, sets)) = table.split_first() else { return };
    for row in sets {
        let cells = head.iter().zip(row).skip(1);
        for (what, cell) in cells.filter(|(what, _)| ["mean IoU", "road"].contains(&what.as_str())) {
            let floor = if what == "road" { 0.93 } else { 0.65 };
            rows.row(&format!("segmentation, {}, {what}", row[0]), number(cell), cell, Goal::Least(floor));
        }
    }
}

fn lidar(rows: &mut Rows) {
    let [one, sort, ab3dmot] = lidar_cars(6).expect("streets that can be driven");
    for (what, value, floor) in
        [("one sweep", one, 0.70), ("behind SORT", sort, 0.80), ("behind AB3DMOT", ab3dmot, 0.80)]
    {
        rows.row(&format!("lidar, cars, AP R40, {what}"), value, &format!("{value:.3}"), Goal::Least(floor));
    }
}

/// Tests with lower limits, by package; each prints lines of `floor: WHAT: FIGURE >= FLOOR`.
const TESTS: [(&str, &[&str]); 3] = [
    (
        "swerve-vision",
        &[
            "published_models_find_the_people_of_pets",
            "people_are_found_where_opencv_finds_them",
            "distances_to_a_wall",
            "real_pairs_are_matched_as_opencv_does",
            "lines_of_rendered_streets_are_where_their_paint_is",
            "both_lines_of_real_roads_are_where_people_see_them",
            "real_crops",
            "as_dlib_on_its_frames",
        ],
    ),
    ("swerve-perception", &["sort_makes_the_tracks_of_its_authors"]),
    ("swerve-tests", &["lights_are_told_as_they_are_from_15_to_40_m"]),
];

/// Parses a `floor:` line of a test.
fn floor(line: &str) -> Option<(&str, f64, &str, Goal)> {
    let (what, figures) = line.strip_prefix("floor: ")?.rsplit_once(": ")?;
    let (reads, floor) = figures.split_once(' ')?;
    let goal = match floor.split_once(' ')? {
        (">=", least) => Goal::Least(least.parse().ok()?),
        ("<=", most) => Goal::Most(most.parse().ok()?),
        _ => return None,
    };
    Some((what, reads.parse().ok()?, reads, goal))
}

/// Figures of the tests. A test without its data or peer program prints a note and gives no row.
fn tests(rows: &mut Rows) {
    for (package, names) in TESTS {
        let mut call = Command::new(env!("CARGO"));
        call.args(["test", "--locked", "--release", "-p", package, "--"]);
        call.args(names).args(["--include-ignored", "--nocapture", "--test-threads=1"]);
        let output = call.output().expect("cargo is there");
        let said = String::from_utf8_lossy(&output.stdout);
        for line in said.lines().map(|line| line.rsplit("... ").next().unwrap_or(line)) {
            if let Some((what, figure, reads, goal)) = floor(line) {
                rows.row(what, figure, reads, goal);
            } else if line.starts_with("skipped") {
                print(line);
            }
        }
        if !output.status.success() {
            print(&format!("{package}: {}", String::from_utf8_lossy(&output.stderr)));
        }
    }
}

/// Drives without contact, by perception: sensors only, and the emulated detector for comparison.
fn drives(rows: &mut Rows) -> anyhow::Result<()> {
    let study = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/studies/detector_ladder.toml");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("detector_ladder");
    let mut call = Command::new(env!("CARGO"));
    call.args(["run", "--locked", "--release", "-p", "swerve", "--", "study"]).arg(study);
    anyhow::ensure!(call.arg("--out").arg(&folder).status()?.success(), "the study was not driven");
    let table = std::fs::read_to_string(folder.join("cells.csv"))?;
    let mut counts: Vec<(&str, usize, usize)> = Vec::new();
    for line in table.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        // Names with a comma are quoted.
        let name = line.strip_prefix('"').and_then(|rest| rest.split('"').next()).unwrap_or(cells[0]);
        if counts.last().is_none_or(|last| last.0 != name) {
            counts.push((name, 0, 0));
        }
        let last = counts.last_mut().expect("it was put there");
        *last = (name, last.1 + usize::from(!cells.contains(&"collision")), last.2 + 1);
    }
    let theirs = counts.iter().find(|one| one.0 == "emulated D3").map_or(0.0, |one| one.1 as f64);
    for (name, clear, all) in counts {
        let goal = if ["fused", "ground"].contains(&name) { Goal::Least(theirs) } else { Goal::None };
        let what = format!("drives that touched nothing, {name}");
        rows.row(&what, clear as f64, &format!("{clear} of {all}"), goal);
    }
    Ok(())
}

fn main() -> anyhow::Result<()> {
    if !is_asked_to_measure() {
        return Ok(());
    }
    let asked = |what: &str| std::env::args().any(|argument| argument == what);
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "accuracy");
    tests(&mut rows);
    if !asked("tests") {
        detector(&mut rows);
        segmentation(&mut rows);
        lidar(&mut rows);
    }
    if asked("drives") {
        drives(&mut rows)?;
    }
    rows.finish();
    Ok(())
}
