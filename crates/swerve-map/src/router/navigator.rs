//! The route of a drive, renewed while it is driven.

use std::sync::Arc;

use swerve_geom::{LineTracker, Pose2, angle_between};

use super::{Step, Stop, Way, find_over};
use crate::route::{beside, change_length_m};
use crate::{Lane, LaneId, LaneKind, Map, Route};

/// Distance beyond the borders of its lane from which the ego counts as off the route, metres, and the time for which it
/// has to be.
const OFF_LANE_M: f64 = 1.0;
const OFF_FOR_S: f64 = 1.0;
/// Largest difference between the heading of the ego and that of the lane from which a new route begins, radians.
const ALONG_RAD: f64 = 1.0;
/// Deceleration and reaction time of the way along the present route before a new one may part from it.
const EASE_MPS2: f64 = 2.0;
const REACTION_S: f64 = 1.0;
/// Largest number of lanes beside the route from which the ego returns to it.
const LANES_MAX: i32 = 4;
/// Distance within which a place on the map is on the route, metres.
const ON_ROUTE_M: f64 = 2.0;

/// Keeps the route of a drive over a map: finds another one if a place ahead is closed, or the ego has left it.
///
/// An ego that overtakes on a lane beside the route has not left it, as long as it can return before the lanes part.
/// The new route keeps the present one as far as the ego needs to slow down. If no other route leads to the destination,
/// the present one is kept.
#[derive(Clone, Debug)]
pub struct Navigator {
    map: Arc<Map>,
    route: Route,
    beyond_m: f64,
    speed_mps: f64,
    /// Places that the route still has to pass, with their arc lengths on it; the last is the destination.
    ahead: Vec<(Stop, f64)>,
    closed: Vec<Stop>,
    /// True until the closed places are compared with the route.
    is_news: bool,
    place: LineTracker,
    /// Instant since which the ego is off the route, seconds.
    off_since_s: Option<f64>,
}

impl Navigator {
    /// Creates a navigator for a route over `map` that leads over `stops`, of which the first is the start, and on for
    /// `beyond_m` metres, at `speed_mps` at most.
    pub fn new(map: Arc<Map>, route: Route, stops: &[Stop], beyond_m: f64, speed_mps: f64) -> Self {
        let mut navigator = Self {
            map,
            route,
            beyond_m,
            speed_mps,
            ahead: stops.iter().skip(1).map(|stop| (*stop, 0.0)).collect(),
            closed: Vec::new(),
            is_news: false,
            place: LineTracker::default(),
            off_since_s: None,
        };
        navigator.measure(0.0);
        navigator
    }

    /// The present route.
    pub fn route(&self) -> &Route {
        &self.route
    }

    /// Sets the places that are closed to traffic.
    pub fn close(&mut self, places: &[Stop]) {
        if self.closed != places {
            self.closed = places.to_vec();
            self.is_news = true;
        }
    }

    /// Updates the position of the ego at the instant `now_s`, in seconds. Returns true if there is a new route.
    pub fn update(&mut self, now_s: f64, pose: Pose2, speed_mps: f64) -> bool {
        let at = self.place.locate(self.route.line(), pose);
        self.ahead.retain(|(_, s_m)| *s_m > at.s_m);
        let lane = self.route.lane();
        let is_off = at.d_m > lane.left_m(at.s_m) + OFF_LANE_M || -at.d_m > lane.right_m(at.s_m) + OFF_LANE_M;
        self.off_since_s = is_off.then(|| self.off_since_s.unwrap_or(now_s));
        let has_left = self.off_since_s.is_some_and(|since_s| now_s - since_s >= OFF_FOR_S);
        let new = if has_left {
            let from = self.lane_at(pose).filter(|from| !self.returns(from.lane, at.s_m));
            from.and_then(|from| self.way(&[(Step::Begin, from.lane)], [from, from]))
        } else if core::mem::take(&mut self.is_news) && self.is_closed_after(at.s_m) {
            let commit_m = speed_mps * REACTION_S + 0.5 * speed_mps * speed_mps / EASE_MPS2;
            [commit_m, 0.0].into_iter().find_map(|ahead_m| self.way_after([at.s_m, at.s_m + ahead_m]))
        } else {
            None
        };
        let over = |way| Route::over(&self.map, &way, self.beyond_m, self.speed_mps).ok();
        let Some((route, _)) = new.and_then(over) else {
            return false;
        };
        self.route = route;
        (self.place, self.off_since_s) = (LineTracker::default(), None);
        let here_m = self.place.locate(self.route.line(), pose).s_m;
        self.measure(here_m);
        true
    }

    /// Sets the arc lengths of the places ahead, in order from `from_m` on.
    fn measure(&mut self, mut from_m: f64) {
        for k in 0..self.ahead.len() {
            from_m = self.place_after(self.ahead[k].0, from_m).unwrap_or(from_m);
            self.ahead[k].1 = from_m;
        }
    }

    /// Arc length of a place of the map on the route, at or after `from_m`; `None` if it is not there.
    fn place_after(&self, stop: Stop, from_m: f64) -> Option<f64> {
        let point = self.map.lane(stop.lane)?.line.at(stop.s_m).pose.point();
        let stretches = self.route.stretches();
        let on = |(k, stretch): (usize, &crate::Stretch)| {
            let end_m = stretches.get(k + 1).map_or(self.route.line().length(), |next| next.begin_m);
            if stretch.lane != stop.lane || end_m < from_m {
                return None;
            }
            let half_m = 0.5 * (end_m - stretch.begin_m);
            let at = self.route.project_near(point, stretch.begin_m + half_m, half_m);
            (at.d_m.abs() < ON_ROUTE_M && at.s_m >= from_m).then_some(at.s_m)
        };
        stretches.iter().enumerate().find_map(on)
    }

    /// Returns true if a closed place is on the route between `from_m` and the destination.
    fn is_closed_after(&self, from_m: f64) -> bool {
        let goal_m = self.ahead.last().map_or(f64::INFINITY, |(_, s_m)| *s_m);
        self.closed.iter().any(|stop| self.place_after(*stop, from_m).is_some_and(|s_m| s_m <= goal_m))
    }

    /// Returns true if the ego can return to the route from a lane beside it, such as that on which it overtakes.
    fn returns(&self, from: LaneId, s_m: f64) -> bool {
        let stretches = self.route.stretches_from(s_m);
        let lane = |k: usize| self.map.lane(stretches.get(k)?.lane);
        // At a joint, either lane can be that of the ego.
        let joins = |a: &Lane, b: LaneId| a.id == b || a.successors.contains(&b);
        let is_from =
            |lane: &Lane| joins(lane, from) || self.map.lane(from).is_some_and(|from| joins(from, lane.id));
        let on =
            |across: i32| Some((across, beside(&self.map, lane(0)?, across).filter(|lane| is_from(lane))?));
        let Some((across, mut aside)) = (1..=LANES_MAX).flat_map(|count| [count, -count]).find_map(on) else {
            return false;
        };
        let mut k = 0;
        while let Some(next) = lane(k + 1).and_then(|next| beside(&self.map, next, across))
            && aside.successors.contains(&next.id)
        {
            (k, aside) = (k + 1, next);
        }
        let end_m = stretches.get(k + 1).map_or(self.route.line().length(), |next| next.begin_m);
        let speed_mps =
            stretches[k].speed_limit_mps.map_or(self.speed_mps, |limit| limit.min(self.speed_mps));
        end_m - s_m > f64::from(across.abs()) * change_length_m(speed_mps)
    }

    /// Driving lane at a pose: that with the most similar heading.
    fn lane_at(&self, pose: Pose2) -> Option<Stop> {
        let turned_rad = |stop: &Stop| {
            let lane = self.map.lane(stop.lane).map(|lane| lane.line.at(stop.s_m).pose.heading_rad);
            lane.map_or(f64::INFINITY, |lane| angle_between(lane, pose.heading_rad).abs())
        };
        let is_driving = |id| self.map.lane(id).is_some_and(|lane| lane.kind == LaneKind::Driving);
        let stops = self.map.at(pose.point()).filter(|at| is_driving(at.lane));
        let stops = stops.map(|at| Stop { lane: at.lane, s_m: at.place.s_m });
        let nearest =
            stops.min_by(|a, b| turned_rad(a).total_cmp(&turned_rad(b)).then(a.lane.cmp(&b.lane)))?;
        (turned_rad(&nearest) < ALONG_RAD).then_some(nearest)
    }

    /// Place on the map at an arc length of the route.
    fn stop_at(&self, s_m: f64) -> Option<Stop> {
        let lane = self.map.lane(self.route.stretch_at(s_m)?.lane)?;
        let at = lane.line.project(self.route.line().at(s_m).pose.point()).s_m;
        Some(Stop { lane: lane.id, s_m: at.clamp(0.0, lane.line.length()) })
    }

    /// Way from arc length `here_m` of the route along it to `parts_m`, and from there by another route.
    fn way_after(&self, [here_m, parts_m]: [f64; 2]) -> Option<Way> {
        let stretches = self.route.stretches().iter();
        let begun = stretches.clone().filter(|x| x.begin_m <= here_m).count().max(1) - 1;
        let kept = stretches.skip(begun).take_while(|x| x.begin_m <= parts_m.max(here_m));
        let mut lanes: Vec<(Step, LaneId)> = Vec::new();
        let (mut via, mut begin_m) = (Vec::new(), here_m);
        for stretch in kept {
            let step = match lanes.last() {
                None => Step::Begin,
                Some((_, before)) => self.step(*before, stretch.lane)?,
            };
            // Between two changes the route is on the lane between them.
            if step.is_change() && lanes.last().is_some_and(|(before, _)| before.is_change()) {
                via.push((lanes.len() - 1, self.stop_at(0.5 * (begin_m + stretch.begin_m))?.s_m));
            }
            begin_m = stretch.begin_m;
            lanes.push((step, stretch.lane));
        }
        let mut way = self.way(&lanes, [self.stop_at(here_m)?, self.stop_at(parts_m)?])?;
        way.via.splice(..0, via);
        Some(way)
    }

    /// Step from a lane to the next one of a route.
    fn step(&self, from: LaneId, to: LaneId) -> Option<Step> {
        let lane = self.map.lane(from)?;
        let is_beside = |beside: Option<crate::Neighbour>| beside.is_some_and(|beside| beside.lane == to);
        Some(match () {
            () if lane.successors.contains(&to) => Step::Follow,
            () if is_beside(lane.left) => Step::ChangeLeft,
            () if is_beside(lane.right) => Step::ChangeRight,
            () => return None,
        })
    }

    /// Way over the lanes `kept` from the first place to the second, and from there over the places ahead.
    fn way(&self, kept: &[(Step, LaneId)], [from, parts]: [Stop; 2]) -> Option<Way> {
        let stops: Vec<Stop> = [parts].into_iter().chain(self.ahead.iter().map(|(stop, _)| *stop)).collect();
        let mut way = find_over(&self.map, &stops, &self.closed).ok()?;
        way.lanes.splice(..1, kept.iter().copied());
        way.via.iter_mut().for_each(|(k, _)| *k += kept.len() - 1);
        way.ends_m[0] = from.s_m;
        Some(way)
    }
}

#[cfg(test)]
mod tests;
