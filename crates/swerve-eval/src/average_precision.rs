//! Average precision of a detector over its score thresholds.
//!
//! Boxes are matched frame by frame as in COCO (Lin et al. 2014; `pycocotools`): by descending score, each takes the
//! unmatched ground-truth box with the largest overlap of at least the threshold, boxes that count before boxes that do
//! not. A detection that matches a box that does not count, or that matches nothing and does not count itself, is
//! ignored. The precision at a recall is the largest at that recall or beyond; average precision is its mean over fixed
//! recalls.

use serde::{Deserialize, Serialize};

/// Recall values over which the mean is taken. Results under different ones are not comparable.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Recalls {
    /// 0, 0.01, ... 1: COCO.
    #[default]
    Coco101,
    /// 0, 0.1, ... 1: PASCAL VOC until 2009, KITTI until October 2019.
    Kitti11,
    /// 1/40, 2/40, ... 1: KITTI since (Simonelli et al. 2019).
    Kitti40,
}

impl Recalls {
    fn points(self) -> Vec<f64> {
        let even = |parts: u32, from: u32| (from..=parts).map(move |k| f64::from(k) / f64::from(parts));
        match self {
            // Multiples of the rounded step, as in pycocotools: the mark at 35 % is not reached by 35 of 100.
            Self::Coco101 => (0..100).map(|k| f64::from(k) * 0.01).chain([1.0]).collect(),
            Self::Kitti11 => even(10, 0).collect(),
            Self::Kitti40 => even(40, 1).collect(),
        }
    }
}

/// One detected box.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Found {
    /// Confidence; higher is more certain.
    pub score: f64,
    /// True if an unmatched box is a false positive; otherwise it is then ignored.
    pub counts: bool,
}

/// Accumulates frames of one class and computes the average precision.
#[derive(Clone, PartialEq, Debug)]
pub struct AveragePrecision {
    overlap_min: f64,
    /// Score, and true for a true positive; in frame order, within a frame by descending score.
    judged: Vec<(f64, bool)>,
    wanted: u64,
}

impl AveragePrecision {
    /// Creates an accumulator with the minimum overlap of a match.
    pub fn new(overlap_min: f64) -> Self {
        Self { overlap_min, judged: Vec::new(), wanted: 0 }
    }

    /// Adds one frame: detections, and for each ground-truth box true if it counts. `overlap(f, w)` is the overlap of
    /// detection `f` with ground-truth box `w`.
    pub fn frame(&mut self, found: &[Found], wanted: &[bool], overlap: impl Fn(usize, usize) -> f64) {
        let mut order: Vec<usize> = (0..found.len()).filter(|&f| !found[f].score.is_nan()).collect();
        order.sort_by(|&a, &b| found[b].score.total_cmp(&found[a].score));
        let mut taken = vec![false; wanted.len()];
        for f in order {
            let best = |counts: bool| {
                let free = (0..wanted.len()).filter(|&w| wanted[w] == counts && !taken[w]);
                let near = free.map(|w| (overlap(f, w), w)).filter(|(o, _)| *o >= self.overlap_min);
                near.max_by(|a, b| a.0.total_cmp(&b.0))
            };
            let matched = best(true).or_else(|| best(false));
            if let Some((_, w)) = matched {
                taken[w] = true;
            }
            match matched {
                Some((_, w)) if wanted[w] => self.judged.push((found[f].score, true)),
                None if found[f].counts => self.judged.push((found[f].score, false)),
                Some(_) | None => {}
            }
        }
        self.wanted += wanted.iter().filter(|counts| **counts).count() as u64;
    }

    /// Adds boxes judged elsewhere, by descending score: true positive, false positive, or ignored; `wanted` is the
    /// number of ground-truth boxes.
    pub(crate) fn judged(&mut self, judged: impl Iterator<Item = (f64, Option<bool>)>, wanted: u64) {
        self.judged.extend(judged.filter_map(|(score, is_true)| Some((score, is_true?))));
        self.wanted += wanted;
    }

    /// Share of the ground-truth boxes that were found; `None` without any.
    pub fn recall(&self) -> Option<f64> {
        let right = self.judged.iter().filter(|(_, is_true)| *is_true).count();
        (self.wanted > 0).then(|| right as f64 / self.wanted as f64)
    }

    /// Number of ground-truth boxes.
    pub fn wanted(&self) -> u64 {
        self.wanted
    }

    /// Average precision, 0 to 1; `None` without ground-truth boxes.
    pub fn value(&self, recalls: Recalls) -> Option<f64> {
        let curve = self.curve()?;
        let mut best = 0.0_f64;
        let mut envelope: Vec<f64> = curve
            .iter()
            .rev()
            .map(|(_, precision)| {
                best = best.max(*precision);
                best
            })
            .collect();
        envelope.reverse();
        let points = recalls.points();
        let at = |recall: &f64| envelope.get(curve.partition_point(|(r, _)| r < recall)).copied();
        Some(points.iter().map(|recall| at(recall).unwrap_or(0.0)).sum::<f64>() / points.len() as f64)
    }

    /// Recall and precision after each box, by descending score; `None` without ground-truth boxes.
    pub fn curve(&self) -> Option<Vec<(f64, f64)>> {
        if self.wanted == 0 {
            return None;
        }
        let mut judged = self.judged.clone();
        judged.sort_by(|a, b| b.0.total_cmp(&a.0));
        let (mut right, mut all) = (0.0, 0.0);
        let after = |(_, is_true): (f64, bool)| {
            all += 1.0;
            right += if is_true { 1.0 } else { 0.0 };
            (right / self.wanted as f64, right / all)
        };
        Some(judged.into_iter().map(after).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;
    use swerve_geom::image_iou;

    #[derive(Deserialize)]
    struct Case {
        overlap_min: f64,
        frames: Vec<Frame>,
        coco101: f64,
        kitti11: f64,
        kitti40: f64,
    }

    #[derive(Deserialize)]
    struct Frame {
        /// Left, top, right, bottom, and true if it counts.
        wanted: Vec<([f64; 4], bool)>,
        /// Left, top, right, bottom, and the score.
        found: Vec<([f64; 4], f64)>,
    }

    #[test]
    fn average_precision_matches_pycocotools() {
        let text = include_str!("../../../tests/reference/average_precision/cases.json");
        let cases: Vec<Case> = serde_json::from_str(text).unwrap();
        assert!(cases.len() >= 12);
        for (k, case) in cases.iter().enumerate() {
            let mut ap = AveragePrecision::new(case.overlap_min);
            for frame in &case.frames {
                let found: Vec<Found> =
                    frame.found.iter().map(|&(_, score)| Found { score, counts: true }).collect();
                let wanted: Vec<bool> = frame.wanted.iter().map(|&(_, counts)| counts).collect();
                ap.frame(&found, &wanted, |f, w| image_iou(frame.found[f].0, frame.wanted[w].0));
            }
            for (recalls, expected) in [
                (Recalls::Coco101, case.coco101),
                (Recalls::Kitti11, case.kitti11),
                (Recalls::Kitti40, case.kitti40),
            ] {
                let value = ap.value(recalls).unwrap();
                assert!(
                    (value - expected).abs() < 1e-12,
                    "case {k}, {recalls:?}: {value}, expected {expected}"
                );
            }
        }
    }

    /// One frame with three ground-truth boxes; the detections match the first, the second, nothing and the third.
    fn by_hand(last_counts: bool, ghost_counts: bool) -> AveragePrecision {
        let mut ap = AveragePrecision::new(0.5);
        let on = [Some(0), Some(1), None, Some(2)];
        let found = [0.9, 0.8, 0.7, 0.6].map(|score| Found { score, counts: score != 0.7 || ghost_counts });
        ap.frame(&found, &[true, true, last_counts], |f, w| if on[f] == Some(w) { 0.8 } else { 0.0 });
        ap
    }

    #[test]
    fn precision_recall_curve_matches_hand_computation() {
        let ap = by_hand(true, true);
        let third = 1.0 / 3.0;
        assert_eq!(
            ap.curve().unwrap(),
            [(third, 1.0), (2.0 * third, 1.0), (2.0 * third, 2.0 * third), (1.0, 0.75)]
        );
        // Up to a recall of 2/3 the precision is 1, from there on 3/4.
        let eleven = (7.0 + 4.0 * 0.75) / 11.0;
        assert!((ap.value(Recalls::Kitti11).unwrap() - eleven).abs() < 1e-12);
        let forty = (26.0 + 14.0 * 0.75) / 40.0;
        assert!((ap.value(Recalls::Kitti40).unwrap() - forty).abs() < 1e-12);
    }

    #[test]
    fn boxes_that_do_not_count_are_neither_missed_nor_false() {
        assert_eq!(by_hand(true, false).value(Recalls::Coco101), Some(1.0));
        assert_eq!(by_hand(false, false).value(Recalls::Coco101), Some(1.0));
        assert_eq!(by_hand(false, false).wanted(), 2);
        assert_eq!(AveragePrecision::new(0.5).value(Recalls::Coco101), None);
    }
}
