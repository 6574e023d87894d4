mod published;

use swerve_core::Rng;
use swerve_geom::simd::both;

use super::*;
use crate::{Rgb, shipped};

/// Detector of bright 8-pixel squares on a dark background: one tree over lightness in and around a window of 8 cells.
fn squares() -> Weights {
    let feature = |x: u16, y: u16| 8 * y + x;
    let features = [
        feature(3, 3),
        feature(0, 3),
        feature(0, 4),
        feature(3, 0),
        feature(7, 3),
        feature(4, 7),
        feature(4, 4),
    ];
    // The left child means dark: the middle must be bright and its surroundings dark.
    let leaf = |k: usize| if k == 4 { 2.0 } else { -2.0 };
    let trees = Trees {
        depth: 3,
        features: [features[0], features[1], features[2], features[1], features[4], features[3], features[5]]
            .into(),
        thresholds: vec![0.25; 7],
        leaves: (0..8).map(leaf).collect(),
    };
    let model = Model {
        class: 0,
        cells: [8, 8],
        object_px: [8.0, 8.0],
        heights_m: [0.9, 1.1],
        scorer: Scorer::Trees(trees),
    };
    let rung = Rung {
        name: "all".into(),
        first_octave: 0,
        per_octave: 4,
        stride: 1,
        trees: 8,
        reject: 0.0,
        whole_every: 1,
        tolerance_rad: None,
        calibrations: vec![Calibration { slope: 1.0, offset: 0.0 }],
    };
    let low = Rung { name: "on the ground".into(), tolerance_rad: Some(0.02), ..rung.clone() };
    Weights {
        source: "by hand".into(),
        shrink: 2,
        decay: [0.0, 0.11, 0.11],
        filters: Vec::new(),
        classes: vec!["square".into()],
        models: vec![model],
        rungs: vec![low, rung],
        overlap: (0.4, Overlap::Union),
    }
}

/// Dark image with bright squares given by left, top and side.
fn image(width: usize, height: usize, bright: &[[usize; 3]]) -> Vec<u8> {
    let is_in = |x, y| bright.iter().any(|&[l, t, n]| (l..l + n).contains(&x) && (t..t + n).contains(&y));
    (0..width * height).flat_map(|k| [if is_in(k % width, k / width) { 220 } else { 10 }; 3]).collect()
}

fn found(
    weights: &Weights,
    rung: usize,
    size: [usize; 2],
    bytes: &[u8],
    ground: Option<Ground>,
) -> Vec<Detection> {
    let mut scanner = Scanner::new(weights.clone(), weights.rungs[rung].clone(), size, ground);
    let mut found = Vec::new();
    scanner.detect(Rgb::new(size[0], size[1], bytes).unwrap(), &mut found).unwrap();
    found
}

#[test]
fn scanner_finds_squares_of_any_size() {
    let wanted = [[40, 30, 8], [90, 60, 16], [30, 90, 23]];
    let bytes = image(160, 140, &wanted);
    let found = found(&squares(), 1, [160, 140], &bytes, None);
    for [left, top, side] in wanted.map(|square| square.map(|n| n as f64)) {
        let best = found.iter().map(|one| iou(one.bbox, [left, top, side, side])).fold(0.0, f64::max);
        assert!(best > 0.5, "{left}, {top}, {side}: {best}, {found:?}");
    }
    assert!(found.iter().all(|one| (0.5..=1.0).contains(&one.score)), "{found:?}");
}

#[test]
fn scanner_ignores_objects_off_the_ground() {
    // For a camera 1 m above the ground, a 1 m tall object on the ground reaches up to the horizon.
    let (on_ground, above) = ([40, 62, 16], [100, 30, 16]);
    let bytes = image(160, 140, &[on_ground, above]);
    let ground = Ground { horizon_px: 62.0, focal_px: 100.0, height_m: 1.0 };
    let seen = |found: &[Detection], [l, t, n]: [usize; 3]| {
        found.iter().any(|one| iou(one.bbox, [l, t, n, n].map(|n| n as f64)) > 0.5)
    };
    let (all, low) = (
        found(&squares(), 1, [160, 140], &bytes, None),
        found(&squares(), 0, [160, 140], &bytes, Some(ground)),
    );
    assert!(seen(&all, on_ground) && seen(&all, above), "{all:?}");
    assert!(seen(&low, on_ground) && !seen(&low, above), "{low:?}");
}

#[test]
fn look_near_restricts_detections_to_the_boxes() {
    let wanted = [[40, 30, 12], [90, 60, 16], [30, 90, 23]];
    let bytes = image(160, 140, &wanted);
    let mut scanner = Scanner::new(squares(), squares().rungs[1].clone(), [160, 140], None);
    let mut look = |boxes: Option<&[[f64; 4]]>| {
        let mut found = Vec::new();
        scanner.look_near(boxes);
        scanner.detect(Rgb::new(160, 140, &bytes).unwrap(), &mut found).unwrap();
        wanted.map(|square| {
            let [l, t, n] = square.map(|n| n as f64);
            found.iter().any(|one| iou(one.bbox, [l, t, n, n]) > 0.5)
        })
    };
    let off = |[l, t, n]: [usize; 3]| [l as f64 + 0.2 * n as f64, t as f64, n as f64, 1.15 * n as f64];
    assert_eq!(look(None), [true; 3]);
    assert_eq!(look(Some(&[])), [false; 3]);
    assert_eq!(look(Some(&[off(wanted[0])])), [true, false, false]);
    assert_eq!(look(Some(&[off(wanted[2]), off(wanted[1])])), [false, true, true]);
    // Far too large, far away, or NaN.
    let senseless = [[30.0, 20.0, 60.0, 60.0], [1e300, -1e300, 12.0, 12.0], [f64::NAN; 4]];
    assert_eq!(look(Some(&senseless)), [false; 3]);
    assert_eq!(look(None), [true; 3]);
}

/// Detector with a template of random weights.
fn template(cells: [usize; 2]) -> Weights {
    let mut rng = Rng::keyed(3, "template", &[]);
    let count = blocks::PLANES * cells[0] * cells[1];
    let weights = (0..count).map(|_| rng.normal() as f32).collect();
    let mut detector = squares();
    detector.models[0].cells = cells;
    detector.models[0].scorer = Scorer::Template(Template { weights, offset: 0.5 });
    detector
}

#[test]
fn template_scores_are_dot_products_over_windows() {
    let bytes: Vec<u8> = (0..121 * 90 * 3).map(|k| (k * 37 % 91 + k / 363 * 53 % 83) as u8).collect();
    for stride in 1..4 {
        let weights = template([6, 5]);
        let rung = Rung { stride, reject: f32::NEG_INFINITY, ..weights.rungs[1].clone() };
        let [wide, narrow] = both(|| {
            let mut scanner = Scanner::new(weights.clone(), rung.clone(), [121, 90], None);
            scanner.fill(Rgb::new(121, 90, &bytes).unwrap()).unwrap();
            let mut candidates = Vec::new();
            scanner.candidates(&mut candidates);
            (candidates, scanner)
        });
        assert_eq!(wide.0, narrow.0);
        assert!(wide.0.len() > 50);
        let (found, scanner) = wide;
        let Scorer::Template(template) = &weights.models[0].scorer else { unreachable!() };
        for level in 0..scanner.levels() {
            let [columns, lines] = scanner.places(0, level);
            for (column, line) in
                columns.step_by(stride).flat_map(|c| lines.clone().step_by(stride).map(move |l| (c, l)))
            {
                let candidate = Candidate { model: 0, level, at: [column, line], score: 0.0 };
                let mut bytes = Vec::new();
                scanner.features(&candidate, &mut bytes);
                let values = bytes.iter().map(|byte| (f32::from(*byte) + 0.5) * blocks::STEP);
                let about: f32 = template.weights.iter().zip(values).map(|(w, v)| w * v).sum::<f32>() + 0.5;
                let same = |one: &&Candidate| one.level == level && one.at == candidate.at;
                let one = found.iter().find(same).unwrap();
                assert!((one.score - about).abs() < 0.1, "{} {about}", one.score);
            }
        }
    }
}

#[test]
fn scanner_accepts_uniform_and_empty_images() {
    let weights = squares();
    for (size, value) in
        [([0, 0], 0), ([1, 1], 255), ([7, 3], 0), ([1, 400], 9), ([64, 48], 0), ([64, 48], 255)]
    {
        let bytes = vec![value; size[0] * size[1] * 3];
        for rung in 0..2 {
            let ground = Ground { horizon_px: 20.0, focal_px: 50.0, height_m: 1.0 };
            let found = found(&weights, rung, size, &bytes, Some(ground));
            assert!(found.is_empty(), "{size:?} {value}: {found:?}");
        }
    }
    // Also the shipped detectors, on uniform images.
    for name in shipped::names() {
        let weights = shipped::detector(name).unwrap().unwrap();
        let found = found(&weights, weights.rungs.len() - 1, [140, 130], &[255; 140 * 130 * 3], None);
        assert!(found.iter().all(|one| one.score.is_finite()));
    }
}

#[test]
fn scanner_rejects_images_of_another_size() {
    let mut scanner = Scanner::new(squares(), squares().rungs[1].clone(), [32, 24], None);
    let told = scanner.detect(Rgb::new(2, 1, &[0; 6]).unwrap(), &mut Vec::new()).unwrap_err().to_string();
    assert_eq!(told, "an image of 2 x 1 pixels, expected 32 x 24");
}

#[test]
fn scanner_keeps_no_state_of_the_previous_image() {
    let (one, other) = (image(96, 80, &[[20, 20, 12]]), image(96, 80, &[[60, 40, 9]]));
    let mut scanner = Scanner::new(squares(), squares().rungs[1].clone(), [96, 80], None);
    let mut look = |bytes: &[u8]| {
        let mut found = Vec::new();
        scanner.detect(Rgb::new(96, 80, bytes).unwrap(), &mut found).unwrap();
        found
    };
    let (first, second, third) = (look(&one), look(&other), look(&one));
    assert!(first == third && first != second && !first.is_empty());
}

#[test]
fn scanner_allocates_nothing_after_the_first_image() {
    let weights = shipped::detector("street").unwrap().unwrap();
    let bytes = image(320, 240, &[[20, 20, 12], [100, 90, 40]]);
    let ground = Ground { horizon_px: 120.0, focal_px: 230.0, height_m: 1.35 };
    for rung in &weights.rungs {
        let mut scanner = Scanner::new(weights.clone(), rung.clone(), [320, 240], Some(ground));
        let mut found = Vec::new();
        let mut look = || scanner.detect(Rgb::new(320, 240, &bytes).unwrap(), &mut found).unwrap();
        look();
        assert_eq!(allocation_counter::measure(look).count_total, 0, "{}", rung.name);
    }
}

#[test]
fn weights_survive_a_round_trip() {
    let weights = squares();
    assert_eq!(Weights::read(&weights.write()).unwrap(), weights);
    let linear = template([6, 4]);
    assert_eq!(Weights::read(&linear.write()).unwrap(), linear);
    for name in shipped::names() {
        let weights = shipped::detector(name).unwrap().unwrap();
        assert_eq!(Weights::read(&weights.write()).unwrap(), weights);
    }
}

#[test]
fn invalid_weights_are_rejected_with_a_reason() {
    let good = squares().write();
    let told = |bytes: &[u8]| Weights::read(bytes).unwrap_err().to_string();
    assert_eq!(
        told(b"\x89PNG\r\n\x1a\n and more"),
        "no weights of a detector: expected a file that begins with `SWERVDET`"
    );
    assert!(told(&[]).starts_with("no weights"));
    assert_eq!(told(&[&good[..8], &[9], &good[9..]].concat()), "weights of version 9, expected 2");
    let mut rng = Rng::keyed(1, "damage", &[]);
    for _ in 0..200 {
        let mut bad = good.clone();
        let k = 9 + rng.below(bad.len() - 9);
        bad[k] ^= 1 << rng.below(8);
        assert!(told(&bad).starts_with("damaged weights"), "byte {k}");
        assert!(told(&good[..9 + rng.below(good.len() - 9)]).starts_with("damaged weights"));
    }
    // Well-formed, but with invalid content.
    let check = |change: fn(&mut Weights), expected: &str| {
        let mut weights = squares();
        change(&mut weights);
        assert_eq!(told(&weights.write()), format!("weights that make no sense: {expected}"));
    };
    check(|w| trees(w).features[0] = 640, "features within the window expected");
    check(|w| w.models[0].class = 1, "models of the classes expected");
    check(|w| trees(w).leaves.truncate(5), "full trees expected");
    check(|w| trees(w).depth = 60, "trees of 1 to 8 levels expected");
    check(|w| w.rungs[0].whole_every = 0, "an image searched whole expected");
    check(|w| w.rungs[0].stride = 0, "a stride and trees of at least 1 expected");
    check(|w| trees(w).thresholds[0] = f32::NAN, "finite thresholds and leaves expected");
    check(|w| w.models.extend(template([6, 4]).models), "trees or templates alone expected");
    check(
        |w| {
            w.models = template([6, 4]).models;
            w.models[0].cells = [6, 5];
        },
        "finite weights of the window expected",
    );
}

fn trees(weights: &mut Weights) -> &mut Trees {
    match &mut weights.models[0].scorer {
        Scorer::Trees(trees) => trees,
        Scorer::Template(_) => unreachable!("squares are found by trees"),
    }
}
