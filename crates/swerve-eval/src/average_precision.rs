//! Average precision: how far down its list of scores a detector can be believed.
//!
//! Boxes are matched frame by frame as COCO does it (Lin et al. 2014; `pycocotools`): by falling score, each takes the
//! wanted box with the largest overlap of at least the threshold that none before it has taken, and one that counts
//! before one that does not. What takes a box that does not count, or takes none and would not count itself, is left
//! out. The precision at a recall is the largest at that recall or beyond; average precision is its mean over fixed
//! recalls.

use serde::{Deserialize, Serialize};

/// The recalls over which the mean is taken. Numbers under different ones are not comparable.
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
            // Multiples of the rounded step, as there: the mark at 35 % is not reached by 35 of 100.
            Self::Coco101 => (0..100).map(|k| f64::from(k) * 0.01).chain([1.0]).collect(),
            Self::Kitti11 => even(10, 0).collect(),
            Self::Kitti40 => even(40, 1).collect(),
        }
    }
}

/// One box that a detector reports.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Found {
    /// The larger, the surer.
    pub score: f64,
    /// Whether it is a false positive if it matches nothing; else it is then left out.
    pub counts: bool,
}

/// Takes in frames of one class and gives its average precision.
#[derive(Clone, PartialEq, Debug)]
pub struct AveragePrecision {
    overlap_min: f64,
    /// Score, and whether it is true; in the order of the frames, within a frame by falling score.
    judged: Vec<(f64, bool)>,
    wanted: u64,
}

impl AveragePrecision {
    /// With the least overlap of a match.
    pub fn new(overlap_min: f64) -> Self {
        Self { overlap_min, judged: Vec::new(), wanted: 0 }
    }

    /// Takes in one frame: what was found, and for each box that is there whether it counts;
    /// `overlap(f, w)` is that of the found box `f` with the wanted box `w`.
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

    /// Takes in boxes judged elsewhere, by falling score: each is true or false, or left out; `wanted` were to be found.
    pub(crate) fn judged(&mut self, judged: impl Iterator<Item = (f64, Option<bool>)>, wanted: u64) {
        self.judged.extend(judged.filter_map(|(score, is_true)| Some((score, is_true?))));
        self.wanted += wanted;
    }

    /// The share of the wanted boxes that were found; `None` if nothing was to be found.
    pub fn recall(&self) -> Option<f64> {
        let right = self.judged.iter().filter(|(_, is_true)| *is_true).count();
        (self.wanted > 0).then(|| right as f64 / self.wanted as f64)
    }

    /// Boxes that were to be found.
    pub fn wanted(&self) -> u64 {
        self.wanted
    }

    /// The mean precision, 0 to 1; `None` if nothing was to be found.
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

    /// Recall and precision after each box, by falling score; `None` if nothing was to be found.
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
        /// Left, top, right, bottom, and whether it counts.
        wanted: Vec<([f64; 4], bool)>,
        /// The same, and the score.
        found: Vec<([f64; 4], f64)>,
    }

    #[test]
    fn it_is_what_pycocotools_computes() {
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

    /// One frame with three things wanted; the boxes found lie on the first, the second, nothing, the third.
    fn by_hand(last_counts: bool, ghost_counts: bool) -> AveragePrecision {
        let mut ap = AveragePrecision::new(0.5);
        let on = [Some(0), Some(1), None, Some(2)];
        let found = [0.9, 0.8, 0.7, 0.6].map(|score| Found { score, counts: score != 0.7 || ghost_counts });
        ap.frame(&found, &[true, true, last_counts], |f, w| if on[f] == Some(w) { 0.8 } else { 0.0 });
        ap
    }

    #[test]
    fn a_curve_by_hand() {
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
    fn what_does_not_count_is_neither_wanted_nor_wrong() {
        assert_eq!(by_hand(true, false).value(Recalls::Coco101), Some(1.0));
        assert_eq!(by_hand(false, false).value(Recalls::Coco101), Some(1.0));
        assert_eq!(by_hand(false, false).wanted(), 2);
        assert_eq!(AveragePrecision::new(0.5).value(Recalls::Coco101), None);
    }
}
