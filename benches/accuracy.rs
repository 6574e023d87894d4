//! How well perception sees streets that it has not learnt from, each figure with its floor: the camera's detector on every
//! rung, the labels of pixels, cars by lidar. Images that are not there are rendered first: some minutes, once.

use std::path::Path;

use swerve_benches::{Goal, Rows, is_asked_to_measure};
use swerve_study::train::{HeldOut, held_out, lidar_cars};

const VISION: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../crates/swerve-vision");
/// Where the images are kept.
const DATA: &str = concat!(env!("CARGO_TARGET_TMPDIR"), "/held_out");

/// What the best rung is to reach at least: by set and class.
const FLOORS: [(&str, &str, f64); 4] = [
    ("clear_noon", "pedestrian", 0.90),
    ("soft_rain_sunset", "pedestrian", 0.85),
    ("clear_noon", "car", 0.87),
    ("soft_rain_sunset", "car", 0.75),
];

/// A number of a table; 0 where there is none.
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

fn main() {
    if !is_asked_to_measure() {
        return;
    }
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "accuracy");
    detector(&mut rows);
    segmentation(&mut rows);
    lidar(&mut rows);
    rows.finish();
}
