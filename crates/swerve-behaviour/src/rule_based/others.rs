//! Other vehicles on the lanes of the map, and the lanes that they may reach.

use std::collections::BTreeMap;

use swerve_core::Time;
use swerve_geom::{Pose2, angle_between};
use swerve_map::LaneId;
use swerve_msg::{ActorId, ActorKind, Prediction};

use super::block::{OnLane, is_for_vehicles};
use super::entry::needed_mps2;
use crate::{Roads, Situation};

/// Distance ahead at which vehicles are expected on lanes, metres.
const REACH_M: f64 = 100.0;
/// Largest angle between a vehicle and its lane, radians.
const ALONG_RAD: f64 = 0.7;
/// Weight of that angle, metres per radian, and the difference to the best lane up to which a vehicle counts on
/// another one, too, metres.
const ANGLE_M: f64 = 4.0;
const SIMILAR_M: f64 = 0.7;
/// Distance over a stop line from which a vehicle has passed it, metres.
const PASSED_M: f64 = 1.0;
/// Speed below which a vehicle is at rest, m/s.
pub(super) const REST_MPS: f64 = 0.3;
/// Time over which accelerations are averaged, seconds.
const MEAN_S: f64 = 0.5;
/// Time for which a vehicle is expected to go on speeding up, seconds, from this mean acceleration on, m/s²; shorter
/// below.
const GOES_ON_S: f64 = 0.5;
const SPEEDS_UP_MPS2: f64 = 0.6;

/// A lane that a vehicle is on or may reach.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    lane: LaneId,
    /// Distance from its centre to the begin of the lane, metres; negative on the lane.
    pub(super) to_m: f64,
    /// True if a stop line with signals is before it.
    pub(super) has_light: bool,
}

/// A vehicle.
#[derive(Clone, Debug)]
pub(super) struct Vehicle {
    pub(super) id: ActorId,
    pub(super) kind: ActorKind,
    /// Pose of its centre.
    pub(super) pose: Pose2,
    pub(super) half_m: f64,
    pub(super) speed_mps: f64,
    /// Mean acceleration, m/s².
    pub(super) gain_mps2: f64,
    /// Time at rest, seconds.
    pub(super) stands_s: f64,
    /// Place of its centre along the route, if it is on a lane of the route, metres.
    pub(super) route_m: Option<f64>,
    /// Ordered by lane.
    reaches: Vec<Reach>,
}

impl Vehicle {
    /// The lane, if the vehicle is on it or may reach it.
    pub(super) fn reach(&self, lane: LaneId) -> Option<&Reach> {
        let found = self.reaches.binary_search_by_key(&lane, |reach| reach.lane);
        found.ok().map(|index| &self.reaches[index])
    }

    /// Place of its centre on a lane, metres; `None` if it is not there.
    pub(super) fn on_m(&self, lane: LaneId) -> Option<f64> {
        self.reach(lane).filter(|reach| reach.to_m <= 0.0).map(|reach| -reach.to_m)
    }

    /// Deceleration with which the vehicle stops within a distance, m/s². One that speeds up goes on with it at first.
    pub(super) fn needed_mps2(&self, within_m: f64) -> f64 {
        let goes_on_s = GOES_ON_S * (self.gain_mps2 / SPEEDS_UP_MPS2).clamp(0.0, 1.0);
        let gained_mps = self.gain_mps2 * goes_on_s;
        let way_m = (self.speed_mps + 0.5 * gained_mps) * goes_on_s;
        needed_mps2(self.speed_mps + gained_mps, within_m - way_m)
    }
}

/// Motion of a vehicle up to the last frame.
#[derive(Clone, Copy, Debug)]
struct Past {
    at: Time,
    speed_mps: f64,
    gain_mps2: f64,
    stands_s: f64,
}

/// Memory of all vehicles in sight.
#[derive(Clone, Debug, Default)]
pub(super) struct Others {
    past: BTreeMap<ActorId, Past>,
}

impl Others {
    /// Vehicles of a frame, ordered by identity.
    pub(super) fn update(&mut self, at: &Situation<'_>, roads: Roads<'_>, lanes: &[OnLane]) -> Vec<Vehicle> {
        let mut past = BTreeMap::new();
        let mut vehicles = Vec::new();
        for modes in Prediction::by_actor(at.predictions) {
            let Some(one) = Prediction::likeliest(modes).filter(|one| is_vehicle(one)) else { continue };
            let Some(first) = one.path.first() else { continue };
            let speed_mps = speed_mps(one);
            let now = self.moved(one.id, at.stamp, speed_mps);
            past.insert(one.id, now);
            let half_m = 0.5 * one.extent.length_m;
            let on = places(roads, first.pose);
            vehicles.push(Vehicle {
                id: one.id,
                kind: one.kind,
                pose: first.pose,
                half_m,
                speed_mps,
                gain_mps2: now.gain_mps2,
                stands_s: now.stands_s,
                route_m: route_m(lanes, &on, at.place.s_m),
                reaches: reaches(roads, &on, half_m),
            });
        }
        self.past = past;
        vehicles
    }

    fn moved(&self, id: ActorId, at: Time, speed_mps: f64) -> Past {
        let Some(past) = self.past.get(&id).filter(|past| past.at < at) else {
            return Past { at, speed_mps, gain_mps2: 0.0, stands_s: 0.0 };
        };
        let dt_s = (at - past.at).as_secs();
        let share = dt_s / (dt_s + MEAN_S);
        let gain_mps2 = past.gain_mps2 + share * ((speed_mps - past.speed_mps) / dt_s - past.gain_mps2);
        let stands_s = if speed_mps < REST_MPS { past.stands_s + dt_s } else { 0.0 };
        Past { at, speed_mps, gain_mps2, stands_s }
    }
}

fn is_vehicle(one: &Prediction) -> bool {
    let moves =
        matches!(one.kind, ActorKind::Car | ActorKind::Truck | ActorKind::Motorcycle | ActorKind::Cyclist);
    moves && one.is_plausible()
}

/// Present speed of a road user, m/s.
pub(super) fn speed_mps(one: &Prediction) -> f64 {
    let [first, next, ..] = &one.path[..] else { return 0.0 };
    let dt_s = (next.at - first.at).as_secs();
    if dt_s > 0.0 { first.pose.point().distance(next.pose.point()) / dt_s } else { 0.0 }
}

/// Lanes that a vehicle is on, and its places along them.
fn places(roads: Roads<'_>, pose: Pose2) -> Vec<(LaneId, f64)> {
    let mut found: Vec<(f64, LaneId, f64)> = Vec::new();
    for on in roads.map.at(pose.point()) {
        let Some(lane) = roads.map.lane(on.lane).filter(|lane| is_for_vehicles(lane)) else { continue };
        let off_rad = angle_between(lane.line.at(on.place.s_m).pose.heading_rad, pose.heading_rad).abs();
        if off_rad < ALONG_RAD {
            found.push((on.place.d_m.abs() + ANGLE_M * off_rad, on.lane, on.place.s_m));
        }
    }
    let best_m = found.iter().map(|(off_m, ..)| *off_m).fold(f64::INFINITY, f64::min);
    let is_similar = |(off_m, ..): &(f64, LaneId, f64)| *off_m <= best_m + SIMILAR_M;
    found.into_iter().filter(is_similar).map(|(_, lane, s_m)| (lane, s_m)).collect()
}

/// Place along the route, the nearest to the ego of several.
fn route_m(lanes: &[OnLane], on: &[(LaneId, f64)], ego_m: f64) -> Option<f64> {
    let mut nearest: Option<f64> = None;
    for (lane, s_m) in on {
        for part in lanes.iter().filter(|part| part.lane == *lane) {
            let at_m = part.offset_m + s_m;
            let is_on = (part.from_m..=part.to_m).contains(&at_m);
            if is_on && nearest.is_none_or(|known_m| (at_m - ego_m).abs() < (known_m - ego_m).abs()) {
                nearest = Some(at_m);
            }
        }
    }
    nearest
}

/// Lanes that a vehicle may reach, by the shortest way to each.
fn reaches(roads: Roads<'_>, on: &[(LaneId, f64)], half_m: f64) -> Vec<Reach> {
    let mut found: BTreeMap<LaneId, Reach> = BTreeMap::new();
    let mut open: Vec<Reach> =
        on.iter().map(|(lane, s_m)| Reach { lane: *lane, to_m: -s_m, has_light: false }).collect();
    while let Some(reach) = open.pop() {
        if found.get(&reach.lane).is_some_and(|known| known.to_m <= reach.to_m) {
            continue;
        }
        found.insert(reach.lane, reach);
        let Some(lane) = roads.map.lane(reach.lane) else { continue };
        let end_m = reach.to_m + lane.line.length();
        if end_m > REACH_M {
            continue;
        }
        let lines = roads.map.stop_lines_of(reach.lane).iter();
        let mut ahead = lines.filter(|line| reach.to_m + line.s_m > half_m - PASSED_M);
        let has_light = reach.has_light || ahead.any(|line| !line.signals.is_empty());
        open.extend(lane.successors.iter().map(|next| Reach { lane: *next, to_m: end_m, has_light }));
    }
    found.into_values().collect()
}
