//! Tracking of boxes: SORT in the ground plane.
//!
//! After Bewley et al. 2016 (Simple Online and Realtime Tracking, arXiv 1602.00763): each track is a constant-velocity
//! Kalman filter; tracks and boxes are paired by optimal assignment; an unmatched box starts an unconfirmed track, and
//! a track without boxes for a while ends. Unlike SORT, the state is a position in the map, not in the image; pairs are
//! gated by Mahalanobis distance instead of overlap, as boxes the size of people rarely overlap on the ground; and the
//! history of a track is smoothed backwards over the last sightings (Rauch, Tung and Striebel 1965), because predictors
//! fit lines to it.

mod kalman;
mod params;
#[cfg(test)]
mod tests;

use nalgebra::{Matrix2, Vector2 as Column2};
use swerve_core::{ParamError, Span, Time};
use swerve_geom::{Ego, Map, Pose2, Vector2, angle_between, math};
use swerve_msg::{ActorId, ActorKind, DetectedBox, Detections, Extent, Sighting, Track, TrackList};

use crate::assignment::assign;
use crate::bound::surest;
use kalman::Filter;

pub use params::{Motion, Params};

/// Multi-object tracker of boxes on the ground.
#[derive(Clone, PartialEq, Debug)]
pub struct Tracker {
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
    filter: Filter,
    heading_rad: f64,
    extent: Extent,
    hits: usize,
    last_seen: Time,
    is_confirmed: bool,
}

/// Box in the map frame with its covariance.
struct Measured<'a> {
    found: &'a DetectedBox,
    at: Column2<f64>,
    covariance: Matrix2<f64>,
    heading_rad: f64,
}

impl Tracker {
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
    /// confirmed tracks, sorted by identity.
    ///
    /// Ignores boxes below the score threshold and non-finite boxes; if there are more than
    /// [`BOXES_MAX`](crate::image_plane::BOXES_MAX), uses those with the highest scores. Detections that are not newer
    /// than the previous ones change nothing. Identities are numbered from 1 in the order of creation, within a frame
    /// by falling score.
    pub fn update(&mut self, found: &Detections, ego: Pose2<Map>) -> TrackList {
        let newest = self.newest.unwrap_or(Time::MIN);
        if found.stamp > newest && ego.is_finite() {
            self.newest = Some(found.stamp);
            self.take_in(found, ego);
        }
        self.list()
    }

    /// Score of a confirmed track: the average score of its boxes, weighted towards recent ones.
    pub fn score(&self, id: ActorId) -> Option<f64> {
        let of = self.tracks.binary_search_by_key(&id, |track| track.id).ok()?;
        Some(self.tracks[of].score).filter(|_| self.tracks[of].is_confirmed)
    }

    fn take_in(&mut self, found: &Detections, ego: Pose2<Map>) {
        let params = self.params;
        let usable = |b: &&DetectedBox| b.score >= params.score_min && b.is_finite();
        let mut boxes: Vec<&DetectedBox> = found.boxes.iter().filter(usable).collect();
        surest(&mut boxes, |b| b.score);
        let boxes: Vec<Measured<'_>> = boxes.into_iter().map(|b| Measured::of(b, ego, &params)).collect();
        for track in &mut self.tracks {
            track.filter.predict(found.stamp, params.motion(track.kind).accel_density);
        }
        let pairs = self.pair(&boxes);
        for &(t, b) in &pairs {
            self.tracks[t].meet(&boxes[b], found.stamp, &params);
        }
        let [on_probation, reported] = [params.probation_s, params.forget_after_s].map(Span::from_secs);
        self.tracks.retain(|track| {
            let limit = if track.is_confirmed { reported } else { on_probation };
            found.stamp - track.last_seen <= limit
        });
        for (b, measured) in boxes.iter().enumerate() {
            if !pairs.iter().any(|&(_, taken)| taken == b) {
                self.given += 1;
                self.tracks.push(Followed::founded(ActorId(self.given), measured, found.stamp, &params));
            }
        }
    }

    /// Pairs of tracks and boxes. Unmatched tracks and boxes are tried again assuming that the track suddenly started,
    /// stopped or turned, so that a person who stops keeps the identity and leaves no track that walks on.
    fn pair(&mut self, boxes: &[Measured<'_>]) -> Vec<(usize, usize)> {
        let (params, tracks) = (self.params, &mut self.tracks);
        let sudden_mps = |track: &Followed| params.motion(track.kind).change_mps;
        let distance = |t: usize, b: usize| tracks[t].distance(0.0, &boxes[b]);
        let mut pairs = assign(tracks.len(), boxes.len(), params.gate, distance);
        let left_tracks: Vec<usize> =
            (0..tracks.len()).filter(|t| pairs.iter().all(|(taken, _)| taken != t)).collect();
        let left_boxes: Vec<usize> =
            (0..boxes.len()).filter(|b| pairs.iter().all(|(_, taken)| taken != b)).collect();
        let distance = |t: usize, b: usize| {
            let track = &tracks[left_tracks[t]];
            track.distance(sudden_mps(track), &boxes[left_boxes[b]])
        };
        for (t, b) in assign(left_tracks.len(), left_boxes.len(), params.gate, distance) {
            let track = &mut tracks[left_tracks[t]];
            track.filter.jump(sudden_mps(track));
            pairs.push((left_tracks[t], left_boxes[b]));
        }
        pairs
    }

    fn list(&self) -> TrackList {
        let confirmed = self.tracks.iter().filter(|track| track.is_confirmed);
        TrackList { stamp: self.newest.unwrap_or_default(), tracks: confirmed.map(Followed::track).collect() }
    }
}

impl<'a> Measured<'a> {
    fn of(found: &'a DetectedBox, ego: Pose2<Map>, params: &Params) -> Self {
        let (x, y) = (found.pose.x_m, found.pose.y_m);
        let range_m = math::hypot(x, y);
        let along_m = params.range_noise_m + params.range_noise_share * range_m;
        let across_m = params.bearing_noise_rad * range_m;
        let (sin, cos) = math::sin_cos(math::atan2(y, x) + ego.heading_rad);
        let turn = Matrix2::new(cos, -sin, sin, cos);
        let square = |m: f64| m * m + params.floor_noise_m * params.floor_noise_m;
        let spread = Matrix2::new(square(along_m), 0.0, 0.0, square(across_m));
        // A box covariance, if given, replaces the model; it excludes the errors of the ego pose.
        let own = found.covariance_m2.map(|[xx, xy, yy]| {
            let (sin, cos) = math::sin_cos(ego.heading_rad);
            let turn = Matrix2::new(cos, -sin, sin, cos);
            turn * Matrix2::new(xx, xy, xy, yy) * turn.transpose()
                + Matrix2::identity() * (params.floor_noise_m * params.floor_noise_m)
        });
        let at = ego.from_local::<Ego>(found.pose.point());
        Self {
            found,
            at: Column2::new(at.x_m, at.y_m),
            covariance: own.unwrap_or_else(|| turn * spread * turn.transpose()),
            heading_rad: found.pose.heading_rad + ego.heading_rad,
        }
    }
}

impl Followed {
    fn founded(id: ActorId, measured: &Measured<'_>, stamp: Time, params: &Params) -> Self {
        let found = measured.found;
        let speed = params.motion(found.kind).speed_mps;
        Self {
            id,
            kind: found.kind,
            kind_score: found.score,
            score: found.score,
            filter: Filter::new(stamp, measured.at, measured.covariance, speed),
            heading_rad: measured.heading_rad,
            extent: found.extent,
            hits: 1,
            last_seen: stamp,
            is_confirmed: params.hits_min <= 1,
        }
    }

    /// Squared Mahalanobis distance to a box, after a sudden velocity change with this standard deviation in m/s;
    /// infinite if one is a person and the other is not.
    fn distance(&self, change_mps: f64, measured: &Measured<'_>) -> f64 {
        if self.kind.is_person() != measured.found.kind.is_person() {
            return f64::INFINITY;
        }
        self.filter.squared_distance(change_mps, measured.at, measured.covariance).unwrap_or(f64::INFINITY)
    }

    fn meet(&mut self, measured: &Measured<'_>, stamp: Time, params: &Params) {
        let found = measured.found;
        self.filter.update(measured.at, measured.covariance, params.sightings_max);
        if found.score > self.kind_score {
            (self.kind, self.kind_score) = (found.kind, found.score);
        }
        // Mean of all values so far, until the gain reaches that of the low-pass.
        self.hits += 1;
        let gain = (1.0 / self.hits as f64).max(params.shape_gain);
        self.heading_rad += gain * angle_between(self.heading_rad, measured.heading_rad);
        let mix = |old: f64, new: f64| old + gain * (new - old);
        self.score = mix(self.score, found.score);
        self.extent = Extent {
            length_m: mix(self.extent.length_m, found.extent.length_m),
            width_m: mix(self.extent.width_m, found.extent.width_m),
            height_m: mix(self.extent.height_m, found.extent.height_m),
        };
        self.last_seen = stamp;
        self.is_confirmed |= self.hits >= params.hits_min;
    }

    fn track(&self) -> Track {
        let (x_m, y_m, velocity_mps) = self.filter.state();
        let sighting = |(at, point)| Sighting { at, point };
        Track {
            id: self.id,
            kind: self.kind,
            pose: Pose2::new(x_m, y_m, self.heading_rad),
            extent: self.extent,
            velocity_mps: Vector2::new(velocity_mps[0], velocity_mps[1]),
            history: self.filter.smoothed().into_iter().map(sighting).collect(),
        }
    }
}
