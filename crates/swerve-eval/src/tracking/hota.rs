//! HOTA: higher order tracking accuracy (Luiten et al. 2021).

use std::collections::BTreeMap;

use serde::Serialize;

use super::TrackingFrame;
use super::assignment::heaviest_pairs;

/// Similarity thresholds: 0.05, 0.10, ... 0.95.
const THRESHOLDS: usize = 19;

/// Means over the 19 thresholds, each 0 to 1; without any boxes all except `loc_a` are 0.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Hota {
    /// Mean of the geometric means of detection and association accuracy.
    pub hota: f64,
    /// Detection accuracy: TP / (TP + FN + FP).
    pub det_a: f64,
    /// Association accuracy: mean over matches of the Jaccard index of their object's and track's matches.
    pub ass_a: f64,
    /// Localisation accuracy: mean similarity of matches, 1 at a threshold without any.
    pub loc_a: f64,
    /// Detection recall.
    pub det_re: f64,
    /// Detection precision.
    pub det_pr: f64,
    /// Association recall.
    pub ass_re: f64,
    /// Association precision.
    pub ass_pr: f64,
}

/// Box counts of each id, and global alignment scores of pairs.
#[derive(Default)]
struct Sequence {
    truth: BTreeMap<u64, f64>,
    found: BTreeMap<u64, f64>,
    together: BTreeMap<(u64, u64), f64>,
}

/// Counts at one threshold.
#[derive(Clone, Default)]
struct Level {
    similarity_sum: f64,
    matches: BTreeMap<(u64, u64), f64>,
}

impl Hota {
    pub(super) fn of(frames: &[TrackingFrame]) -> Self {
        let sequence = Sequence::of(frames);
        let mut levels = vec![Level::default(); THRESHOLDS];
        for frame in frames {
            for (pair, similarity) in sequence.matches(frame) {
                for (k, level) in levels.iter_mut().enumerate() {
                    if similarity >= 0.05 + 0.05 * k as f64 - f64::EPSILON {
                        level.similarity_sum += similarity;
                        *level.matches.entry(pair).or_default() += 1.0;
                    }
                }
            }
        }
        let mut mean = Self::default();
        for level in &levels {
            let mut scores = level.scores(&sequence);
            for (sum, score) in mean.all().into_iter().zip(scores.all()) {
                *sum += *score;
            }
        }
        for sum in mean.all() {
            *sum /= THRESHOLDS as f64;
        }
        mean
    }

    fn all(&mut self) -> [&mut f64; 8] {
        let Self { hota, det_a, ass_a, loc_a, det_re, det_pr, ass_re, ass_pr } = self;
        [hota, det_a, ass_a, loc_a, det_re, det_pr, ass_re, ass_pr]
    }
}

impl Sequence {
    fn of(frames: &[TrackingFrame]) -> Self {
        let mut sequence = Self::default();
        for frame in frames {
            for id in &frame.truth {
                *sequence.truth.entry(*id).or_default() += 1.0;
            }
            for id in &frame.found {
                *sequence.found.entry(*id).or_default() += 1.0;
            }
            let (mut of_truth, mut of_found) = (vec![0.0; frame.truth.len()], vec![0.0; frame.found.len()]);
            for &(t, f, similarity) in &frame.alike {
                of_truth[t] += similarity;
                of_found[f] += similarity;
            }
            for &(t, f, similarity) in &frame.alike {
                let union = of_truth[t] + of_found[f] - similarity;
                if union > f64::EPSILON {
                    *sequence.together.entry((frame.truth[t], frame.found[f])).or_default() +=
                        similarity / union;
                }
            }
        }
        sequence
    }

    /// Matches of a frame regardless of similarity, with the similarity.
    fn matches(&self, frame: &TrackingFrame) -> Vec<((u64, u64), f64)> {
        let weigh = |&(t, f, similarity): &(usize, usize, f64)| {
            let (truth, found) = (frame.truth[t], frame.found[f]);
            let together = self.together.get(&(truth, found)).copied().unwrap_or(0.0);
            (t, f, similarity * together / (self.truth[&truth] + self.found[&found] - together))
        };
        let edges: Vec<_> = frame.alike.iter().map(weigh).filter(|(_, _, weight)| *weight > 0.0).collect();
        let similarity: BTreeMap<_, _> = frame.alike.iter().map(|&(t, f, s)| ((t, f), s)).collect();
        heaviest_pairs(frame.truth.len(), frame.found.len(), &edges)
            .into_iter()
            .map(|(t, f)| ((frame.truth[t], frame.found[f]), similarity[&(t, f)]))
            .collect()
    }
}

impl Level {
    fn scores(&self, sequence: &Sequence) -> Hota {
        let (truth, found): (f64, f64) = (sequence.truth.values().sum(), sequence.found.values().sum());
        let right: f64 = self.matches.values().sum();
        let over = |of: f64, by: f64| of / by.max(1.0);
        let mut scores = Hota {
            det_a: over(right, truth + found - right),
            det_re: over(right, truth),
            det_pr: over(right, found),
            loc_a: if right > 0.0 { self.similarity_sum / right } else { 1.0 },
            ..Hota::default()
        };
        for ((t, f), n) in &self.matches {
            let (of_truth, of_found) = (sequence.truth[t], sequence.found[f]);
            scores.ass_a += n * n / (of_truth + of_found - n);
            scores.ass_re += n * n / of_truth;
            scores.ass_pr += n * n / of_found;
        }
        for sum in [&mut scores.ass_a, &mut scores.ass_re, &mut scores.ass_pr] {
            *sum = over(*sum, right);
        }
        scores.hota = (scores.det_a * scores.ass_a).sqrt();
        scores
    }
}
