use swerve_core::Rng;

use super::*;
use crate::shipped;

const GROUND: Ground = Ground { horizon_px: 48.0, focal_px: 120.0, height_m: 1.4 };
const SIZE: [usize; 2] = [160, 96];

/// Grey ground, blue sky and a red object in front; with the class index of each pixel.
fn picture(number: i64) -> (Vec<u8>, Vec<u8>) {
    let mut rng = Rng::keyed(7, "picture", &[number]);
    let (left, top) = (rng.below(120), 30 + rng.below(30));
    let class = |k: usize| {
        let (x, y) = (k % SIZE[0], k / SIZE[0]);
        if (left..left + 24).contains(&x) && (top..top + 28).contains(&y) { 2 } else { u8::from(y < 48) }
    };
    let classes: Vec<u8> = (0..SIZE[0] * SIZE[1]).map(class).collect();
    let noise = rng.below(40) as u8;
    let colour = |class: &u8| {
        [[90 + noise, 90, 90], [120, 150 + noise, 230], [200, 40, 30 + noise]][usize::from(*class)]
    };
    let rgb = classes.iter().flat_map(colour).collect();
    (rgb, classes)
}

fn blank() -> Weights {
    let classes =
        [("ground", 7), ("sky", 23), ("thing", 26)].map(|(name, id)| Class { name: name.into(), id });
    let tree = Tree { features: vec![0], thresholds: Vec::new(), leaves: vec![1, 0, 0] };
    Weights { source: "a test".into(), focal_px: GROUND.focal_px, classes: classes.into(), trees: vec![tree] }
}

/// Forest of four trees.
fn learnt() -> Weights {
    let mut segmenter = Segmenter::new(blank(), SIZE, GROUND);
    let (mut rows, mut labels) = (Vec::new(), Vec::new());
    for number in 0..6 {
        let (rgb, classes) = picture(number);
        segmenter.fill(Rgb::new(SIZE[0], SIZE[1], &rgb).unwrap()).unwrap();
        let [columns, lines] = segmenter.cells();
        for cell in (0..columns * lines).step_by(3) {
            let (x, y) = (cell % columns, cell / columns);
            segmenter.describe([x, y], &mut rows);
            labels.push(classes[(y * CELL_PX + 2) * SIZE[0] + x * CELL_PX + 2]);
        }
    }
    let weights = vec![16; labels.len()];
    let samples = Samples::new(&rows, labels, weights);
    let params = ForestParams { depth: 6, least: 0.002, one_of: 8, seed: 1 };
    Weights { trees: (0..4).map(|number| grow(&samples, 3, &params, number)).collect(), ..blank() }
}

fn labels(segmenter: &mut Segmenter, size: [usize; 2], rgb: &[u8]) -> Vec<u8> {
    let mut labels = vec![99; size[0] * size[1]];
    segmenter.segment(Rgb::new(size[0], size[1], rgb).unwrap(), &mut labels).unwrap();
    labels
}

/// Share of correctly labelled pixels.
fn right(found: &[u8], classes: &[u8]) -> f64 {
    let ids = [7, 23, 26];
    let same = found.iter().zip(classes).filter(|(id, class)| **id == ids[usize::from(**class)]).count();
    same as f64 / found.len() as f64
}

#[test]
fn segmenter_labels_unseen_images_at_any_focal_length() {
    let weights = learnt();
    for number in 100..106 {
        let (rgb, classes) = picture(number);
        let found = labels(&mut Segmenter::new(weights.clone(), SIZE, GROUND), SIZE, &rgb);
        assert!(right(&found, &classes) > 0.96, "{number}: {}", right(&found, &classes));
        // The same image with pixels half as large.
        let size = SIZE.map(|px| px * 2);
        let double = |of: &[u8], each: usize| -> Vec<u8> {
            let at = |k: usize| (k / size[0] / 2 * SIZE[0] + k % size[0] / 2) * each;
            (0..size[0] * size[1]).flat_map(|k| of[at(k)..at(k) + each].to_vec()).collect()
        };
        let ground = Ground { horizon_px: 96.0, focal_px: 240.0, ..GROUND };
        let found = labels(&mut Segmenter::new(weights.clone(), size, ground), size, &double(&rgb, 3));
        let share = right(&found, &double(&classes, 1));
        assert!(share > 0.95, "{number} at twice the size: {share}");
    }
}

#[test]
fn forest_training_is_deterministic() {
    let weights = learnt();
    let mut hasher = swerve_core::Hasher::new();
    hasher.bytes(&weights.write());
    assert_eq!(hasher.digest().to_string(), "e2d9419309eb4356", "other trees than on other machines");
    assert_ne!(weights.trees[0], weights.trees[1]);
}

#[test]
fn walk_compares_the_described_features() {
    let weights = learnt();
    let (rgb, _) = picture(3);
    let mut segmenter = Segmenter::new(weights.clone(), SIZE, GROUND);
    segmenter.fill(Rgb::new(SIZE[0], SIZE[1], &rgb).unwrap()).unwrap();
    let mut votes = Vec::new();
    segmenter.planes.vote(&segmenter.trees, &mut votes);
    let [columns, lines] = segmenter.cells();
    for cell in 0..columns * lines {
        let mut row = Vec::new();
        segmenter.describe([cell % columns, cell / columns], &mut row);
        let vote = |tree: &Tree| {
            let (mut node, before) =
                (0, |node: usize| tree.features[..node].iter().filter(|f| **f > 0).count());
            while let Some(feature) = tree.features[node].checked_sub(1) {
                let split = before(node);
                node = 2 * split + 1 + usize::from(row[usize::from(feature)] >= tree.thresholds[split]);
            }
            let leaf = node - before(node);
            [0, 1, 2].map(|class| u16::from(tree.leaves[leaf * 3 + class]))
        };
        for class in 0..3 {
            let sum: u16 = weights.trees.iter().map(|tree| vote(tree)[class]).sum();
            assert_eq!(votes[class * columns * lines + cell], sum, "cell {cell}, class {class}");
        }
    }
}

#[test]
fn segmenter_accepts_uniform_and_empty_images() {
    let weights = shipped::segmentation("street").unwrap().unwrap();
    let ids: Vec<u8> = weights.classes.iter().map(|class| class.id).collect();
    for size in [[0, 0], [1, 1], [3, 200], [4, 4], [5, 9], [64, 33], [200, 6]] {
        for value in [0, 255] {
            for focal_px in [1.0, 571.0, 1e6] {
                let ground = Ground { horizon_px: 0.5 * size[1] as f64, focal_px, height_m: 1.35 };
                let mut segmenter = Segmenter::new(weights.clone(), size, ground);
                let found = labels(&mut segmenter, size, &vec![value; size[0] * size[1] * 3]);
                assert!(found.iter().all(|id| ids.contains(id)), "{size:?} {value} {focal_px}");
            }
        }
    }
}

#[test]
fn segmenter_rejects_images_of_another_size() {
    let mut segmenter = Segmenter::new(blank(), [32, 24], GROUND);
    let told = segmenter.segment(Rgb::new(2, 1, &[0; 6]).unwrap(), &mut [0; 2]).unwrap_err().to_string();
    assert_eq!(told, "an image of 2 x 1 pixels, expected 32 x 24");
    let bytes = [0; 32 * 24 * 3];
    assert!(segmenter.segment(Rgb::new(32, 24, &bytes).unwrap(), &mut [0; 2]).is_err());
}

#[test]
fn segmenter_allocates_nothing_after_the_first_image() {
    let ((rgb, _), mut found) = (picture(1), vec![0; SIZE[0] * SIZE[1]]);
    for focal_px in [GROUND.focal_px, 100.0] {
        let mut segmenter = Segmenter::new(learnt(), SIZE, Ground { focal_px, ..GROUND });
        let mut look = || segmenter.segment(Rgb::new(SIZE[0], SIZE[1], &rgb).unwrap(), &mut found).unwrap();
        look();
        assert_eq!(allocation_counter::measure(look).count_total, 0);
    }
}

#[test]
fn invalid_forests_are_rejected_with_a_reason() {
    let weights = learnt();
    let good = weights.write();
    assert_eq!(Weights::read(&good).unwrap(), weights);
    let told = |bytes: &[u8]| Weights::read(bytes).unwrap_err().to_string();
    let foreign = "no weights of a segmentation: expected a file that begins with `SWERVSEG`";
    assert_eq!(told(&shipped::detector("street").unwrap().unwrap().write()), foreign);
    assert_eq!(told(&[]), foreign);
    assert_eq!(told(&[&good[..8], &[9], &good[9..]].concat()), "weights of version 9, expected 1");
    let mut rng = Rng::keyed(1, "damage", &[]);
    for _ in 0..100 {
        let mut bad = good.clone();
        let k = 9 + rng.below(bad.len() - 9);
        bad[k] ^= 1 << rng.below(8);
        assert!(told(&bad).starts_with("damaged weights"), "byte {k}");
        assert!(told(&good[..9 + rng.below(good.len() - 9)]).starts_with("damaged weights"));
    }
    // Well-formed, but with invalid content.
    let check = |change: fn(&mut Weights), expected: &str| {
        let mut weights = learnt();
        change(&mut weights);
        assert_eq!(told(&weights.write()), format!("weights that make no sense: {expected}"));
    };
    check(|w| w.focal_px = f64::NAN, "a focal length of at least 1 px expected");
    check(|w| w.classes.clear(), "1 to 8 classes expected");
    check(|w| w.trees.clear(), "1 to 16 trees expected");
    check(|w| w.trees[0].features[0] = 9999, "known features expected");
    check(|w| w.trees[0].features.truncate(2), "whole trees expected");
    check(|w| _ = w.trees[1].leaves.pop(), "whole trees expected");
    check(|w| w.trees[0].features.rotate_left(1), "trees from the root expected");
}
