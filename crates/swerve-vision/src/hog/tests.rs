use serde::Deserialize;
use swerve_geom::simd::both;

use super::*;
use crate::acf::iou;
use crate::svm;
use crate::video::Video;

#[derive(Deserialize)]
struct Frame {
    frame: usize,
    /// Left, top, width, height, score.
    found: Vec<[f64; 5]>,
}

#[test]
#[ignore = "OpenCV"]
fn people_are_found_where_opencv_finds_them() {
    let Some(video) = Video::open(5, 78, 11) else { return };
    let frames: Vec<Frame> =
        serde_json::from_str(include_str!("../../../../tests/reference/vision/hog_people.json")).unwrap();
    let (mut detector, mut found) = (HogDetector::new(LinearHog::people()), Vec::new());
    let (mut all, mut same, mut ours, mut worst) = (0, 0, 0, 0.0_f64);
    for Frame { frame, found: expected } in frames {
        let bytes = video.frame(frame);
        detector.detect(Rgb::new(video.size[0], video.size[1], &bytes).unwrap(), 0.0, &mut found);
        for &[left, top, width, height, sum] in &expected {
            let bbox = [left, top, width, height];
            let near = found.iter().filter(|one| iou(one.bbox, bbox) >= 0.95);
            let off = near.map(|one| (one.score - sum).abs()).fold(f64::INFINITY, f64::min);
            same += usize::from(off.is_finite());
            worst = if off.is_finite() { worst.max(off) } else { worst };
        }
        (all, ours) = (all + expected.len(), ours + found.len());
    }
    println!("{same} of {all} boxes, {ours} found; sums differ by {worst:.5} at most");
    println!("floor: HOG on vtest.avi, share of OpenCV's boxes: {:.3} >= 0.98", same as f64 / all as f64);
    assert!(all > 100 && same * 100 >= all * 98 && ours * 98 <= all * 100, "{same} of {all}, {ours} found");
}

/// Window with a bright bar at a given offset, vertical or horizontal.
fn bar(upright: bool, place: usize) -> Vec<u8> {
    let is_in = |x: usize, y: usize| (10 + place..16 + place).contains(if upright { &x } else { &y });
    (0..32 * 32).flat_map(|k| [if is_in(k % 32, k / 32) { 200 } else { 40 }; 3]).collect()
}

#[test]
fn hog_detects_the_shape_it_was_trained_on() {
    let cells = [4, 4];
    let features = LinearHog::features(cells);
    let empty = LinearHog { cells, weights: vec![0.0; features], offset: 0.0 };
    let mut detector = HogDetector::new(empty);
    let (mut samples, mut positive) = (Vec::new(), Vec::new());
    for place in 0..8 {
        for upright in [true, false] {
            let bytes = bar(upright, place);
            samples.extend(detector.describe(Rgb::new(32, 32, &bytes).unwrap()).unwrap());
            positive.push(upright);
        }
    }
    let linear =
        svm::train(features, &samples, &positive, &svm::SvmParams { cost: 1.0, ..Default::default() });
    let weights = linear.weights.iter().map(|w| *w as f32).collect();
    let mut detector = HogDetector::new(LinearHog { cells, weights, offset: linear.offset as f32 });
    // One vertical bar of a window's height, far from a horizontal one.
    let is_bright = |x: usize, y: usize| {
        (44..50).contains(&x) && (32..64).contains(&y) || (100..132).contains(&x) && (45..51).contains(&y)
    };
    let bytes: Vec<u8> =
        (0..160 * 96).flat_map(|k| [if is_bright(k % 160, k / 160) { 200 } else { 40 }; 3]).collect();
    let mut found = Vec::new();
    detector.detect(Rgb::new(160, 96, &bytes).unwrap(), 0.0, &mut found);
    let best = found.iter().max_by(|a, b| a.score.total_cmp(&b.score)).unwrap();
    assert!(iou(best.bbox, [31.0, 32.0, 32.0, 32.0]) > 0.4, "{best:?}");
}

#[test]
fn hog_accepts_uniform_and_empty_images() {
    let (mut detector, mut found) = (HogDetector::new(LinearHog::people()), Vec::new());
    for (size, value) in [([0, 0], 0), ([1, 1], 9), ([63, 200], 255), ([64, 128], 0), ([100, 140], 255)] {
        let bytes = vec![value; size[0] * size[1] * 3];
        detector.detect(Rgb::new(size[0], size[1], &bytes).unwrap(), 0.0, &mut found);
        assert!(found.is_empty(), "{size:?}: {found:?}");
    }
    assert!(detector.describe(Rgb::new(1, 1, &[0; 3]).unwrap()).is_none());
}

#[test]
fn hog_features_are_bit_identical_with_wide_vectors() {
    let bytes: Vec<u8> = (0..64 * 128 * 3).map(|k| (k * 37 % 91 + k / 192 * 53 % 83) as u8).collect();
    let [wide, narrow] = both(|| {
        let mut found = Vec::new();
        let mut detector = HogDetector::new(LinearHog::people());
        let window = Rgb::new(64, 128, &bytes).unwrap();
        detector.detect(window, f32::NEG_INFINITY, &mut found);
        (detector.describe(window), found)
    });
    assert!(!wide.1.is_empty());
    assert_eq!(wide, narrow);
}
