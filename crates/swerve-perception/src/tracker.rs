//! Tracking of boxes: SORT in the ground plane.
//!
//! After Bewley et al. 2016 (Simple Online and Realtime Tracking, arXiv 1602.00763): each track is a constant-velocity
//! Kalman filter; tracks and boxes are paired by optimal assignment; an unmatched box starts an unconfirmed track, and
//! a track without boxes for a while ends. Unlike SORT, the state is a position in the map, not in the image; pairs are
//! gated by Mahalanobis distance instead of overlap, as boxes the size of people rarely overlap on the ground; and the
//! history of a track is smoothed backwards over the last sightings (Rauch, Tung and Striebel 1965), because predictors
//! fit lines to it.

mod kalman;
mod measured;
mod params;
#[cfg(test)]
mod tests;

use core::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Matrix2, Matrix4, Vector2 as Column2};
use swerve_core::{ParamError, Span, Time};
use swerve_geom::{Ego, Map, Obb, Point2, Pose2, Vector2, angle_between, math, shared_area_m2};
use swerve_msg::{ActorId, ActorKind, DetectedBox, Detections, Extent, Sighting, Track, TrackList};

use crate::assignment::assign;
use crate::bound::surest;
use kalman::Filter;
use measured::Measured;

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

/// Mean squared Mahalanobis distance of a track's own boxes.
const DIMENSIONS: f64 = 2.0;
/// Share of the smaller of two outlines within the other from which on they are of the same object.
const SAME_SHARE: f64 = 0.5;

/// Kinds that detectors confuse with each other, but not with those of other groups.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Group {
    Person,
    Vehicle,
    Fixed,
}

impl Group {
    fn of(kind: ActorKind) -> Self {
        match kind {
            ActorKind::Static => Self::Fixed,
            kind if kind.is_person() => Self::Person,
            _ => Self::Vehicle,
        }
    }
}

/// Speed below which a track stands, m/s: one standard deviation of a standing one in images.
const STANDS_MPS: f64 = 1.0;

/// Speed above which a vehicle moves, m/s: several standard deviations of an echo's.
const MOVES_MPS: f64 = 1.5;

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
    /// True if its latest box is in an image.
    is_in_image: bool,
    /// Its latest box, if that was outside of the gate.
    strayed: Option<Box<Stray>>,
    is_confirmed: bool,
}

/// Box outside of the gate, and the filter before it.
#[derive(Clone, PartialEq, Debug)]
struct Stray {
    before: Filter,
    at: Column2<f64>,
    covariance: Matrix2<f64>,
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
        self.confirmed(id).map(|track| track.score)
    }

    /// Covariance of x, y and their velocities of a confirmed track in the map, in m and m/s.
    pub fn covariance(&self, id: ActorId) -> Option<Matrix4<f64>> {
        self.confirmed(id).map(|track| track.filter.covariance())
    }

    fn confirmed(&self, id: ActorId) -> Option<&Followed> {
        let of = self.tracks.binary_search_by_key(&id, |track| track.id).ok()?;
        Some(&self.tracks[of]).filter(|track| track.is_confirmed)
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
        let pairs = self.pair(&boxes, found.stamp);
        for &(t, b, noise) in &pairs {
            self.tracks[t].meet(&boxes[b], noise, found.stamp, &params);
        }
        let [on_probation, reported, near] =
            [params.probation_s, params.forget_after_s, params.near_forget_after_s].map(Span::from_secs);
        self.tracks.retain_mut(|track| {
            let unseen = found.stamp - track.last_seen;
            if track.is_confirmed
                && unseen > reported
                && unseen <= near
                && track.stands_near(ego, params.near_m)
            {
                track.filter.rest();
                return true;
            }
            unseen <= if track.is_confirmed { reported } else { on_probation }
        });
        for (b, measured) in boxes.iter().enumerate() {
            if !pairs.iter().any(|&(_, taken, _)| taken == b) {
                self.given += 1;
                self.tracks.push(Followed::founded(ActorId(self.given), measured, found.stamp, &params));
            }
        }
        self.merge(found.stamp);
    }

    /// Merges tracks of the same object. The older identity stays, with the state of the surer track.
    fn merge(&mut self, stamp: Time) {
        let mut kept: Vec<(Obb, Followed)> = Vec::with_capacity(self.tracks.len());
        for track in self.tracks.drain(..) {
            let outline = track.outline();
            let is_one = |(other, older): &&mut (Obb, Followed)| {
                other.overlaps(&outline)
                    && older.is_same_as(&track, [other, &outline], stamp, self.params.gate)
            };
            match kept.iter_mut().find(is_one) {
                Some((other, older)) => {
                    older.merge(track);
                    *other = older.outline();
                }
                None => kept.push((outline, track)),
            }
        }
        self.tracks.extend(kept.into_iter().map(|(_, track)| track));
    }

    /// Pairs of tracks and boxes, each with a factor of the box's covariance. Unmatched tracks and boxes are tried again
    /// assuming that the track suddenly started, stopped or turned, so that a person who stops keeps the identity and
    /// leaves no track that walks on.
    fn pair(&mut self, boxes: &[Measured<'_>], stamp: Time) -> Vec<(usize, usize, f64)> {
        let (params, tracks) = (self.params, &mut self.tracks);
        let sudden_mps = |track: &Followed| params.motion(track.kind).change_mps;
        let distance = |t: usize, b: usize| tracks[t].distance(0.0, &boxes[b]);
        let near = likeliest(tracks.len(), boxes.len(), params.gate, distance);
        let left_tracks: Vec<usize> =
            (0..tracks.len()).filter(|t| near.iter().all(|(taken, _)| taken != t)).collect();
        let left_boxes: Vec<usize> =
            (0..boxes.len()).filter(|b| near.iter().all(|(_, taken)| taken != b)).collect();
        for &(t, _) in &near {
            tracks[t].strayed = None;
        }
        let mut pairs: Vec<(usize, usize, f64)> = near.into_iter().map(|(t, b)| (t, b, 1.0)).collect();
        let distance = |t: usize, b: usize| {
            let track = &tracks[left_tracks[t]];
            track.distance(sudden_mps(track), &boxes[left_boxes[b]])
        };
        for (t, b) in likeliest(left_tracks.len(), left_boxes.len(), params.gate, distance) {
            let (t, b) = (left_tracks[t], left_boxes[b]);
            let noise = tracks[t].stray(&boxes[b], stamp, &params);
            pairs.push((t, b, noise));
        }
        pairs
    }

    fn list(&self) -> TrackList {
        let confirmed = self.tracks.iter().filter(|track| track.is_confirmed);
        TrackList {
            stamp: self.newest.unwrap_or_default(),
            tracks: confirmed.map(|track| track.reported(self.params.velocity_doubt)).collect(),
        }
    }
}

/// Pairs of tracks and boxes within the gate that are likeliest in total: the cost of a pair is its negative
/// log-likelihood (Bar-Shalom, Willett and Tian 2011, section 7.3). By the distance alone, an uncertain track would
/// take the boxes of a certain one.
fn likeliest(
    tracks: usize,
    boxes: usize,
    gate: f64,
    distance: impl Fn(usize, usize) -> Option<(f64, f64)>,
) -> Vec<(usize, usize)> {
    let mut widest = f64::NEG_INFINITY;
    let mut costs = Vec::with_capacity(tracks * boxes);
    for (t, b) in (0..tracks).flat_map(|t| (0..boxes).map(move |b| (t, b))) {
        let near = distance(t, b).filter(|(square, _)| *square < gate);
        widest = near.map_or(widest, |(_, ln)| widest.max(ln));
        costs.push(near.map_or(f64::INFINITY, |(square, ln)| square + ln));
    }
    assign(tracks, boxes, gate, |t, b| costs[t * boxes + b] - widest)
}

/// Angle from a heading to the axis of another one, at most a quarter turn, radians: detectors confuse front and rear.
fn axis_between(from_rad: f64, to_rad: f64) -> f64 {
    let off_rad = angle_between(from_rad, to_rad);
    if off_rad.abs() > FRAC_PI_2 { off_rad - PI.copysign(off_rad) } else { off_rad }
}

impl Followed {
    fn founded(id: ActorId, measured: &Measured<'_>, stamp: Time, params: &Params) -> Self {
        let founded = Self::at_box(id, measured, stamp, params);
        if !founded.is_across(measured) {
            return founded;
        }
        let measured = measured.turned();
        Self { extent: measured.found.extent, ..Self::at_box(id, &measured, stamp, params) }
    }

    fn at_box(id: ActorId, measured: &Measured<'_>, stamp: Time, params: &Params) -> Self {
        let found = measured.found;
        let velocity = measured.velocity_m2ps2(params.motion(found.kind).speed_mps);
        let mut founded = Self {
            id,
            kind: found.kind,
            kind_score: found.score,
            score: found.score,
            filter: Filter::new(stamp, measured.at, measured.covariance, velocity),
            heading_rad: measured.heading_rad,
            extent: measured.extent,
            hits: 1,
            last_seen: stamp,
            is_in_image: found.image_px.is_some(),
            strayed: None,
            is_confirmed: params.hits_min <= 1,
        };
        founded.take_speed(measured, params);
        founded
    }

    /// True if a box of a vehicle is across the motion of the track: a vehicle moves along its axis.
    fn is_across(&self, measured: &Measured<'_>) -> bool {
        let (sin, cos) = math::sin_cos(measured.heading_rad);
        Group::of(measured.found.kind) == Group::Vehicle
            && self.filter.moves_along(Column2::new(-sin, cos), MOVES_MPS)
    }

    /// The box, turned by a quarter if it is across the motion of the track. From ahead, the front of a truck looks like
    /// the side of a car.
    fn along<'a>(&self, measured: &Measured<'a>) -> Measured<'a> {
        if self.is_across(measured) { measured.turned() } else { *measured }
    }

    /// Squared Mahalanobis distance to a box, after a sudden velocity change with this standard deviation in m/s, and
    /// the logarithm of the determinant of its covariance; `None` if their kinds are not confused.
    fn distance(&self, change_mps: f64, measured: &Measured<'_>) -> Option<(f64, f64)> {
        if Group::of(self.kind) != Group::of(measured.found.kind) {
            return None;
        }
        let measured = self.along(measured);
        self.filter.squared_distance(change_mps, self.centre(&measured), measured.covariance)
    }

    /// Centre of a body of the track's size at the place of a box.
    fn centre(&self, measured: &Measured<'_>) -> Column2<f64> {
        measured.at + measured.shift(measured.extent, self.extent)
    }

    /// True if a newer track with an overlapping outline is one of the same object: two bodies do not share most of their
    /// ground, nor part of it where their positions differ by no more than their errors. Two boxes that one sensor finds
    /// at the same instant are two objects.
    fn is_same_as(&self, newer: &Self, [a, b]: [&Obb; 2], stamp: Time, gate: f64) -> bool {
        let are_two = [self, newer].iter().all(|track| track.last_seen == stamp)
            && self.is_in_image == newer.is_in_image;
        let share = shared_area_m2(a, b) / a.area_m2().min(b.area_m2());
        let is_near = || self.filter.apart(&newer.filter).is_some_and(|square| square < gate);
        match (Group::of(self.kind), Group::of(newer.kind)) {
            _ if are_two => false,
            (a, b) if a == b => share > SAME_SHARE || is_near(),
            (a, b) => (a == Group::Fixed || b == Group::Fixed) && share > SAME_SHARE,
        }
    }

    /// Takes over a newer track of the same object.
    fn merge(&mut self, newer: Self) {
        let is_fixed = |track: &Self| Group::of(track.kind) == Group::Fixed;
        let by_class = is_fixed(self).cmp(&is_fixed(&newer));
        let by_spread = self.filter.spread_m4().total_cmp(&newer.filter.spread_m4());
        if by_class.then(by_spread).is_gt() {
            let is_confirmed = self.is_confirmed || newer.is_confirmed;
            *self = Self { id: self.id, is_confirmed, ..newer };
        }
    }

    /// True if the track stands ahead of the ego, at most this distance from its origin.
    fn stands_near(&self, ego: Pose2<Map>, near_m: f64) -> bool {
        let (x_m, y_m, [vx_mps, vy_mps]) = self.filter.state();
        let off = ego.to_local::<Ego>(Point2::new(x_m, y_m));
        math::hypot(vx_mps, vy_mps) < STANDS_MPS && off.x_m > 0.0 && math::hypot(off.x_m, off.y_m) <= near_m
    }

    fn outline(&self) -> Obb {
        let (x_m, y_m, _) = self.filter.state();
        self.extent.footprint(Pose2::new(x_m, y_m, self.heading_rad))
    }

    /// Prepares for a box outside of the gate; returns the factor of the box's covariance. A first such box may be an
    /// outlier: it counts with a covariance as large as its distance suggests. At the second in a row, the velocity
    /// changed before the first.
    fn stray(&mut self, measured: &Measured<'_>, stamp: Time, params: &Params) -> f64 {
        let Motion { accel_density, change_mps, .. } = params.motion(self.kind);
        if let Some(strayed) = self.strayed.take() {
            let Stray { before: mut filter, at, covariance } = *strayed;
            filter.jump(change_mps);
            filter.update(at, covariance, params.sightings_max);
            filter.predict(stamp, accel_density);
            self.filter = filter;
            return 1.0;
        }
        let square = self.distance(0.0, measured).map_or(0.0, |(square, _)| square);
        let measured = &self.along(measured);
        let (before, at, covariance) = (self.filter.clone(), self.centre(measured), measured.covariance);
        self.strayed = Some(Box::new(Stray { before, at, covariance }));
        (square / DIMENSIONS).max(1.0)
    }

    /// Takes a box whose covariance is multiplied by `noise`.
    fn meet(&mut self, measured: &Measured<'_>, noise: f64, stamp: Time, params: &Params) {
        let (found, measured) = (measured.found, &self.along(measured));
        self.filter.update(self.centre(measured), measured.covariance * noise, params.sightings_max);
        self.take_speed(measured, params);
        self.is_in_image = found.image_px.is_some();
        if found.score > self.kind_score {
            (self.kind, self.kind_score) = (found.kind, found.score);
        }
        // Mean of all values so far, until the gain reaches that of the low-pass.
        self.hits += 1;
        let gain = (1.0 / self.hits as f64).max(params.shape_gain);
        self.score += gain * (found.score - self.score);
        if !measured.is_turned {
            self.take_shape(measured, gain);
        }
        self.last_seen = stamp;
        self.is_confirmed |= self.hits >= params.hits_min;
    }

    /// Takes a share of the heading and the size of a box.
    fn take_shape(&mut self, measured: &Measured<'_>, gain: f64) {
        self.heading_rad += gain * axis_between(self.heading_rad, measured.heading_rad);
        let mix = |old: f64, new: f64| old + gain * (new - old);
        let extent = Extent {
            length_m: mix(self.extent.length_m, measured.extent.length_m),
            width_m: mix(self.extent.width_m, measured.extent.width_m),
            height_m: mix(self.extent.height_m, measured.extent.height_m),
        };
        let by = measured.shift(self.extent, extent);
        if by != Column2::zeros() {
            self.filter.shift(by);
            if let Some(strayed) = &mut self.strayed {
                strayed.before.shift(by);
                strayed.at += by;
            }
        }
        self.extent = extent;
    }

    /// Takes the radial speed of a box. The echo comes from anywhere on the body, whose motion across the sight has
    /// another radial part there: half of the speed across times the angle from the centre to an end.
    fn take_speed(&mut self, measured: &Measured<'_>, params: &Params) {
        if let Some(speed_mps) = measured.found.radial_speed_mps.filter(|_| params.radial_noise_mps > 0.0) {
            let (.., [x, y]) = self.filter.state();
            let across_mps = Column2::new(x, y).perp(&measured.sight);
            let angle = 0.5 * self.extent.length_m / (measured.at - measured.ego).norm().max(1.0);
            let noise_mps = math::hypot(params.radial_noise_mps, 0.5 * across_mps * angle);
            self.filter.update_speed(measured.sight, speed_mps, noise_mps, params.gate);
        }
    }

    /// The track as reported. What doubt takes from the velocity, it takes from the history too.
    fn reported(&self, doubt: f64) -> Track {
        let (x_m, y_m, velocity_mps) = self.filter.state();
        let velocity_mps = Vector2::new(velocity_mps[0], velocity_mps[1]);
        let sure_mps = self.filter.sure_mps(doubt);
        let sure_mps = Vector2::new(sure_mps.x, sure_mps.y);
        let doubtful_mps = velocity_mps - sure_mps;
        let now = self.filter.at();
        let sighting =
            |(at, point): (Time, Point2)| Sighting { at, point: point + doubtful_mps * (now - at).as_secs() };
        Track {
            id: self.id,
            kind: self.kind,
            pose: Pose2::new(x_m, y_m, self.heading_rad),
            extent: self.extent,
            velocity_mps: sure_mps,
            history: self.filter.smoothed().into_iter().map(sighting).collect(),
        }
    }
}
