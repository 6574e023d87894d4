//! KITTI's average precision of image boxes (Geiger et al. 2012), by the rules of its development kit: at up to 41
//! score thresholds; similar classes, small boxes and unlabelled regions (DontCare) are ignored.
//!
//! [`crate::AveragePrecision`] uses every score as a threshold, which gives different results for few ground-truth
//! boxes.

use serde::{Deserialize, Serialize};

use crate::overlap::overlapping;

/// Number of recall steps between thresholds.
const STEPS: usize = 40;

/// Object type of a label, in KITTI's spelling.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[allow(missing_docs)]
pub enum KittiKind {
    Car,
    Van,
    Truck,
    Pedestrian,
    #[serde(rename = "Person_sitting")]
    PersonSitting,
    Cyclist,
    Tram,
    Misc,
    DontCare,
}

impl KittiKind {
    /// All types with their names.
    pub const ALL: [(&'static str, Self); 9] = [
        ("Car", Self::Car),
        ("Van", Self::Van),
        ("Truck", Self::Truck),
        ("Pedestrian", Self::Pedestrian),
        ("Person_sitting", Self::PersonSitting),
        ("Cyclist", Self::Cyclist),
        ("Tram", Self::Tram),
        ("Misc", Self::Misc),
        ("DontCare", Self::DontCare),
    ];
}

/// Evaluated class.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum KittiClass {
    /// Overlap above 0.7; a detected van is not a false positive.
    Car,
    /// Overlap above 0.5; a detected sitting person is not a false positive.
    Pedestrian,
    /// Overlap above 0.5.
    Cyclist,
}

/// Difficulty: limits on the visibility of boxes that count.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum KittiLevel {
    /// Higher than 40 px, fully visible, truncated by at most 0.15.
    Easy,
    /// Higher than 25 px, partly occluded, truncated by at most 0.30.
    Moderate,
    /// Higher than 25 px, hardly visible, truncated by at most 0.50.
    Hard,
}

/// A label.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct KittiTruth {
    /// Object type.
    pub kind: KittiKind,
    /// Share outside the image.
    pub truncation: f64,
    /// 0 fully visible, 1 partly, 2 largely occluded, 3 unknown.
    pub occlusion: f64,
    /// Left, top, right, bottom, pixels.
    pub box_px: [f64; 4],
}

/// A detected box.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct KittiFound {
    /// Detected type.
    pub kind: KittiKind,
    /// Left, top, right, bottom, pixels.
    pub box_px: [f64; 4],
    /// Confidence; higher is more certain.
    pub score: f64,
}

/// Average precision, 0 to 1; `None` without ground-truth boxes.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct KittiAp {
    /// Over recalls 0, 0.1, ... 1: used until October 2019.
    pub r11: Option<f64>,
    /// Over recalls 1/40, 2/40, ... 1: used since.
    pub r40: Option<f64>,
}

impl KittiClass {
    /// All classes, in KITTI's order.
    pub const ALL: [Self; 3] = [Self::Car, Self::Pedestrian, Self::Cyclist];

    const fn kind(self) -> KittiKind {
        match self {
            Self::Car => KittiKind::Car,
            Self::Pedestrian => KittiKind::Pedestrian,
            Self::Cyclist => KittiKind::Cyclist,
        }
    }

    const fn neighbour(self) -> Option<KittiKind> {
        match self {
            Self::Car => Some(KittiKind::Van),
            Self::Pedestrian => Some(KittiKind::PersonSitting),
            Self::Cyclist => None,
        }
    }

    const fn overlap_min(self) -> f64 {
        if matches!(self, Self::Car) { 0.7 } else { 0.5 }
    }
}

impl KittiLevel {
    /// All levels, easiest first.
    pub const ALL: [Self; 3] = [Self::Easy, Self::Moderate, Self::Hard];

    /// Minimum height, px; maximum occlusion; maximum truncation.
    const fn limits(self) -> (f64, f64, f64) {
        match self {
            Self::Easy => (40.0, 0.0, 0.15),
            Self::Moderate => (25.0, 1.0, 0.3),
            Self::Hard => (25.0, 2.0, 0.5),
        }
    }
}

/// One frame for one class and level.
struct Frame {
    /// For each ground-truth box of the class: true if it counts, and the detections that overlap it enough.
    truth: Vec<(bool, Vec<(usize, f64)>)>,
    found: Vec<Candidate>,
}

struct Candidate {
    score: f64,
    /// Tall enough to be a false positive.
    counts: bool,
    is_unlabelled: bool,
}

/// Average precision of a class at a level over frames of labels and detections.
pub fn kitti_ap(
    frames: &[(Vec<KittiTruth>, Vec<KittiFound>)],
    class: KittiClass,
    level: KittiLevel,
) -> KittiAp {
    let frames: Vec<Frame> =
        frames.iter().map(|(truth, found)| Frame::of(truth, found, class, level)).collect();
    let wanted = frames.iter().flat_map(|f| &f.truth).filter(|(counts, _)| *counts).count();
    if wanted == 0 {
        return KittiAp { r11: None, r40: None };
    }
    let mut precision = [0.0_f64; STEPS + 1];
    let scores = frames.iter().flat_map(Frame::right_scores).collect();
    for (place, score) in precision.iter_mut().zip(thresholds(scores, wanted)) {
        let counts = frames.iter().map(|frame| frame.count(score));
        let (right, wrong) = counts.fold((0, 0), |sum, (r, w)| (sum.0 + r, sum.1 + w));
        *place = if right + wrong > 0 { right as f64 / (right + wrong) as f64 } else { 0.0 };
    }
    for k in (0..STEPS).rev() {
        precision[k] = precision[k].max(precision[k + 1]);
    }
    let r11 = precision.iter().step_by(4).sum::<f64>() / 11.0;
    KittiAp { r11: Some(r11), r40: Some(precision[1..].iter().sum::<f64>() / STEPS as f64) }
}

impl Frame {
    fn of(truth: &[KittiTruth], found: &[KittiFound], class: KittiClass, level: KittiLevel) -> Self {
        let (height_min, occlusion_max, truncation_max) = level.limits();
        let height = |edges: [f64; 4]| edges[3] - edges[1];
        let concerns = |t: &&KittiTruth| t.kind == class.kind() || Some(t.kind) == class.neighbour();
        let truth_of_class: Vec<&KittiTruth> = truth.iter().filter(concerns).collect();
        let found: Vec<&KittiFound> = found
            .iter()
            // Boxes below the minimum height are ignored, whatever their type.
            .filter(|f| f.kind == class.kind() || height(f.box_px) < height_min)
            .collect();
        let boxes: Vec<[f64; 4]> = truth_of_class.iter().map(|t| t.box_px).collect();
        let mut near = vec![Vec::new(); boxes.len()];
        for (t, f, iou) in overlapping(&boxes, &found.iter().map(|f| f.box_px).collect::<Vec<_>>()) {
            if iou > class.overlap_min() {
                near[t].push((f, iou));
            }
        }
        let counts = |t: &KittiTruth| {
            t.kind == class.kind()
                && t.occlusion <= occlusion_max
                && t.truncation <= truncation_max
                && height(t.box_px) > height_min
        };
        let unlabelled: Vec<[f64; 4]> =
            truth.iter().filter(|t| t.kind == KittiKind::DontCare).map(|t| t.box_px).collect();
        let candidate = |f: &&KittiFound| Candidate {
            score: f.score,
            counts: height(f.box_px) >= height_min,
            is_unlabelled: unlabelled.iter().any(|region| share_in(f.box_px, *region) > class.overlap_min()),
        };
        Self {
            truth: truth_of_class.iter().map(|t| counts(t)).zip(near).collect(),
            found: found.iter().map(candidate).collect(),
        }
    }

    /// Scores of the true positives when each label takes the highest score.
    fn right_scores(&self) -> Vec<f64> {
        let mut is_taken = vec![false; self.found.len()];
        let mut scores = Vec::new();
        for (counts, near) in &self.truth {
            let mut best: Option<usize> = None;
            for &(f, _) in near.iter().filter(|(f, _)| !is_taken[*f]) {
                if best.is_none_or(|b| self.found[f].score > self.found[b].score) {
                    best = Some(f);
                }
            }
            let Some(f) = best else { continue };
            is_taken[f] = true;
            if *counts && self.found[f].counts {
                scores.push(self.found[f].score);
            }
        }
        scores
    }

    /// True and false positives among the detections of at least this score.
    fn count(&self, score_min: f64) -> (u64, u64) {
        let is_sure = |f: usize| self.found[f].score >= score_min;
        let mut is_taken = vec![false; self.found.len()];
        let mut right = 0;
        for (counts, near) in &self.truth {
            let free = || near.iter().filter(|(f, _)| is_sure(*f) && !is_taken[*f]);
            let mut best: Option<(usize, f64)> = None;
            for &(f, iou) in free().filter(|(f, _)| self.found[*f].counts) {
                if best.is_none_or(|(_, most)| iou > most) {
                    best = Some((f, iou));
                }
            }
            let low = || free().find(|(f, _)| !self.found[*f].counts).copied();
            let Some((f, _)) = best.or_else(low) else { continue };
            is_taken[f] = true;
            right += u64::from(*counts && self.found[f].counts);
        }
        let is_wrong =
            |(f, c): &(usize, &Candidate)| is_sure(*f) && !is_taken[*f] && c.counts && !c.is_unlabelled;
        (right, self.found.iter().enumerate().filter(is_wrong).count() as u64)
    }
}

/// Scores at which recall has increased by one step, as closely as the scores allow.
fn thresholds(mut scores: Vec<f64>, wanted: usize) -> Vec<f64> {
    scores.sort_by(|a, b| b.total_cmp(a));
    let mut recall = 0.0;
    let mut at = Vec::new();
    for (k, score) in scores.iter().enumerate() {
        let is_last = k + 1 == scores.len();
        let left = (k + 1) as f64 / wanted as f64;
        let right = if is_last { left } else { (k + 2) as f64 / wanted as f64 };
        if is_last || right - recall >= recall - left {
            at.push(*score);
            recall += 1.0 / STEPS as f64;
        }
    }
    at
}

/// Share of a box inside a region.
fn share_in(of: [f64; 4], region: [f64; 4]) -> f64 {
    let area = |[left, top, right, bottom]: [f64; 4]| (right - left).max(0.0) * (bottom - top).max(0.0);
    let shared = [of[0].max(region[0]), of[1].max(region[1]), of[2].min(region[2]), of[3].min(region[3])];
    if area(of) > 0.0 { area(shared) / area(of) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Deserialize)]
    struct Case {
        frames: Vec<Frame>,
        /// R11 and R40 by class and level; -1 for `None`.
        expected: [[[f64; 2]; 3]; 3],
    }

    #[derive(Deserialize)]
    struct Frame {
        truth: Vec<(KittiKind, f64, f64, [f64; 4])>,
        found: Vec<(KittiKind, [f64; 4], f64)>,
    }

    #[test]
    fn average_precision_matches_a_model_of_the_development_kit() {
        let text = include_str!("../../../tests/reference/perception_metrics/kitti.json");
        let cases: Vec<Case> = serde_json::from_str(text).unwrap();
        assert!(cases.len() >= 8);
        for (k, case) in cases.iter().enumerate() {
            let frames: Vec<_> = case.frames.iter().map(Frame::read).collect();
            for (class, of_class) in KittiClass::ALL.into_iter().zip(case.expected) {
                for (level, expected) in KittiLevel::ALL.into_iter().zip(of_class) {
                    let ap = kitti_ap(&frames, class, level);
                    for (value, expected) in [ap.r11, ap.r40].into_iter().zip(expected) {
                        let value = value.unwrap_or(-1.0);
                        let off = (value - expected).abs();
                        assert!(off < 1e-9, "case {k}, {class:?}, {level:?}: {value}, expected {expected}");
                    }
                }
            }
        }
    }

    impl Frame {
        fn read(&self) -> (Vec<KittiTruth>, Vec<KittiFound>) {
            let truth = |&(kind, truncation, occlusion, box_px): &_| KittiTruth {
                kind,
                truncation,
                occlusion,
                box_px,
            };
            let found = |&(kind, box_px, score): &_| KittiFound { kind, box_px, score };
            (self.truth.iter().map(truth).collect(), self.found.iter().map(found).collect())
        }
    }
}
