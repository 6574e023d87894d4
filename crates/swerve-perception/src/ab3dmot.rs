//! AB3DMOT: tracking of 3D boxes by their overlap in space.
//!
//! Weng, Wang, Held and Kitani 2020 (3D Multi-Object Tracking: A Baseline and New Evaluation Metrics, IROS, arXiv
//! 1907.03961): each track is a Kalman filter of position, heading, size and velocity whose noises are uncorrelated, so
//! that each coordinate is a separate filter; boxes are paired with tracks by overlap or distance, with separate rules
//! for each class; a track is reported from its `birth`-th box on, and ends after `death` frames without one.
//!
//! Differences from the paper: frames need not be evenly spaced; noises refer to a frame of [`Params::frame_s`] and
//! grow with the time between frames. The first frames are not an exception: no track is reported before its `birth`.

mod params;
mod solid;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use swerve_core::{ParamError, Span, Time};
use swerve_geom::{Ego, Map, Obb, Point2, Pose2, Vector2, angle_between};
use swerve_msg::{ActorId, ActorKind, DetectedBox, Detections, Extent, Sighting, Track, TrackList};

use crate::assignment::assign;
use crate::axis::Axis;
use crate::bound::surest;
use solid::Solid;

pub use params::{Affinity, Pairing, Params, Rules};

/// Initial variances of a value and of its unobserved rate per frame.
const FIRST: [f64; 2] = [10.0, 1e4];
/// Process noise per frame: added to the variances of value and rate.
const NOISE: [f64; 2] = [1.0, 0.01];
/// Measurement variance: metres², radians².
const MEASURED: f64 = 1.0;
/// Smallest weight of a new box in the track's score.
const SCORE_GAIN: f64 = 0.1;

/// Multi-object tracker of 3D boxes.
#[derive(Clone, PartialEq, Debug)]
pub struct Ab3dMot {
    params: Params,
    newest: Option<Time>,
    /// Tracks, sorted by identity.
    tracks: Vec<Followed>,
    /// Number of identities assigned so far.
    given: u32,
}

/// State of one track.
#[derive(Clone, PartialEq, Debug)]
struct Followed {
    id: ActorId,
    kind: ActorKind,
    /// Highest box score so far that determined the kind.
    kind_score: f64,
    /// Average score of its boxes: the mean at first, then a low-pass.
    score: f64,
    /// Centre in the map, metres; rates per frame.
    place: [Axis; 3],
    heading: Axis,
    /// Length, width, height, metres.
    size: [Axis; 3],
    hits: usize,
    unseen: usize,
    history: VecDeque<Sighting>,
}

impl Ab3dMot {
    /// Tracker without tracks.
    ///
    /// # Errors
    /// If a parameter is outside its range.
    pub fn new(params: Params) -> Result<Self, ParamError> {
        params.validate()?;
        Ok(Self { params, newest: None, tracks: Vec::new(), given: 0 })
    }

    /// Parameters.
    pub(crate) fn params(&self) -> &Params {
        &self.params
    }

    /// Updates the tracks with the detections of one instant and the ego's pose in the map at that instant. Returns all
    /// born tracks, sorted by identity.
    ///
    /// Ignores boxes below the score threshold and non-finite boxes; if there are more than
    /// [`BOXES_MAX`](crate::image_plane::BOXES_MAX), uses those with the highest scores. Detections that are not newer
    /// than the previous ones change nothing.
    pub fn update(&mut self, found: &Detections, ego: Pose2<Map>) -> TrackList {
        let since = found.stamp - self.newest.unwrap_or(found.stamp);
        if (self.newest.is_none() || since > Span::ZERO) && ego.is_finite() {
            self.newest = Some(found.stamp);
            self.take_in(found, since, ego);
        }
        let born = self.tracks.iter().filter(|track| track.hits >= self.params.rules(track.kind).birth);
        let tracks = born.map(|track| track.track(self.params.frame_s)).collect();
        TrackList { stamp: self.newest.unwrap_or_default(), tracks }
    }

    /// Score of a track: the average score of its boxes, weighted towards recent ones.
    pub fn score(&self, id: ActorId) -> Option<f64> {
        let of = self.tracks.binary_search_by_key(&id, |track| track.id).ok()?;
        Some(self.tracks[of].score)
    }

    fn take_in(&mut self, found: &Detections, since: Span, ego: Pose2<Map>) {
        let params = self.params;
        let usable = |b: &&DetectedBox| b.score >= params.score_min && b.is_finite();
        let mut boxes: Vec<&DetectedBox> = found.boxes.iter().filter(usable).collect();
        surest(&mut boxes, |b| b.score);
        let boxes: Vec<Measured<'_>> = boxes.into_iter().map(|b| Measured::of(b, ego)).collect();
        let frames = since.as_secs() / params.frame_s;
        self.tracks.iter_mut().for_each(|track| track.predict(frames));
        let mut is_taken = vec![false; boxes.len()];
        for (t, b) in self.pair(&boxes) {
            self.tracks[t].meet(&boxes[b], found.stamp, params.sightings_max);
            is_taken[b] = true;
        }
        self.tracks.retain(|track| track.unseen < params.rules(track.kind).death);
        for (measured, _) in boxes.iter().zip(is_taken).filter(|(_, is_taken)| !is_taken) {
            self.given += 1;
            self.tracks.push(Followed::founded(ActorId(self.given), measured, found.stamp));
        }
    }

    /// Pairs of tracks and boxes, by the rules of each group of kinds.
    fn pair(&self, boxes: &[Measured<'_>]) -> Vec<(usize, usize)> {
        let predicted: Vec<Solid> = self.tracks.iter().map(Followed::solid).collect();
        let mut pairs = Vec::new();
        for (group, rules) in self.params.groups() {
            let tracks: Vec<usize> =
                (0..self.tracks.len()).filter(|t| group.contains(&self.tracks[*t].kind)).collect();
            let found: Vec<usize> =
                (0..boxes.len()).filter(|b| group.contains(&boxes[*b].found.kind)).collect();
            let cost = |t: usize, b: usize| rules.cost(&predicted[tracks[t]], &boxes[found[b]].solid);
            let chosen = match rules.pairing {
                Pairing::Hungarian => assign(tracks.len(), found.len(), rules.cost_max(), cost),
                Pairing::Greedy => nearest_first(tracks.len(), found.len(), rules.cost_max(), cost),
            };
            pairs.extend(chosen.into_iter().map(|(t, b)| (tracks[t], found[b])));
        }
        pairs
    }
}

/// Greedy assignment: repeatedly pairs the cheapest free row and column, below a limit.
fn nearest_first(
    rows: usize,
    columns: usize,
    limit: f64,
    cost: impl Fn(usize, usize) -> f64,
) -> Vec<(usize, usize)> {
    let all = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
    let mut near: Vec<(f64, usize, usize)> =
        all.map(|(r, c)| (cost(r, c), r, c)).filter(|(cost, ..)| *cost < limit).collect();
    near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut of_row, mut of_column) = (vec![false; rows], vec![false; columns]);
    near.retain(|&(_, row, column)| {
        let is_free = !of_row[row] && !of_column[column];
        if is_free {
            (of_row[row], of_column[column]) = (true, true);
        }
        is_free
    });
    near.into_iter().map(|(_, row, column)| (row, column)).collect()
}

/// Box in the map frame.
struct Measured<'a> {
    found: &'a DetectedBox,
    solid: Solid,
}

impl<'a> Measured<'a> {
    fn of(found: &'a DetectedBox, ego: Pose2<Map>) -> Self {
        let at = ego.from_local::<Ego>(found.pose.point());
        let center = Pose2::new(at.x_m, at.y_m, found.pose.heading_rad + ego.heading_rad);
        let Extent { length_m, width_m, height_m } = found.extent;
        Self {
            found,
            solid: Solid {
                footprint: Obb::new(center, length_m, width_m),
                bottom_m: found.bottom_m,
                height_m,
            },
        }
    }

    /// Centre of the box.
    fn place(&self) -> [f64; 3] {
        let Pose2 { x_m, y_m, .. } = self.solid.footprint.center;
        [x_m, y_m, self.solid.bottom_m + 0.5 * self.solid.height_m]
    }

    fn size(&self) -> [f64; 3] {
        let Extent { length_m, width_m, height_m } = self.found.extent;
        [length_m, width_m, height_m]
    }
}

impl Followed {
    fn founded(id: ActorId, measured: &Measured<'_>, stamp: Time) -> Self {
        let found = measured.found;
        let resting = |value| Axis::new(value, [FIRST[0], 0.0]);
        let mut founded = Self {
            id,
            kind: found.kind,
            kind_score: found.score,
            score: found.score,
            place: measured.place().map(|value| Axis::new(value, FIRST)),
            heading: resting(measured.solid.footprint.center.heading_rad),
            size: measured.size().map(resting),
            hits: 1,
            unseen: 0,
            history: VecDeque::new(),
        };
        founded.remember(stamp, 1);
        founded
    }

    fn predict(&mut self, frames: f64) {
        let moving = NOISE.map(|variance| variance * frames);
        self.place.iter_mut().for_each(|axis| axis.predict(frames, moving));
        for axis in self.size.iter_mut().chain([&mut self.heading]) {
            axis.predict(frames, [moving[0], 0.0]);
        }
        self.unseen += 1;
    }

    fn meet(&mut self, measured: &Measured<'_>, stamp: Time, sightings_max: usize) {
        let found = measured.found;
        let measurements = measured.place().into_iter().chain(measured.size());
        for (axis, value) in self.place.iter_mut().chain(&mut self.size).zip(measurements) {
            axis.update(value, MEASURED);
        }
        // A box that points backwards is flipped: no object turns that fast between frames.
        let off_rad = angle_between(self.heading.value, measured.solid.footprint.center.heading_rad);
        if off_rad.abs() > core::f64::consts::FRAC_PI_2 {
            self.heading.value += core::f64::consts::PI;
        }
        let off_rad = angle_between(self.heading.value, measured.solid.footprint.center.heading_rad);
        self.heading.update(self.heading.value + off_rad, MEASURED);
        if found.score > self.kind_score {
            (self.kind, self.kind_score) = (found.kind, found.score);
        }
        self.hits += 1;
        self.score += (1.0 / self.hits as f64).max(SCORE_GAIN) * (found.score - self.score);
        self.unseen = 0;
        self.remember(stamp, sightings_max);
    }

    fn remember(&mut self, at: Time, sightings_max: usize) {
        let point = Point2::new(self.place[0].value, self.place[1].value);
        self.history.push_back(Sighting { at, point });
        while self.history.len() > sightings_max {
            self.history.pop_front();
        }
    }

    fn solid(&self) -> Solid {
        let [x, y, z] = self.place.map(|axis| axis.value);
        let [length_m, width_m, height_m] = self.size.map(|axis| axis.value);
        let footprint = Obb::new(Pose2::new(x, y, self.heading.value), length_m, width_m);
        Solid { footprint, bottom_m: z - 0.5 * height_m, height_m }
    }

    fn track(&self, frame_s: f64) -> Track {
        let [length_m, width_m, height_m] = self.size.map(|axis| axis.value);
        Track {
            id: self.id,
            kind: self.kind,
            pose: self.solid().footprint.center,
            extent: Extent { length_m, width_m, height_m },
            velocity_mps: Vector2::new(self.place[0].rate / frame_s, self.place[1].rate / frame_s),
            history: self.history.iter().copied().collect(),
        }
    }
}
