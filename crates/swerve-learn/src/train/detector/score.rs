//! Accuracy of a detector on unseen images, and calibration of its scores.

use rayon::prelude::*;
use swerve_eval::{AveragePrecision, Found, Recalls};
use swerve_geom::math;
use swerve_vision::acf::{Calibration, Detection, Rung, Weights, iou};

use super::labelled::Labelled;
use super::recipe::{Class, Learning, Recipe};
use super::scanners::Scanners;

/// Minimum overlap of boxes of the same object.
const OVERLAP: f64 = 0.5;

/// Detections in each image.
pub(super) fn detect(
    recipe: &Recipe,
    weights: &Weights,
    rung: &Rung,
    images: &[Labelled],
) -> anyhow::Result<Vec<Vec<Detection>>> {
    let scanners = Scanners::new(weights.clone(), rung.clone(), recipe.camera.as_ref());
    let look = |scanners: &mut Scanners, image: &Labelled| {
        let mut found = Vec::new();
        scanners.of(image.size()).detect(image.picture()?.rgb()?, &mut found)?;
        Ok(found)
    };
    images.par_iter().map_init(|| scanners.clone(), look).collect()
}

/// Average precision of a class at an overlap of 0.5 over COCO's recalls, and the number of objects.
pub(super) fn average_precision(
    found: &[Vec<Detection>],
    images: &[Labelled],
    (index, class): (usize, Class),
    learning: &Learning,
) -> (Option<f64>, u64) {
    let mut ap = AveragePrecision::new(OVERLAP);
    for (found, image) in found.iter().zip(images) {
        let (boxes, counts): (Vec<_>, Vec<_>) = image.wanted(class, learning).into_iter().unzip();
        let found: Vec<&Detection> = found.iter().filter(|one| one.class == index).collect();
        let one = |one: &&Detection| Found { score: one.score, counts: !image.is_ignored(class, one.bbox) };
        let scores: Vec<Found> = found.iter().map(one).collect();
        ap.frame(&scores, &counts, |f, w| iou(found[f].bbox, boxes[w]));
    }
    (ap.value(Recalls::Coco101), ap.wanted())
}

/// Scores of a class, each with true if correct; detections on objects that do not count are ignored.
pub(super) fn judged(
    found: &[Vec<Detection>],
    images: &[Labelled],
    (index, class): (usize, Class),
    learning: &Learning,
) -> Vec<(f64, bool)> {
    let mut judged = Vec::new();
    for (found, image) in found.iter().zip(images) {
        let wanted = image.wanted(class, learning);
        for one in found.iter().filter(|one| one.class == index) {
            let near = |counts: bool| {
                wanted.iter().any(|(bbox, own)| *own == counts && iou(*bbox, one.bbox) >= OVERLAP)
            };
            if near(true) || !near(false) && !image.is_ignored(class, one.bbox) {
                judged.push((one.score, near(true)));
            }
        }
    }
    judged
}

/// Fits a logistic function of the score by maximum likelihood (Platt 1999; Newton's method, with his targets).
pub(super) fn calibrate(judged: &[(f64, bool)]) -> Calibration {
    let right = judged.iter().filter(|(_, right)| *right).count() as f64;
    let wrong = judged.len() as f64 - right;
    let target = |is_right: bool| if is_right { (right + 1.0) / (right + 2.0) } else { 1.0 / (wrong + 2.0) };
    let mut fit = Calibration { slope: 0.5, offset: 0.0 };
    for _ in 0..50 {
        // A small ridge term, so that a solution exists even if all are right or all wrong.
        let (mut gradient, mut curvature) =
            ([1e-3 * (fit.slope - 0.5), 1e-3 * fit.offset], [1e-3, 0.0, 1e-3]);
        for &(score, is_right) in judged {
            let p = fit.probability(score);
            let (error, weight) = (p - target(is_right), p * (1.0 - p));
            gradient = [gradient[0] + error * score, gradient[1] + error];
            curvature =
                [curvature[0] + weight * score * score, curvature[1] + weight * score, curvature[2] + weight];
        }
        let [a, b, c] = curvature;
        let determinant = (a * c - b * b).max(1e-12);
        let step = [
            (c * gradient[0] - b * gradient[1]) / determinant,
            (a * gradient[1] - b * gradient[0]) / determinant,
        ];
        let length = math::hypot(step[0], step[1]).max(1.0);
        fit = Calibration {
            slope: (fit.slope - step[0] / length).max(1e-3),
            offset: fit.offset - step[1] / length,
        };
    }
    fit
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calibrated_probability_matches_frequency() {
        // Right in 1, 3, 5, 7 and 9 of 10 at scores of -2 to 2.
        let judged: Vec<(f64, bool)> =
            (0..500).map(|k| (f64::from(k % 5) - 2.0, k / 5 % 10 < 2 * (k % 5) + 1)).collect();
        let fit = calibrate(&judged);
        for (score, share) in [(-2.0, 0.1), (0.0, 0.5), (2.0, 0.9)] {
            assert!((fit.probability(score) - share).abs() < 0.04, "{score}: {}", fit.probability(score));
        }
        for one_kind in [vec![(1.0, true); 9], vec![(1.0, false); 9], Vec::new()] {
            let fit = calibrate(&one_kind);
            assert!(fit.slope > 0.0 && (0.0..=1.0).contains(&fit.probability(5.0)), "{fit:?}");
        }
    }
}
