//! CLEAR MOT (Bernardin and Stiefelhagen 2008), with the trajectories of Li, Huang and Nevatia 2009.

use std::collections::BTreeMap;

use serde::Serialize;

use super::assignment::heaviest_pairs;
use super::{TrackingFrame, ratio};

/// Weight that makes keeping a match of the previous frame outweigh any gain in similarity.
const KEPT_WEIGHT: f64 = 1000.0;

/// Match counts and derived metrics.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct ClearMot {
    /// Multiple object tracking accuracy: 1 - (misses + false positives + switches) / ground truth boxes, at most 1.
    pub mota: Option<f64>,
    /// Multiple object tracking precision: mean similarity of the matches.
    pub motp: Option<f64>,
    /// Matches.
    pub true_positives: u64,
    /// Unmatched track boxes.
    pub false_positives: u64,
    /// Unmatched ground truth boxes.
    pub false_negatives: u64,
    /// Matches under another identity than the last one of the same object.
    pub id_switches: u64,
    /// Number of times that an object is matched again after a gap.
    pub fragmentations: u64,
    /// Objects matched in more than 0.8 of their frames.
    pub mostly_tracked: u64,
    /// Objects matched in 0.2 to 0.8 of their frames.
    pub partly_tracked: u64,
    /// Objects matched in less than 0.2 of their frames.
    pub mostly_lost: u64,
}

/// State of one object.
#[derive(Default)]
struct Object {
    frames: u64,
    matched: u64,
    beginnings: u64,
    /// Track id of its last match.
    last: Option<u64>,
}

impl ClearMot {
    pub(super) fn of(frames: &[TrackingFrame], similarity_min: f64) -> Self {
        let mut metrics = Self::default();
        let mut objects = BTreeMap::<u64, Object>::new();
        let mut before = BTreeMap::<u64, u64>::new();
        let mut similarity_sum = 0.0;
        for frame in frames {
            for id in &frame.truth {
                objects.entry(*id).or_default().frames += 1;
            }
            let matches = matches(frame, &before, similarity_min);
            metrics.true_positives += matches.len() as u64;
            metrics.false_positives += (frame.found.len() - matches.len()) as u64;
            metrics.false_negatives += (frame.truth.len() - matches.len()) as u64;
            similarity_sum += matches.iter().map(|(_, _, similarity)| similarity).sum::<f64>();
            if frame.truth.is_empty() || frame.found.is_empty() {
                // As in TrackEval, such a frame is skipped: it does not end a match.
                continue;
            }
            let mut now = BTreeMap::new();
            for (truth, found, _) in matches {
                let object = objects.entry(truth).or_default();
                object.matched += 1;
                object.beginnings += u64::from(!before.contains_key(&truth));
                metrics.id_switches += u64::from(object.last.is_some_and(|last| last != found));
                object.last = Some(found);
                now.insert(truth, found);
            }
            before = now;
        }
        metrics.sum_up(&objects, similarity_sum);
        metrics
    }

    fn sum_up(&mut self, objects: &BTreeMap<u64, Object>, similarity_sum: f64) {
        for object in objects.values() {
            self.fragmentations += object.beginnings.saturating_sub(1);
            let share = object.matched as f64 / object.frames as f64;
            match share {
                s if s > 0.8 => self.mostly_tracked += 1,
                s if s >= 0.2 => self.partly_tracked += 1,
                _ => self.mostly_lost += 1,
            }
        }
        let wrong = (self.false_positives + self.id_switches) as f64;
        let there = (self.true_positives + self.false_negatives) as f64;
        self.mota = ratio(self.true_positives as f64 - wrong, there);
        self.motp = ratio(similarity_sum, self.true_positives as f64);
    }
}

/// Matches of a frame as ids and similarity.
fn matches(frame: &TrackingFrame, before: &BTreeMap<u64, u64>, similarity_min: f64) -> Vec<(u64, u64, f64)> {
    let near: Vec<_> =
        frame.alike.iter().copied().filter(|(_, _, s)| *s >= similarity_min - f64::EPSILON).collect();
    let weigh = |&(t, f, similarity): &(usize, usize, f64)| {
        let is_kept = before.get(&frame.truth[t]) == Some(&frame.found[f]);
        (t, f, similarity + if is_kept { KEPT_WEIGHT } else { 0.0 })
    };
    let weighed: Vec<_> = near.iter().map(weigh).collect();
    let similarity: BTreeMap<_, _> = near.iter().map(|&(t, f, s)| ((t, f), s)).collect();
    heaviest_pairs(frame.truth.len(), frame.found.len(), &weighed)
        .into_iter()
        .map(|(t, f)| (frame.truth[t], frame.found[f], similarity[&(t, f)]))
        .collect()
}
