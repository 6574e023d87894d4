//! IDF1 (Ristani et al. 2016): one assignment of tracks to objects for the whole sequence.

use std::collections::BTreeMap;

use serde::Serialize;
use swerve_geom::heaviest_pairs;

use super::{TrackingFrame, ratio};

/// Boxes explained by the best assignment of whole tracks.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct IdentityScore {
    /// Harmonic mean of `idp` and `idr`.
    pub idf1: Option<f64>,
    /// Share of the track boxes with the correct identity.
    pub idp: Option<f64>,
    /// Share of the ground truth boxes found under the correct identity.
    pub idr: Option<f64>,
    /// Boxes with the correct identity.
    pub true_positives: u64,
    /// Other track boxes.
    pub false_positives: u64,
    /// Other ground truth boxes.
    pub false_negatives: u64,
}

impl IdentityScore {
    pub(super) fn of(frames: &[TrackingFrame], similarity_min: f64) -> Self {
        let (objects, tracks) = (Places::of(frames, |f| &f.truth), Places::of(frames, |f| &f.found));
        let mut together = BTreeMap::<(usize, usize), u64>::new();
        for frame in frames {
            for &(t, f, _) in frame.alike.iter().filter(|(_, _, s)| *s >= similarity_min) {
                *together.entry((objects.of[&frame.truth[t]], tracks.of[&frame.found[f]])).or_default() += 1;
            }
        }
        let edges: Vec<_> = together.iter().map(|(&(o, t), &n)| (o, t, n as f64)).collect();
        let right: u64 = heaviest_pairs(objects.of.len(), tracks.of.len(), &edges)
            .into_iter()
            .map(|pair| together[&pair])
            .sum();
        Self {
            idf1: ratio(right as f64, 0.5 * (objects.boxes + tracks.boxes) as f64),
            idp: ratio(right as f64, tracks.boxes as f64),
            idr: ratio(right as f64, objects.boxes as f64),
            true_positives: right,
            false_positives: tracks.boxes - right,
            false_negatives: objects.boxes - right,
        }
    }
}

/// Ids numbered from 0, and their number of boxes.
struct Places {
    of: BTreeMap<u64, usize>,
    boxes: u64,
}

impl Places {
    fn of(frames: &[TrackingFrame], ids: fn(&TrackingFrame) -> &[u64]) -> Self {
        let mut places = Self { of: BTreeMap::new(), boxes: 0 };
        for id in frames.iter().flat_map(ids) {
            let next = places.of.len();
            places.of.entry(*id).or_insert(next);
            places.boxes += 1;
        }
        places
    }
}
