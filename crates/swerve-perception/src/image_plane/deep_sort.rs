//! DeepSORT (Wojke, Bewley and Paulus 2017, arXiv 1703.07402): boxes are assigned by appearance within a motion gate,
//! with priority to recently seen tracks.
//!
//! The scheme is the paper's: a gate on Mahalanobis distances, the matching cascade (listing 1), overlap for the
//! remaining boxes, and a gallery of the latest appearances of each track. The descriptor is [`Look`], hand-crafted
//! instead of learned. Without descriptors the paper's other cost is used: the Mahalanobis distance itself (equation 5
//! with λ = 1).

use std::collections::VecDeque;

use swerve_geom::{heaviest_pairs, image_iou};

use super::appearance::Look;
use super::motion::Motion;
use super::{ImageDetection, ImageTrack, ImageTracker, surest_usable};

/// Parameters of DeepSORT.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Params {
    /// Score below which boxes are ignored.
    pub score_min: f64,
    /// Gate on the squared Mahalanobis distance; 9.4877 contains 95 % of correct pairs (chi-squared with four degrees
    /// of freedom).
    pub gate: f64,
    /// Largest appearance distance of a pair, 0 to 1. The paper uses 0.2 for network descriptors.
    pub look_max: f64,
    /// Largest value of one minus overlap for boxes not matched by the cascade.
    pub overlap_max: f64,
    /// Consecutive frames without a box after which a track ends.
    pub age_max: u64,
    /// Consecutive frames with a box after which a track is reported.
    pub hits_min: u64,
    /// Number of descriptors stored per track (the paper's nearest-neighbour budget).
    pub looks_max: usize,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            score_min: 0.3,
            gate: 9.4877,
            look_max: 0.3,
            overlap_max: 0.7,
            age_max: 30,
            hits_min: 3,
            looks_max: 100,
        }
    }
}

/// Margin that makes a pair whose cost equals the limit preferable to no pair.
const OVER: f64 = 1e-5;

/// Tracks boxes by appearance and motion.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct DeepSort {
    params: Params,
    given: u64,
    tracks: Vec<Followed>,
}

#[derive(Clone, PartialEq, Debug)]
struct Followed {
    id: u64,
    score: f64,
    motion: Motion,
    hits: u64,
    unseen: u64,
    is_confirmed: bool,
    /// Descriptors, the latest last.
    looks: VecDeque<Look>,
}

/// Box with its descriptor, if any.
struct Detected<'a> {
    found: &'a ImageDetection,
    look: Option<&'a Look>,
}

impl DeepSort {
    /// Tracker without tracks.
    pub fn new(params: Params) -> Self {
        Self { params, ..Self::default() }
    }

    /// Updates the tracks with the next frame and the descriptor of each box, and returns those with a box in it, by
    /// identity. Without any descriptor, motion decides; if only some boxes have one, the others are paired by overlap.
    pub fn update_seen(&mut self, found: &[ImageDetection], looks: &[Option<Look>]) -> Vec<ImageTrack> {
        let has_looks = looks.iter().any(Option::is_some);
        let score_min = self.params.score_min;
        let usable = surest_usable(found).into_iter().filter(|(_, found)| found.score >= score_min);
        let seen: Vec<Detected<'_>> = usable
            .map(|(k, found)| Detected { found, look: looks.get(k).and_then(Option::as_ref) })
            .collect();
        for track in &mut self.tracks {
            track.motion.predict();
            track.unseen += 1;
        }
        let taken = self.pair(&seen, has_looks);
        for (track, d) in self.tracks.iter_mut().zip(&taken.of_track) {
            if let Some(d) = *d {
                track.meet(&seen[d], &self.params);
            }
        }
        let age_max = self.params.age_max;
        self.tracks.retain(|t| t.unseen == 0 || (t.is_confirmed && t.unseen <= age_max));
        for (new, _) in seen.iter().zip(&taken.is_taken).filter(|(_, is_taken)| !**is_taken) {
            self.given += 1;
            self.tracks.push(Followed::founded(self.given, new, &self.params));
        }
        let told = self.tracks.iter().filter(|t| t.is_confirmed && t.unseen == 0);
        told.map(|t| ImageTrack { id: t.id, box_px: t.motion.edges(), score: t.score }).collect()
    }

    /// Matching cascade, most recently seen tracks first; then overlap, for unconfirmed tracks and those seen in the
    /// previous frame.
    fn pair(&self, seen: &[Detected<'_>], has_looks: bool) -> Taken {
        let tracks = &self.tracks;
        let mut taken = Taken { of_track: vec![None; tracks.len()], is_taken: vec![false; seen.len()] };
        let Params { look_max, gate, overlap_max, .. } = self.params;
        let limit = if has_looks { look_max } else { gate };
        let mut confirmed: Vec<usize> = (0..tracks.len()).filter(|t| tracks[*t].is_confirmed).collect();
        confirmed.sort_by_key(|t| tracks[*t].unseen);
        for level in confirmed.chunk_by(|a, b| tracks[*a].unseen == tracks[*b].unseen) {
            taken.pair(level, limit, |t, d| tracks[t].distance(&seen[d], gate, has_looks));
        }
        let is_left =
            |t: &usize| taken.of_track[*t].is_none() && (!tracks[*t].is_confirmed || tracks[*t].unseen == 1);
        let left: Vec<usize> = (0..tracks.len()).filter(is_left).collect();
        taken.pair(&left, overlap_max, |t, d| {
            Some(1.0 - image_iou(tracks[t].motion.edges(), seen[d].found.box_px))
        });
        taken
    }
}

impl ImageTracker for DeepSort {
    /// Updates by motion alone.
    fn update(&mut self, found: &[ImageDetection]) -> Vec<ImageTrack> {
        self.update_seen(found, &[])
    }
}

/// Assignment of boxes to tracks.
struct Taken {
    of_track: Vec<Option<usize>>,
    is_taken: Vec<bool>,
}

impl Taken {
    /// Pairs tracks with free boxes at the least cost, where an unpaired element costs half of the limit.
    fn pair(&mut self, tracks: &[usize], limit: f64, cost: impl Fn(usize, usize) -> Option<f64>) {
        let free: Vec<usize> = (0..self.is_taken.len()).filter(|d| !self.is_taken[*d]).collect();
        let mut weighed = Vec::new();
        for (row, &t) in tracks.iter().enumerate() {
            for (column, &d) in free.iter().enumerate() {
                if let Some(cost) = cost(t, d).filter(|cost| *cost <= limit) {
                    weighed.push((row, column, limit + OVER - cost));
                }
            }
        }
        for (row, column) in heaviest_pairs(tracks.len(), free.len(), &weighed) {
            self.of_track[tracks[row]] = Some(free[column]);
            self.is_taken[free[column]] = true;
        }
    }
}

impl Followed {
    fn founded(id: u64, seen: &Detected<'_>, params: &Params) -> Self {
        Self {
            id,
            score: seen.found.score,
            motion: Motion::founded(seen.found.box_px),
            hits: 1,
            unseen: 0,
            is_confirmed: params.hits_min <= 1,
            looks: seen.look.cloned().into_iter().collect(),
        }
    }

    /// Distance of a box by appearance, or by motion without descriptors; `None` outside the gate.
    fn distance(&self, seen: &Detected<'_>, gate: f64, has_looks: bool) -> Option<f64> {
        let moved = self.motion.squared_distance(seen.found.box_px);
        // NaN if the filter's size has degenerated.
        if moved.is_nan() || moved > gate {
            return None;
        }
        if !has_looks {
            return Some(moved);
        }
        let look = seen.look?;
        self.looks.iter().map(|known| known.distance(look)).min_by(f64::total_cmp)
    }

    fn meet(&mut self, seen: &Detected<'_>, params: &Params) {
        self.motion.update(seen.found.box_px);
        (self.score, self.unseen) = (seen.found.score, 0);
        self.hits += 1;
        self.is_confirmed |= self.hits >= params.hits_min;
        if let Some(look) = seen.look {
            while self.looks.len() >= params.looks_max.max(1) {
                self.looks.pop_front();
            }
            self.looks.push_back(look.clone());
        }
    }
}
