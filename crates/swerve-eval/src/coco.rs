//! COCO's twelve box metrics (Lin et al. 2014), as computed by `pycocotools` 2.0.11.

use serde::Serialize;

use crate::average_precision::{AveragePrecision, Recalls};

/// Overlaps 0.50, 0.55, ... 0.95.
const THRESHOLDS: usize = 10;

/// Maximum number of detections per image, by score, for AR@1, AR@10 and all other metrics.
const FOUND_MAX: [usize; 3] = [1, 10, 100];

/// Area ranges, px²: all, small, medium, large.
const AREAS_PX2: [[f64; 2]; 4] = [[0.0, 1e10], [0.0, 1024.0], [1024.0, 9216.0], [9216.0, 1e10]];

/// One ground-truth object.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CocoTruth {
    /// Left, top, width, height, pixels.
    pub box_px: [f64; 4],
    /// Area of the object's pixels, px²; selects small, medium or large.
    pub area_px2: f64,
    /// True for a crowd, many objects in one box: it is not counted, and detections inside are not false positives.
    pub is_crowd: bool,
}

/// One detected box.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CocoFound {
    /// Left, top, width, height, pixels.
    pub box_px: [f64; 4],
    /// Confidence; higher is more certain. Not NaN.
    pub score: f64,
}

/// Accumulates images of one class, by ascending image id: of equal scores the earlier box comes first.
#[derive(Clone, PartialEq, Debug)]
pub struct CocoClass {
    /// Accumulators by area range and overlap.
    curves: Vec<[AveragePrecision; THRESHOLDS]>,
    /// True positives with at most [`FOUND_MAX`] detections per image, by that and overlap.
    right: [[u64; THRESHOLDS]; 3],
}

/// The twelve metrics, 0 to 1; `None` without ground-truth objects (`pycocotools`: -1).
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize)]
pub struct CocoMetrics {
    /// Average precision, mean over overlaps 0.50 to 0.95.
    pub ap: Option<f64>,
    /// Average precision at overlap 0.50.
    pub ap50: Option<f64>,
    /// Average precision at overlap 0.75.
    pub ap75: Option<f64>,
    /// Average precision of objects up to 32² pixels.
    pub ap_small: Option<f64>,
    /// Average precision of objects from 32² to 96² pixels.
    pub ap_medium: Option<f64>,
    /// Average precision of objects from 96² pixels.
    pub ap_large: Option<f64>,
    /// Average recall, mean over overlaps, with one detection per image.
    pub ar_1: Option<f64>,
    /// Average recall with ten detections per image.
    pub ar_10: Option<f64>,
    /// Average recall with a hundred detections per image.
    pub ar_100: Option<f64>,
    /// `ar_100` of objects up to 32² pixels.
    pub ar_small: Option<f64>,
    /// `ar_100` of objects from 32² to 96² pixels.
    pub ar_medium: Option<f64>,
    /// `ar_100` of objects from 96² pixels.
    pub ar_large: Option<f64>,
}

impl Default for CocoClass {
    fn default() -> Self {
        let curves = || core::array::from_fn(|k| AveragePrecision::new(overlap_min(k)));
        Self { curves: AREAS_PX2.iter().map(|_| curves()).collect(), right: [[0; THRESHOLDS]; 3] }
    }
}

impl CocoClass {
    /// Adds an image.
    pub fn image(&mut self, truth: &[CocoTruth], found: &[CocoFound]) {
        let mut found = found.to_vec();
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        found.truncate(FOUND_MAX[2]);
        let overlaps: Vec<Vec<f64>> =
            found.iter().map(|f| truth.iter().map(|t| overlap(f, t)).collect()).collect();
        for (area, curves) in AREAS_PX2.iter().zip(&mut self.curves) {
            let is_within = |px2: f64| px2 >= area[0] && px2 <= area[1];
            let wanted: Vec<bool> = truth.iter().map(|t| !t.is_crowd && is_within(t.area_px2)).collect();
            for (k, curve) in curves.iter_mut().enumerate() {
                let matches = matches(truth, &wanted, &overlaps, overlap_min(k).min(1.0 - 1e-10));
                let judge = |(f, matched): (&CocoFound, &Option<usize>)| match matched {
                    Some(t) => wanted[*t].then_some(true),
                    None => is_within(f.box_px[2] * f.box_px[3]).then_some(false),
                };
                let judged: Vec<Option<bool>> = found.iter().zip(&matches).map(judge).collect();
                if area == &AREAS_PX2[0] {
                    for (right, most) in self.right.iter_mut().zip(FOUND_MAX) {
                        right[k] += judged.iter().take(most).filter(|j| **j == Some(true)).count() as u64;
                    }
                }
                let count = wanted.iter().filter(|wanted| **wanted).count() as u64;
                curve.judged(found.iter().map(|f| f.score).zip(judged), count);
            }
        }
    }

    /// Metrics of this class alone.
    pub fn metrics(&self) -> CocoMetrics {
        let precision = |area: usize, k: usize| self.curves[area][k].value(Recalls::Coco101);
        let ap = |area: usize| mean((0..THRESHOLDS).map(|k| precision(area, k)));
        let ar = |area: usize| mean(self.curves[area].iter().map(AveragePrecision::recall));
        let wanted = self.curves[0][0].wanted();
        let few = |most: usize| {
            mean(self.right[most].iter().map(|right| (wanted > 0).then(|| *right as f64 / wanted as f64)))
        };
        CocoMetrics {
            ap: ap(0),
            ap50: precision(0, 0),
            ap75: precision(0, 5),
            ap_small: ap(1),
            ap_medium: ap(2),
            ap_large: ap(3),
            ar_1: few(0),
            ar_10: few(1),
            ar_100: ar(0),
            ar_small: ar(1),
            ar_medium: ar(2),
            ar_large: ar(3),
        }
    }
}

impl CocoMetrics {
    /// Mean over classes, for each metric over the classes that have it.
    pub fn mean(classes: &[Self]) -> Self {
        let of = |number: fn(&Self) -> Option<f64>| mean(classes.iter().map(number));
        Self {
            ap: of(|m| m.ap),
            ap50: of(|m| m.ap50),
            ap75: of(|m| m.ap75),
            ap_small: of(|m| m.ap_small),
            ap_medium: of(|m| m.ap_medium),
            ap_large: of(|m| m.ap_large),
            ar_1: of(|m| m.ar_1),
            ar_10: of(|m| m.ar_10),
            ar_100: of(|m| m.ar_100),
            ar_small: of(|m| m.ar_small),
            ar_medium: of(|m| m.ar_medium),
            ar_large: of(|m| m.ar_large),
        }
    }
}

fn overlap_min(k: usize) -> f64 {
    // NumPy's `linspace(0.5, 0.95, 10)`: the step is rounded, the end is not.
    if k + 1 == THRESHOLDS { 0.95 } else { 0.5 + k as f64 * ((0.95 - 0.5) / 9.0) }
}

/// Intersection over union; for a crowd, intersection over the area of the detection.
fn overlap(found: &CocoFound, truth: &CocoTruth) -> f64 {
    let ([fx, fy, fw, fh], [tx, ty, tw, th]) = (found.box_px, truth.box_px);
    let width = (fx + fw).min(tx + tw) - fx.max(tx);
    let height = (fy + fh).min(ty + th) - fy.max(ty);
    if !(width > 0.0 && height > 0.0) {
        return 0.0;
    }
    let shared = width * height;
    shared / if truth.is_crowd { fw * fh } else { fw * fh + tw * th - shared }
}

/// Ground-truth object matched by each detection: the unmatched counted one with the largest overlap, else one of the
/// others. Of equal overlaps the last one; a crowd can be matched repeatedly.
fn matches(
    truth: &[CocoTruth],
    wanted: &[bool],
    overlaps: &[Vec<f64>],
    overlap_min: f64,
) -> Vec<Option<usize>> {
    let mut is_taken = vec![false; truth.len()];
    let mut of = Vec::with_capacity(overlaps.len());
    for near in overlaps {
        let best = |counts: bool| {
            let free =
                (0..truth.len()).filter(|&t| wanted[t] == counts && (!is_taken[t] || truth[t].is_crowd));
            free.filter(|&t| near[t] >= overlap_min).max_by(|&a, &b| near[a].total_cmp(&near[b]))
        };
        let matched = best(true).or_else(|| best(false));
        if let Some(t) = matched {
            is_taken[t] = true;
        }
        of.push(matched);
    }
    of
}

fn mean(of: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let values: Vec<f64> = of.flatten().collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Deserialize)]
    struct Case {
        classes: Vec<Vec<Image>>,
        /// In the order of `CocoMetrics`; -1 for `None`.
        expected: [f64; 12],
    }

    #[derive(Deserialize)]
    struct Image {
        /// Left, top, width, height; area; true for a crowd.
        truth: Vec<([f64; 4], f64, bool)>,
        /// Left, top, width, height, and the score.
        found: Vec<([f64; 4], f64)>,
    }

    #[test]
    fn coco_metrics_match_pycocotools() {
        let text = include_str!("../../../tests/reference/perception_metrics/coco.json");
        let cases: Vec<Case> = serde_json::from_str(text).unwrap();
        assert!(cases.len() >= 12);
        for (k, case) in cases.iter().enumerate() {
            let classes: Vec<CocoMetrics> = case.classes.iter().map(|images| of(images).metrics()).collect();
            let metrics = serde_json::to_value(CocoMetrics::mean(&classes)).unwrap();
            let names =
                "ap ap50 ap75 ap_small ap_medium ap_large ar_1 ar_10 ar_100 ar_small ar_medium ar_large";
            for (name, expected) in names.split(' ').zip(case.expected) {
                let value = metrics[name].as_f64().unwrap_or(-1.0);
                assert!((value - expected).abs() < 1e-9, "case {k}, {name}: {value}, expected {expected}");
            }
        }
    }

    fn of(images: &[Image]) -> CocoClass {
        let mut class = CocoClass::default();
        for image in images {
            let truth: Vec<CocoTruth> = image
                .truth
                .iter()
                .map(|&(box_px, area_px2, is_crowd)| CocoTruth { box_px, area_px2, is_crowd })
                .collect();
            let found: Vec<CocoFound> =
                image.found.iter().map(|&(box_px, score)| CocoFound { box_px, score }).collect();
            class.image(&truth, &found);
        }
        class
    }

    #[test]
    fn metrics_are_none_without_ground_truth() {
        let mut class = CocoClass::default();
        class.image(&[], &[CocoFound { box_px: [0.0, 0.0, 9.0, 9.0], score: 1.0 }]);
        assert_eq!(class.metrics(), CocoMetrics::default());
        assert_eq!(CocoMetrics::mean(&[]), CocoMetrics::default());
    }
}
