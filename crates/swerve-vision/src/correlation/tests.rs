use swerve_geom::simd::both;
use swerve_tests::data_or_skip;

use super::*;
use crate::samples::Picture;

fn area([left, top, right, bottom]: [f64; 4]) -> Area {
    Area { middle: [(left + right) / 2.0, (top + bottom) / 2.0], size: [right - left, bottom - top] }
}

fn overlap(a: Area, b: Area) -> f64 {
    let shared: f64 = (0..2)
        .map(|axis| {
            let end = |area: Area, sign: f64| area.middle[axis] + sign * area.size[axis] / 2.0;
            (end(a, 1.0).min(end(b, 1.0)) - end(a, -1.0).max(end(b, -1.0))).max(0.0)
        })
        .product();
    shared / (a.size[0] * a.size[1] + b.size[0] * b.size[1] - shared)
}

#[test]
fn as_dlib_on_its_frames() {
    let Some(folder) = data_or_skip("perception/dlib/examples/video_frames") else { return };
    let boxes = include_str!("../../../../tests/reference/vision/correlation.json");
    let boxes: Vec<[f64; 4]> = serde_json::from_str(boxes).unwrap();
    let files = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path());
    let mut files: Vec<_> = files.filter(|path| path.extension().is_some_and(|e| e == "jpg")).collect();
    files.sort();
    assert_eq!(files.len(), boxes.len());
    let mut tracker = Correlation::new(&Picture::read(&files[0]).gray(), area(boxes[0])).unwrap();
    let overlaps: Vec<f64> = (1..files.len())
        .map(|at| overlap(tracker.follow(&Picture::read(&files[at]).gray()), area(boxes[at])))
        .collect();
    let mean = overlaps.iter().sum::<f64>() / overlaps.len() as f64;
    let least = overlaps.iter().copied().fold(1.0, f64::min);
    println!("overlap with dlib's boxes: mean {mean:.3}");
    println!("floor: correlation (DSST), least IoU with dlib's boxes: {least:.3} >= 0.8");
    assert!(least >= 0.8, "{least}");
}

#[test]
fn tracker_rejects_invalid_areas_and_accepts_uniform_images() {
    for size in [(0, 0), (1, 1), (40, 30)] {
        let told = Correlation::new(&Plane::new(size.0, size.1), area([1.0, 1.0, 5.0, 5.0]));
        assert!(told.unwrap_err().to_string().contains("expected at least 8 x 8 pixels"));
    }
    for level in [0, 255] {
        let image = Plane::from_pixels(40, 30, vec![level; 1200]).unwrap();
        let at = area([5.0, 5.0, 25.0, 20.0]);
        let mut tracker = Correlation::new(&image, at).unwrap();
        assert_eq!(tracker.follow(&image), at);
        let used = allocation_counter::measure(|| _ = tracker.follow(&image));
        assert_eq!(used.count_total, 0);
    }
}

#[test]
fn tracking_is_bit_identical_with_wide_vectors() {
    let image = |shift: usize| {
        let level = |at: usize| ((at % 120 + shift) * 37 % 91 + at / 120 * 53 % 83) as u8;
        Plane::from_pixels(120, 90, (0..120 * 90).map(level).collect()).unwrap()
    };
    let [wide, narrow] = both(|| {
        let mut tracker = Correlation::new(&image(0), area([40.0, 20.0, 70.0, 64.0])).unwrap();
        [1, 2, 4].map(|shift| tracker.follow(&image(shift)))
    });
    assert_eq!(wide, narrow);
}
