//! ByteTrack (Zhang et al. 2022, arXiv 2110.06864): boxes with low scores start no tracks but continue existing ones.

use swerve_geom::{heaviest_pairs, image_iou};

use super::motion::Motion;
use super::{ImageDetection, ImageTrack, ImageTracker, surest_usable};

/// Parameters of ByteTrack. Scores are between 0 and 1; scores in another range must be calibrated first.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Params {
    /// Score above which a box is high.
    pub score_high: f64,
    /// Score above which a box is low, up to `score_high`; boxes below are ignored.
    pub score_low: f64,
    /// Smallest score of a box that starts a track.
    pub score_new: f64,
    /// Cost limit, one minus overlap times score, for pairing high boxes.
    pub cost_max: f64,
    /// Frames without a box after which a track ends.
    pub age_max: u64,
}

impl Default for Params {
    fn default() -> Self {
        Self { score_high: 0.5, score_low: 0.1, score_new: 0.6, cost_max: 0.8, age_max: 30 }
    }
}

/// Cost limit, one minus overlap, for pairing low boxes.
const COST_MAX_LOW: f64 = 0.5;

/// Cost limit, one minus overlap times score, for tracks seen once.
const COST_MAX_NEW: f64 = 0.7;

/// Limit of one minus the overlap below which a lost and a tracked track are duplicates.
const COST_SAME: f64 = 0.15;

/// Tracks boxes by overlap, high scores first.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct ByteTrack {
    params: Params,
    frames: u64,
    given: u64,
    tracks: Vec<Followed>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum State {
    /// Seen once, but not in the first frame.
    New,
    Tracked,
    Lost,
}

#[derive(Clone, PartialEq, Debug)]
struct Followed {
    id: u64,
    state: State,
    score: f64,
    motion: Motion,
    founded: u64,
    last_seen: u64,
}

impl ByteTrack {
    /// Tracker without tracks.
    pub fn new(params: Params) -> Self {
        Self { params, ..Self::default() }
    }

    /// Pairs unmatched tracks of some states with boxes, and removes those from `boxes`.
    fn pair(&mut self, states: &[State], boxes: &mut Vec<&ImageDetection>, cost_max: f64, by_score: bool) {
        let free: Vec<usize> = (0..self.tracks.len())
            .filter(|&t| self.tracks[t].last_seen < self.frames && states.contains(&self.tracks[t].state))
            .collect();
        let mut weighed = Vec::new();
        for (k, &t) in free.iter().enumerate() {
            let track = self.tracks[t].edges();
            for (d, found) in boxes.iter().enumerate() {
                let like = image_iou(track, found.box_px) * if by_score { found.score } else { 1.0 };
                // Maximising the savings below the limit minimises the cost if an unpaired element costs half of the
                // limit.
                if 1.0 - like < cost_max {
                    weighed.push((k, d, cost_max - (1.0 - like)));
                }
            }
        }
        let mut is_taken = vec![false; boxes.len()];
        for (k, d) in heaviest_pairs(free.len(), boxes.len(), &weighed) {
            self.tracks[free[k]].update(boxes[d], self.frames);
            is_taken[d] = true;
        }
        let mut taken = is_taken.into_iter();
        boxes.retain(|_| !taken.next().unwrap_or(false));
    }

    /// Removes the younger of a lost and a tracked track that nearly coincide.
    fn drop_doubles(&mut self) {
        let age = |track: &Followed| track.last_seen - track.founded;
        let mut is_double = vec![false; self.tracks.len()];
        for (a, tracked) in self.tracks.iter().enumerate().filter(|(_, t)| t.state != State::Lost) {
            for (b, lost) in self.tracks.iter().enumerate().filter(|(_, t)| t.state == State::Lost) {
                if 1.0 - image_iou(tracked.edges(), lost.edges()) < COST_SAME {
                    is_double[if age(tracked) > age(lost) { b } else { a }] = true;
                }
            }
        }
        let mut double = is_double.into_iter();
        self.tracks.retain(|_| !double.next().unwrap_or(false));
    }
}

impl ImageTracker for ByteTrack {
    /// Returns the tracks with a box in this frame, sorted by identity.
    fn update(&mut self, found: &[ImageDetection]) -> Vec<ImageTrack> {
        self.frames += 1;
        let params = self.params;
        let usable = || surest_usable(found).into_iter().map(|(_, found)| found);
        let mut high: Vec<&ImageDetection> = usable().filter(|f| f.score > params.score_high).collect();
        let mut low: Vec<&ImageDetection> =
            usable().filter(|f| f.score > params.score_low && f.score < params.score_high).collect();
        self.tracks.iter_mut().filter(|t| t.state != State::New).for_each(Followed::predict);
        self.pair(&[State::Tracked, State::Lost], &mut high, params.cost_max, true);
        self.pair(&[State::Tracked], &mut low, COST_MAX_LOW, false);
        self.pair(&[State::New], &mut high, COST_MAX_NEW, true);
        let now = self.frames;
        self.tracks.retain(|t| t.last_seen == now || t.state != State::New);
        for track in self.tracks.iter_mut().filter(|t| t.last_seen < now) {
            track.state = State::Lost;
        }
        for detection in high.into_iter().filter(|f| f.score >= params.score_new) {
            self.given += 1;
            self.tracks.push(Followed::founded(self.given, detection, now));
        }
        self.tracks.retain(|track| now - track.last_seen <= params.age_max);
        self.drop_doubles();
        let told = self.tracks.iter().filter(|track| track.state == State::Tracked);
        told.map(|t| ImageTrack { id: t.id, box_px: t.edges(), score: t.score }).collect()
    }
}

impl Followed {
    fn founded(id: u64, found: &ImageDetection, now: u64) -> Self {
        let state = if now == 1 { State::Tracked } else { State::New };
        let motion = Motion::founded(found.box_px);
        Self { id, state, score: found.score, motion, founded: now, last_seen: now }
    }

    fn predict(&mut self) {
        if self.state == State::Lost {
            self.motion.stop_growing();
        }
        self.motion.predict();
    }

    fn update(&mut self, found: &ImageDetection, now: u64) {
        self.motion.update(found.box_px);
        (self.state, self.score, self.last_seen) = (State::Tracked, found.score, now);
    }

    fn edges(&self) -> [f64; 4] {
        self.motion.edges()
    }
}
