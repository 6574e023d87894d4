//! DeepSORT (Wojke, Bewley and Paulus 2017, arXiv 1703.07402): boxes are taken for those whom they look like, as far as
//! motion allows it, and whoever was seen last comes first.
//!
//! The scheme is the paper's: a gate of Mahalanobis distances, the matching cascade (listing 1), overlap for what that
//! leaves, a gallery of the newest looks of each track. What a box looks like is [`Look`], made by hand instead of
//! learned. Where nothing is known of looks the paper's other cost stands in for them: the Mahalanobis distance itself
//! (equation 5 with λ = 1).

use std::collections::VecDeque;

use swerve_geom::{heaviest_pairs, image_iou};

use super::appearance::Look;
use super::motion::Motion;
use super::{ImageDetection, ImageTrack, ImageTracker, surest_usable};

/// What may be set.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Params {
    /// Boxes with a lower score are passed over.
    pub score_min: f64,
    /// Squared Mahalanobis distance up to which a box may be a track's; 9.4877 holds 95 % of those that are
    /// (chi-squared with four degrees of freedom).
    pub gate: f64,
    /// Distance of looks up to which a box may be a track's, 0 to 1. The paper's, for looks of a network: 0.2.
    pub look_max: f64,
    /// One less overlap up to which what the cascade left may be a track's.
    pub overlap_max: f64,
    /// Frames in a row without a box after which a track is kept.
    pub age_max: u64,
    /// Frames in a row with a box after which a track is reported.
    pub hits_min: u64,
    /// Looks that a track remembers (the paper's budget for the nearest neighbour).
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

/// What a pair may cost more than the limit and still not be dearer than none: the limit itself is allowed.
const OVER: f64 = 1e-5;

/// Follows boxes by their looks and their motion.
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
    /// The newest last.
    looks: VecDeque<Look>,
}

/// A box with its look, where it has one.
struct Seen<'a> {
    found: &'a ImageDetection,
    look: Option<&'a Look>,
}

impl DeepSort {
    /// Without any past.
    pub fn new(params: Params) -> Self {
        Self { params, ..Self::default() }
    }

    /// Takes in the next frame, with what each box looks like, and gives the tracks that have a box in it, by identity.
    /// Where there is no look at all motion decides; a box without one among others that have some is left to overlap.
    pub fn update_seen(&mut self, found: &[ImageDetection], looks: &[Option<Look>]) -> Vec<ImageTrack> {
        let has_looks = looks.iter().any(Option::is_some);
        let score_min = self.params.score_min;
        let usable = surest_usable(found).into_iter().filter(|(_, found)| found.score >= score_min);
        let seen: Vec<Seen<'_>> =
            usable.map(|(k, found)| Seen { found, look: looks.get(k).and_then(Option::as_ref) }).collect();
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

    /// The cascade, those seen last first; then overlap, for tracks on probation and those seen a frame ago.
    fn pair(&self, seen: &[Seen<'_>], has_looks: bool) -> Taken {
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
    /// By motion alone.
    fn update(&mut self, found: &[ImageDetection]) -> Vec<ImageTrack> {
        self.update_seen(found, &[])
    }
}

/// Which track has which box.
struct Taken {
    of_track: Vec<Option<usize>>,
    is_taken: Vec<bool>,
}

impl Taken {
    /// Pairs tracks with boxes that nobody has yet, at the least cost, where what stays alone costs half of the limit.
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
    fn founded(id: u64, seen: &Seen<'_>, params: &Params) -> Self {
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

    /// Distance of a box by looks, or by motion where there are none; none beyond the gate.
    fn distance(&self, seen: &Seen<'_>, gate: f64, has_looks: bool) -> Option<f64> {
        let moved = self.motion.squared_distance(seen.found.box_px);
        // Not a number where a filter has lost its size.
        if moved.is_nan() || moved > gate {
            return None;
        }
        if !has_looks {
            return Some(moved);
        }
        let look = seen.look?;
        self.looks.iter().map(|known| known.distance(look)).min_by(f64::total_cmp)
    }

    fn meet(&mut self, seen: &Seen<'_>, params: &Params) {
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
