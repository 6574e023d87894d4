//! Vehicles by lane, at one tick.

use swerve_geom::{Obb, Vector2};
use swerve_msg::ActorKind;

use crate::car::Car;
use crate::net::Net;

/// Largest distance of a lead, metres.
const LEAD_MAX_M: f64 = 120.0;
/// Distance ahead at which bodies that are not ours are expected in zones, metres.
const COMING_M: f64 = 110.0;
/// Half of the width beside the centre line that must be free for a car to pass, metres.
const CLEAR_M: f64 = 1.15;

/// A road user that the traffic does not drive, or an object.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Other {
    pub(crate) body: Obb,
    pub(crate) velocity_mps: Vector2,
    pub(crate) kind: ActorKind,
    pub(crate) is_ego: bool,
}

/// A body on a lane.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct On {
    pub(crate) s_m: f64,
    pub(crate) half_m: f64,
    pub(crate) speed_mps: f64,
    /// Index of a car, or the number of cars plus the index of another body.
    pub(crate) who: usize,
}

/// A vehicle that will use a lane.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Coming {
    pub(crate) who: usize,
    /// Begin of the lane along its way, metres.
    pub(crate) begin_m: f64,
}

/// The vehicle ahead.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Lead {
    /// Between the bumpers, metres.
    pub(crate) gap_m: f64,
    pub(crate) speed_mps: f64,
    pub(crate) who: usize,
    /// Place of its centre along the way, metres.
    pub(crate) place_m: f64,
}

/// Bodies on each lane in order, and vehicles that are coming.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scene {
    on: Vec<Vec<On>>,
    coming: Vec<Vec<Coming>>,
    touched: Vec<usize>,
    /// Lanes with zones, and those just behind: only for these, it is known who is coming.
    is_listed: Vec<bool>,
    pub(crate) others: Vec<Other>,
    pub(crate) cars: usize,
}

impl Scene {
    pub(crate) fn new(net: &Net) -> Self {
        let has_zones = |lane: usize| !net.lane(lane).zones.is_empty();
        let is_listed = |lane: usize| has_zones(lane) || net.lane(lane).before.iter().any(|k| has_zones(*k));
        let is_listed = (0..net.lanes.len()).map(is_listed).collect();
        let count = net.lanes.len();
        Self { on: vec![Vec::new(); count], coming: vec![Vec::new(); count], is_listed, ..Self::default() }
    }

    /// Enters all vehicles.
    pub(crate) fn update(&mut self, net: &Net, cars: &[Car], others: Vec<Other>) {
        for lane in self.touched.drain(..) {
            self.on[lane].clear();
            self.coming[lane].clear();
        }
        self.cars = cars.len();
        self.others = others;
        for (who, car) in cars.iter().enumerate().filter(|(_, car)| !car.is_hit) {
            let body = On { s_m: car.s_m(), half_m: car.half_m(), speed_mps: car.speed_mps, who };
            self.put(car.lane(), body);
            if let Some(change) = car.change {
                self.put(change.from, On { s_m: car.x_m + change.offset_m, ..body });
            }
            // Its whole way: it may have grants as far ahead.
            for &(lane, begin_m) in &car.way {
                if self.is_listed[lane] {
                    self.coming[lane].push(Coming { who, begin_m });
                    self.touched.push(lane);
                }
            }
        }
        for k in 0..self.others.len() {
            self.enter_other(net, k);
        }
        for lane in &self.touched {
            self.on[*lane].sort_by(|a, b| a.s_m.total_cmp(&b.s_m).then(a.who.cmp(&b.who)));
        }
    }

    fn put(&mut self, lane: usize, body: On) {
        self.on[lane].push(body);
        self.touched.push(lane);
    }

    /// Enters a body on all lanes that it obstructs, and, if it moves along one, on those that it may reach.
    fn enter_other(&mut self, net: &Net, k: usize) {
        let Other { body, velocity_mps, .. } = self.others[k];
        let (center, reach_m) = (body.center.point(), body.radius() + CLEAR_M);
        let who = self.cars + k;
        for lane in 0..net.lanes.len() {
            let [low, high] = net.lane(lane).bounds;
            let is_apart = |low: f64, high: f64, at: f64| at < low - reach_m || at > high + reach_m;
            if is_apart(low.x_m, high.x_m, center.x_m) || is_apart(low.y_m, high.y_m, center.y_m) {
                continue;
            }
            let line = &net.lane(lane).line;
            let corners = body.corners().map(|corner| line.project(corner));
            let place = line.project(center);
            let ends = |f: fn(f64, f64) -> f64, value: fn(&swerve_geom::FrenetPoint) -> f64| {
                corners.iter().map(value).fold(value(&place), f)
            };
            let [left_m, right_m] = [ends(f64::max, |p| p.d_m), ends(f64::min, |p| p.d_m)];
            let [from_m, to_m] = [ends(f64::min, |p| p.s_m), ends(f64::max, |p| p.s_m)];
            let length_m = net.lane(lane).length_m;
            if right_m > CLEAR_M || left_m < -CLEAR_M || to_m < 0.0 || from_m > length_m {
                continue;
            }
            let speed_mps = velocity_mps.dot(line.at(place.s_m).pose.direction());
            let half_m = (0.5 * (to_m - from_m)).min(body.radius());
            self.put(lane, On { s_m: place.s_m, half_m, speed_mps: speed_mps.max(0.0), who });
            self.coming[lane].push(Coming { who, begin_m: -place.s_m });
            if speed_mps > 0.5 {
                self.announce(net, who, (lane, length_m - place.s_m));
            }
        }
    }

    /// Announces a moving body on all lanes that it may reach.
    fn announce(&mut self, net: &Net, who: usize, from: (usize, f64)) {
        let mut open = vec![from];
        let mut visited = Vec::new();
        while let Some((lane, end_m)) = open.pop() {
            for &next in &net.lane(lane).next {
                if end_m > COMING_M || visited.contains(&next) {
                    continue;
                }
                visited.push(next);
                self.coming[next].push(Coming { who, begin_m: end_m });
                self.touched.push(next);
                open.push((next, end_m + net.lane(next).length_m));
            }
        }
    }

    /// Vehicles that are on a lane or will use it.
    pub(crate) fn coming(&self, lane: usize) -> &[Coming] {
        &self.coming[lane]
    }

    /// Bodies on a part of a lane, in order.
    pub(crate) fn between(&self, lane: usize, [from_m, to_m]: [f64; 2]) -> impl Iterator<Item = &On> {
        let on = &self.on[lane];
        let begin = on.partition_point(|body| body.s_m <= from_m);
        on[begin..].iter().take_while(move |body| body.s_m < to_m)
    }

    /// First body beyond a place of a lane that is not `who`.
    fn ahead_on(&self, lane: usize, s_m: f64, who: usize) -> Option<On> {
        let on = &self.on[lane];
        let begin = on.partition_point(|body| (body.s_m, body.who) <= (s_m, who));
        on[begin..].iter().find(|body| body.who != who).copied()
    }

    /// Last body before a place of a lane that is not `who`.
    fn behind_on(&self, lane: usize, s_m: f64, who: usize) -> Option<On> {
        let on = &self.on[lane];
        let end = on.partition_point(|body| (body.s_m, body.who) <= (s_m, who));
        on[..end].iter().rev().find(|body| body.who != who).copied()
    }

    /// First body beyond a place, on a lane or the lanes that follow it. Its place counts from the begin of the lane.
    pub(crate) fn leader(&self, net: &Net, (lane, s_m): (usize, f64), who: usize) -> Option<On> {
        let mut open = vec![(lane, 0.0)];
        let mut nearest: Option<On> = None;
        while let Some((at, begin_m)) = open.pop() {
            let found = self.ahead_on(at, s_m - begin_m, who).map(|on| On { s_m: on.s_m + begin_m, ..on });
            if let Some(on) = found {
                nearest = Some(nearest.filter(|nearest| nearest.s_m <= on.s_m).unwrap_or(on));
                continue;
            }
            let end_m = begin_m + net.lane(at).length_m;
            if end_m - s_m < LEAD_MAX_M {
                open.extend(net.lane(at).next.iter().map(|next| (*next, end_m)));
            }
        }
        nearest
    }

    /// Last body before a place, on a lane or the lanes that lead to it. Its place counts from the begin of the lane.
    pub(crate) fn follower(&self, net: &Net, (lane, s_m): (usize, f64), who: usize) -> Option<On> {
        let mut open = vec![(lane, 0.0)];
        let mut nearest: Option<On> = None;
        while let Some((at, begin_m)) = open.pop() {
            let found = self.behind_on(at, s_m - begin_m, who).map(|on| On { s_m: on.s_m + begin_m, ..on });
            if let Some(on) = found {
                nearest = Some(nearest.filter(|nearest| nearest.s_m >= on.s_m).unwrap_or(on));
                continue;
            }
            if s_m - begin_m < LEAD_MAX_M {
                let before = &net.lane(at).before;
                open.extend(before.iter().map(|before| (*before, begin_m - net.lane(*before).length_m)));
            }
        }
        nearest
    }

    /// The nearest vehicle ahead on the way of a car, those on forks of it included while they are in the way.
    pub(crate) fn lead(&self, net: &Net, car: &Car, who: usize) -> Option<Lead> {
        self.leads(net, car, who).into_iter().reduce(|a, b| if b.gap_m < a.gap_m { b } else { a })
    }

    /// Vehicles ahead that a car regards: the first one on its way, those on forks of it while they are in the way, and
    /// the first one on a lane that it is leaving. One farther ahead may be the slower one.
    pub(crate) fn leads(&self, net: &Net, car: &Car, who: usize) -> Vec<Lead> {
        let mut leads = Vec::new();
        let mut offer = |body: On, place_m: f64| {
            let gap_m = place_m - body.half_m - car.x_m - car.half_m();
            leads.push(Lead { gap_m, speed_mps: body.speed_mps, who: body.who, place_m });
        };
        for &(lane, begin_m) in &car.way {
            if begin_m > car.x_m + LEAD_MAX_M {
                break;
            }
            for zone in &net.lane(lane).zones {
                // The bodies are beside each other only up to the end of the zone.
                let Some(shift_m) = zone.shift_m.filter(|_| begin_m + zone.at_m[1] >= car.x_m) else {
                    continue;
                };
                for body in self.on[zone.other].iter().take_while(|body| body.s_m <= zone.other_m[1]) {
                    let place_m = begin_m + shift_m + body.s_m;
                    if body.who != who && (place_m, body.who) > (car.x_m, who) {
                        offer(*body, place_m);
                    }
                }
            }
            if let Some(body) = self.ahead_on(lane, car.x_m - begin_m, who) {
                offer(body, begin_m + body.s_m);
                break;
            }
        }
        if let Some(change) = car.change
            && let Some(body) = self.ahead_on(change.from, car.x_m + change.offset_m, who)
        {
            offer(body, body.s_m - change.offset_m);
        }
        leads
    }
}
