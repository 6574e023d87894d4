//! Lanes of a map as traffic uses them: who may drive where, how fast, and where paths conflict.

mod ends;

use swerve_geom::{Point2, Polyline, angle_between};
use swerve_map::conflict;
use swerve_map::{Lane, LaneId, LaneKind, Map, Neighbour, Side, SignalId, StopSign};

use crate::setup::DriverParams;

pub(crate) use ends::End;
pub(crate) use swerve_map::conflict::Meeting;

/// Narrowest lane for cars, metres.
const WIDTH_MIN_M: f64 = 2.0;
/// Interval of the speed profile, metres.
const STEP_M: f64 = 2.0;
/// Half of the length over which curvature is averaged, metres.
const BEND_M: f64 = 3.0;

/// A line at which traffic stops.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct StopAt {
    pub(crate) s_m: f64,
    pub(crate) signals: Vec<SignalId>,
    pub(crate) sign: Option<StopSign>,
}

/// A conflict zone of a lane, with the other lane by index.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Zone {
    pub(crate) at_m: [f64; 2],
    pub(crate) other: usize,
    pub(crate) other_m: [f64; 2],
    pub(crate) meeting: Meeting,
    pub(crate) shift_m: Option<f64>,
    pub(crate) yields: bool,
}

/// A lane for vehicles.
#[derive(Clone, Debug)]
pub(crate) struct NetLane {
    pub(crate) id: LaneId,
    pub(crate) for_cars: bool,
    pub(crate) cycling: bool,
    pub(crate) line: Polyline,
    pub(crate) length_m: f64,
    pub(crate) width_m: f64,
    pub(crate) limit_mps: f64,
    pub(crate) next: Vec<usize>,
    pub(crate) before: Vec<usize>,
    /// Lanes for cars in the same direction, to the left and to the right.
    pub(crate) beside: [Option<usize>; 2],
    pub(crate) in_junction: bool,
    /// Lowest and highest coordinates of the line.
    pub(crate) bounds: [Point2; 2],
    /// True if it ends at the edge of the map.
    pub(crate) is_open: bool,
    /// Place that is closed to traffic.
    pub(crate) closed_m: Option<f64>,
    /// True if all ways from here, lane changes included, lead to closed places.
    pub(crate) is_blocked: bool,
    /// Speeds at intervals of [`STEP_M`] from which those further on are reached comfortably, for a driver whose desired
    /// speed is the limit, m/s.
    speeds_mps: Vec<f64>,
    pub(crate) stops: Vec<StopAt>,
    /// Ordered by begin.
    pub(crate) zones: Vec<Zone>,
    /// Crossings of the map and the part of the lane that each covers, metres.
    pub(crate) crossings: Vec<(usize, [f64; 2])>,
}

impl NetLane {
    /// Largest speed at a place, m/s.
    pub(crate) fn speed_mps(&self, s_m: f64) -> f64 {
        let k = (s_m.max(0.0) / STEP_M) as usize;
        self.speeds_mps[k.min(self.speeds_mps.len() - 1)]
    }

    /// Smallest of the speeds, m/s.
    pub(crate) fn slowest_mps(&self) -> f64 {
        self.speeds_mps.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// All lanes for vehicles, ordered by identity.
#[derive(Clone, Debug)]
pub(crate) struct Net {
    pub(crate) lanes: Vec<NetLane>,
}

impl Net {
    pub(crate) fn new(map: &Map, params: &DriverParams, closed: &[(LaneId, f64)]) -> Self {
        let used: Vec<&Lane> = map
            .lanes()
            .iter()
            .filter(|lane| matches!(lane.kind, LaneKind::Driving | LaneKind::Cycling))
            .collect();
        let index = |id: LaneId| used.binary_search_by_key(&id, |lane| lane.id).ok();
        let conflicts = map.conflicts();
        let zone = |zone: &conflict::Zone| {
            let conflict::Zone { at_m, other, other_m, meeting, shift_m, yields } = *zone;
            Some(Zone { at_m, other: index(other)?, other_m, meeting, shift_m, yields })
        };
        let lanes = used.iter().map(|lane| {
            let width_m = narrowest_m(lane);
            let beside = |neighbour: Option<Neighbour>| {
                let other = neighbour.filter(|other| !other.opposite)?.lane;
                let fits = |lane: &Lane| lane.kind == LaneKind::Driving && narrowest_m(lane) >= WIDTH_MIN_M;
                index(other).filter(|k| fits(used[*k]))
            };
            let limit_mps = lane.speed_limit_mps.filter(|limit| *limit > 0.5);
            let limit_mps = limit_mps.unwrap_or(params.default_limit_mps);
            let stops = map.stop_lines_of(lane.id).iter();
            NetLane {
                id: lane.id,
                for_cars: lane.kind == LaneKind::Driving && width_m >= WIDTH_MIN_M,
                cycling: lane.kind == LaneKind::Cycling,
                length_m: lane.line.length(),
                width_m,
                limit_mps,
                next: lane.successors.iter().filter_map(|id| index(*id)).collect(),
                before: map.predecessors(lane.id).iter().filter_map(|id| index(*id)).collect(),
                beside: [beside(lane.left), beside(lane.right)],
                in_junction: map.is_in_junction(lane.id),
                bounds: bounds(&lane.line),
                is_open: false,
                closed_m: None,
                is_blocked: false,
                speeds_mps: speeds_mps(&lane.line, limit_mps, params),
                stops: stops
                    .map(|stop| StopAt { s_m: stop.s_m, signals: stop.signals.clone(), sign: stop.sign })
                    .collect(),
                zones: conflicts.zones_of(lane.id).iter().filter_map(zone).collect(),
                crossings: Vec::new(),
                line: lane.line.clone(),
            }
        });
        let mut net = Self { lanes: lanes.collect() };
        net.find_ends(closed);
        for (k, crossing) in map.crossings().iter().enumerate() {
            for lane in &mut net.lanes {
                if let Some(part_m) = crossing.covered_m(&lane.line) {
                    lane.crossings.push((k, part_m));
                }
            }
        }
        net
    }

    pub(crate) fn lane(&self, k: usize) -> &NetLane {
        &self.lanes[k]
    }

    /// Lanes that continue one, for cars or for cyclists; only those that lead around closed places, if there are such.
    pub(crate) fn onward(&self, k: usize, cycles: bool) -> impl Iterator<Item = usize> {
        let next = &self.lanes[k].next;
        let fits = move |next: &usize| cycles || self.lanes[*next].for_cars;
        let is_blocked = next.iter().filter(|next| fits(next)).all(|next| self.lanes[*next].is_blocked);
        next.iter().copied().filter(move |next| fits(next) && (is_blocked || !self.lanes[*next].is_blocked))
    }
}

/// True if traffic of a lane may change to a side anywhere between two places.
pub(crate) fn may_change(lane: &Lane, side: Side, [from_m, to_m]: [f64; 2]) -> bool {
    let steps = ((to_m - from_m) / STEP_M).ceil().max(1.0);
    (0..=steps as usize).all(|k| lane.may_cross(side, from_m + (to_m - from_m) * k as f64 / steps))
}

fn bounds(line: &Polyline) -> [Point2; 2] {
    let points = line.points();
    let ends = |f: fn(f64, f64) -> f64| {
        points.iter().copied().reduce(|a, b| Point2::new(f(a.x_m, b.x_m), f(a.y_m, b.y_m)))
    };
    [ends(f64::min).unwrap_or_default(), ends(f64::max).unwrap_or_default()]
}

fn narrowest_m(lane: &Lane) -> f64 {
    let ends = [0.0, lane.line.length()];
    let stations = [lane.borders.left().stations(), lane.borders.right().stations()];
    let places = stations.into_iter().flatten().map(|station| station.s_m).chain(ends);
    places.map(|s_m| lane.width_m(s_m)).fold(f64::INFINITY, f64::min)
}

fn speeds_mps(line: &Polyline, limit_mps: f64, params: &DriverParams) -> Vec<f64> {
    let length_m = line.length();
    let heading_rad = |s_m: f64| line.at(s_m.clamp(0.0, length_m)).pose.heading_rad;
    let at = |k: usize| {
        let s_m = (k as f64 * STEP_M).min(length_m);
        let [from_m, to_m] = [(s_m - BEND_M).max(0.0), (s_m + BEND_M).min(length_m)];
        let turn_rad = angle_between(heading_rad(from_m), heading_rad(to_m)).abs();
        // The bend of a lane of a few metres cannot be measured on the lane alone.
        let bend_1pm = turn_rad / (to_m - from_m).max(STEP_M);
        limit_mps.min((params.lateral_mps2 / bend_1pm.max(1e-6)).sqrt()).max(1.5)
    };
    let count = (length_m / STEP_M).ceil() as usize + 1;
    let mut speeds: Vec<f64> = (0..count).map(at).collect();
    for k in (0..count - 1).rev() {
        let reached = speeds[k + 1] * speeds[k + 1] + 2.0 * 0.5 * params.brake_mps2 * STEP_M;
        speeds[k] = speeds[k].min(reached.sqrt());
    }
    speeds
}
