//! Prediction along the lanes of a map.

use std::collections::BTreeMap;
use std::sync::Arc;

use swerve_geom::{Point2, Vector2, angle_between};
use swerve_map::{Lane, LaneChange, LaneId, Map, Side};
use swerve_msg::{ActorKind, PredictionList, Route, Track, TrackList};

use crate::road::{MERGES_MPS, OVER_LINE_M, SETTLES_S, place_of, share_along};
use crate::{Ground, Horizon, Predictor};

/// Smallest speed of a vehicle that is taken to follow a lane, m/s.
const SPEED_MIN_MPS: f64 = 1.0;
/// Largest angle between its motion and the lane, radians.
const ALONG_RAD: f64 = 0.6;
/// Angle that counts as much as a metre from the centre of the lane, radians.
const RAD_PER_M: f64 = 0.1;
/// Most lanes to one side of a lane that are looked at.
const LANES_MAX: usize = 16;
/// Length over which the curvature of a lane is averaged, metres.
const BEND_M: f64 = 10.0;

/// Prediction of vehicles along the lanes of a map, from the lane that they are on.
///
/// Vehicles on lanes of the ego's route, or on lanes of the same direction beside them, follow the route; so do those
/// along it that are on no lane of their direction, such as one that overtakes. Where the route changes lanes, only those
/// follow it whose lane ends. All others follow their own lane.
///
/// A vehicle is expected to follow its lane, and at a fork the lane whose curvature is nearest to that of the lane before:
/// straight on at a crossing, and around in a roundabout. Inside a junction the lane is the one whose direction is nearest
/// to that of the vehicle.
#[derive(Clone, Debug)]
pub struct LaneFollowing {
    map: Arc<Map>,
    /// Ways by the lane that they begin on; `None` where there is none.
    ways: BTreeMap<LaneId, Option<Route>>,
}

impl LaneFollowing {
    /// Creates a prediction along the lanes of this map.
    pub fn new(map: Arc<Map>) -> Self {
        Self { map, ways: BTreeMap::new() }
    }

    /// Predicts tracks: those that follow the ego's route together, on its road; each other vehicle on the road of its own
    /// way; all others together, without a road.
    pub fn predict(
        &mut self,
        predictor: &mut dyn Predictor,
        tracks: &TrackList,
        horizon: &Horizon,
        ego: &Route,
    ) -> PredictionList {
        let (mut together, mut open, mut own) = (Vec::new(), Vec::new(), Vec::new());
        let changes = ego.lane_changes(&self.map);
        for track in &tracks.tracks {
            match self.lane_of(track) {
                Some(lane) if self.stays(&changes, (lane, track), horizon, ego) => {
                    own.push((self.lane_to(lane, track), track.clone()));
                }
                Some(lane) if !self.is_of(ego, lane) => own.push((lane, track.clone())),
                _ if is_along(ego, track) => together.push(track.clone()),
                Some(lane) => own.push((lane, track.clone())),
                None => open.push(track.clone()),
            }
        }
        let list = |tracks_of: Vec<Track>| TrackList { stamp: tracks.stamp, tracks: tracks_of };
        if own.is_empty() {
            together.append(&mut open);
            together.sort_by_key(|track| track.id);
            return predictor.predict(&list(together), horizon, Ground::Road(ego));
        }
        let mut all = predictor.predict(&list(together), horizon, Ground::Road(ego));
        all.predictions.extend(predictor.predict(&list(open), horizon, Ground::Open).predictions);
        for (lane, track) in own {
            let ground = Ground::road(self.way(lane));
            all.predictions.extend(predictor.predict(&list(vec![track]), horizon, ground).predictions);
        }
        all.predictions.sort_by_key(|one| one.id);
        // Modes of different predictions do not occur together.
        all.joint = false;
        all
    }

    /// The lane that a vehicle follows; `None` if it is on none, or hardly moves.
    fn lane_of(&self, track: &Track) -> Option<LaneId> {
        self.lane_at(track, track.pose.point())
    }

    /// The lane that a vehicle changes to: the one that its side reaches until its lateral motion settles.
    fn lane_to(&self, from: LaneId, track: &Track) -> LaneId {
        let reached = self.map.lane(from).and_then(|lane| {
            let place = lane.line.project(track.pose.point());
            let left = lane.line.at(place.s_m).pose.direction().left();
            let left_mps = track.velocity_mps.dot(left);
            let side_m = (0.5 * track.extent.width_m - OVER_LINE_M) * left_mps.signum();
            let point = track.pose.point() + left * (SETTLES_S * left_mps + side_m);
            (left_mps.abs() > MERGES_MPS).then_some(point)
        });
        reached.and_then(|point| self.lane_at(track, point)).unwrap_or(from)
    }

    /// The lane at a point that a vehicle with its motion follows.
    fn lane_at(&self, track: &Track, point: Point2) -> Option<LaneId> {
        let velocity_mps: Vector2 = track.velocity_mps;
        if track.kind == ActorKind::Pedestrian || velocity_mps.norm() < SPEED_MIN_MPS || !track.is_plausible()
        {
            return None;
        }
        let off = |lane: &Lane, s_m: f64, d_m: f64| {
            let off_rad = angle_between(lane.line.at(s_m).pose.heading_rad, velocity_mps.heading()).abs();
            (off_rad < ALONG_RAD).then_some(off_rad + RAD_PER_M * d_m.abs())
        };
        let places = self.map.at(point).filter_map(|place| {
            let lane = self.map.lane(place.lane).filter(|lane| lane.kind.is_drivable())?;
            Some((off(lane, place.place.s_m, place.place.d_m)?, lane))
        });
        let bend_1pm = |lane: &Lane| self.bend_in_1pm(lane).abs();
        let nearest = places.min_by(|(a, a_lane), (b, b_lane)| {
            let bends = || bend_1pm(a_lane).total_cmp(&bend_1pm(b_lane));
            a.total_cmp(b).then_with(bends).then_with(|| a_lane.id.cmp(&b_lane.id))
        });
        nearest.map(|(_, lane)| lane.id)
    }

    /// True if a lane is one of the route's, or has its direction and is beside one of them.
    fn is_of(&self, route: &Route, lane: LaneId) -> bool {
        let Some(at) = self.map.lane(lane) else { return false };
        let beside = [Side::Left, Side::Right].into_iter().flat_map(|side| self.beside(at, side));
        let mut same = core::iter::once(lane).chain(beside);
        same.any(|lane| route.stretches().iter().any(|stretch| stretch.lane == lane))
    }

    /// True if the ego's route changes lanes within the way of a vehicle, and its own lane goes on for that long.
    fn stays(
        &mut self,
        changes: &[LaneChange],
        (lane, track): (LaneId, &Track),
        horizon: &Horizon,
        ego: &Route,
    ) -> bool {
        if changes.is_empty() {
            return false;
        }
        let way_m = track.velocity_mps.norm() * horizon.steps as f64 * horizon.step.as_secs();
        let s_m = place_of(ego, track.pose.point(), track.velocity_mps).s_m;
        let is_near = |change: &LaneChange| s_m < change.part_m[1] && change.part_m[0] < s_m + way_m;
        let goes_on = |own: &Route| {
            let begin_m = place_of(own, track.pose.point(), track.velocity_mps).s_m;
            begin_m + way_m < own.line().length()
        };
        changes.iter().any(is_near) && self.way(lane).is_some_and(goes_on)
    }

    /// Lanes of the same direction to one side of a lane.
    fn beside<'m>(&'m self, lane: &'m Lane, side: Side) -> impl Iterator<Item = LaneId> + 'm {
        let next = move |lane: &LaneId| {
            let lane = self.map.lane(*lane)?;
            let other = if side == Side::Left { lane.left } else { lane.right };
            other.filter(|other| !other.opposite).map(|other| other.lane)
        };
        core::iter::successors(Some(lane.id), next).skip(1).take(LANES_MAX)
    }

    /// Change of the curvature into a lane from its first predecessor, 1/m.
    fn bend_in_1pm(&self, lane: &Lane) -> f64 {
        let before = self.map.predecessors(lane.id).first().and_then(|id| self.map.lane(*id));
        begin_1pm(lane) - before.map_or(0.0, end_1pm)
    }

    /// The way from a lane on.
    fn way(&mut self, from: LaneId) -> Option<&Route> {
        let map = &self.map;
        self.ways.entry(from).or_insert_with(|| Route::along(map, &chain(map, from)).ok()).as_ref()
    }
}

/// Lanes from one on.
fn chain(map: &Map, from: LaneId) -> Vec<LaneId> {
    let next = |lane| {
        let change_1pm = |next: &Lane| Some((begin_1pm(next) - end_1pm(lane)).abs());
        map.best_successor(lane, change_1pm)
    };
    map.sequences(from, next).iter().flatten().map(|lane| lane.id).collect()
}

/// Mean curvature of the first metres of a lane, 1/m.
fn begin_1pm(lane: &Lane) -> f64 {
    mean_1pm(lane, [0.0, BEND_M.min(lane.line.length())])
}

/// Mean curvature of the last metres of a lane, 1/m.
fn end_1pm(lane: &Lane) -> f64 {
    let length_m = lane.line.length();
    mean_1pm(lane, [(length_m - BEND_M).max(0.0), length_m])
}

fn mean_1pm(lane: &Lane, [from_m, to_m]: [f64; 2]) -> f64 {
    let [begin, end] = [from_m, to_m].map(|s_m| lane.line.at(s_m).pose.heading_rad);
    angle_between(begin, end) / (to_m - from_m).max(1e-6)
}

fn is_along(route: &Route, track: &Track) -> bool {
    let place = place_of(route, track.pose.point(), track.velocity_mps);
    share_along(route, place, track.velocity_mps).is_some()
}

#[cfg(test)]
mod tests;
