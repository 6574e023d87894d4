//! Conflict zones and crossings along a route.

use core::f64::consts::PI;

use swerve_geom::{Polyline, angle_between};
use swerve_map::conflict::{Meeting, Zone};
use swerve_map::{Lane, LaneId, LaneKind, Map, Route, StopSign, Stretch};

use crate::Roads;

/// Zones closer than a vehicle and its gaps are passed together, metres.
const ROOM_M: f64 = 9.0;
/// Largest distances of a stop line before the zones that it is for, and beyond their begin, metres.
const LINE_M: [f64; 2] = [25.0, 6.0];
/// Gap left before zones, metres, and before crossings.
pub(super) const ZONE_GAP_M: f64 = 0.4;
const CROSSING_GAP_M: f64 = 1.5;
/// Largest distance of a crossing from the route, metres.
const CROSSING_MAX_M: f64 = 40.0;
/// Lateral acceleration with which the ego takes bends, and the largest one that is expected of others, m/s².
const LATERAL_MPS2: f64 = 3.0;
const OTHERS_LATERAL_MPS2: f64 = 4.0;
/// Smallest speed in bends, m/s, and the interval of samples, metres.
const BEND_MIN_MPS: f64 = 2.0;
const STEP_M: f64 = 2.0;
/// Smallest angle between oncoming lanes, radians.
const ONCOMING_RAD: f64 = 0.75 * PI;

/// A conflict zone of the route. Places are arc lengths of the ego's centre along the route.
#[derive(Clone, Debug)]
pub(super) struct RouteZone {
    pub(super) at_m: [f64; 2],
    pub(super) zone: Zone,
    /// True if the other lane begins in about the opposite direction.
    pub(super) is_oncoming: bool,
    /// Speed at which bends and limits let traffic of the other lane pass, m/s.
    pub(super) other_mps: f64,
}

/// Zones that are passed without a stop between them.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Place before which the front of the ego waits.
    pub(super) stop_m: f64,
    pub(super) begin_m: f64,
    pub(super) end_m: f64,
    pub(super) zones: Vec<RouteZone>,
    /// True if it must come to rest before.
    pub(super) has_stop_sign: bool,
    /// Stop line with signals.
    pub(super) light_m: Option<f64>,
    /// Speed at which bends and limits let the ego pass, m/s.
    pub(super) cruise_mps: f64,
}

/// A crossing of the route.
#[derive(Clone, Debug)]
pub(super) struct RouteCrossing {
    /// Index of the crossing in the map.
    pub(super) index: usize,
    /// Part of the route that it covers.
    pub(super) at_m: [f64; 2],
    /// Place before which the front of the ego waits.
    pub(super) stop_m: f64,
    pub(super) cruise_mps: f64,
}

/// A lane of the route.
#[derive(Clone, Copy, Debug)]
pub(super) struct OnLane {
    pub(super) lane: LaneId,
    /// Part of the route that is on it.
    pub(super) from_m: f64,
    pub(super) to_m: f64,
    /// Arc length along the route less that along the lane, metres.
    pub(super) offset_m: f64,
}

/// Lanes of a route in order.
pub(super) fn lanes(route: &Route, map: &Map) -> Vec<OnLane> {
    let stretches = route.stretches();
    let on_lane = |(k, stretch): (usize, &Stretch)| {
        let from_m = stretch.begin_m;
        let to_m = stretches.get(k + 1).map_or(route.line().length(), |next| next.begin_m);
        // After a lane change, the stretch does not begin where the lane does.
        let lane = map.lane(stretch.lane)?;
        let begins_m = lane.line.project(route.line().at(from_m).pose.point()).s_m;
        Some(OnLane { lane: stretch.lane, from_m, to_m, offset_m: from_m - begins_m })
    };
    stretches.iter().enumerate().filter_map(on_lane).collect()
}

/// Blocks of zones of a route, the nearest first, for an ego with this distance from its centre to its front.
pub(super) fn blocks(route: &Route, lanes: &[OnLane], roads: Roads<'_>, half_m: f64) -> Vec<Block> {
    let begin_rad = |lane: LaneId| Some(roads.map.lane(lane)?.line.at(0.0).pose.heading_rad);
    let mut zones: Vec<RouteZone> = Vec::new();
    for on in lanes {
        let all = roads.conflicts.zones_of(on.lane).iter();
        for zone in all.filter(|zone| zone.meeting != Meeting::Fork) {
            let at_m = zone.at_m.map(|s_m| on.offset_m + s_m);
            let is_oncoming = begin_rad(on.lane)
                .zip(begin_rad(zone.other))
                .is_some_and(|(own_rad, other_rad)| angle_between(own_rad, other_rad).abs() > ONCOMING_RAD);
            if at_m[1] > on.from_m && at_m[0] < on.to_m {
                let other_mps = roads.map.lane(zone.other).map_or(f64::INFINITY, lane_mps);
                zones.push(RouteZone { at_m, zone: *zone, is_oncoming, other_mps });
            }
        }
    }
    zones.sort_by(|a, b| a.at_m[0].total_cmp(&b.at_m[0]));
    let mut blocks: Vec<Block> = Vec::new();
    for zone in zones {
        let [begin_m, end_m] = zone.at_m;
        match blocks.last_mut().filter(|block| begin_m - block.end_m < ROOM_M) {
            Some(block) => {
                block.end_m = block.end_m.max(end_m);
                block.zones.push(zone);
            }
            None => blocks.push(Block {
                stop_m: begin_m + half_m - ZONE_GAP_M,
                begin_m,
                end_m,
                zones: vec![zone],
                has_stop_sign: false,
                light_m: None,
                cruise_mps: f64::INFINITY,
            }),
        }
    }
    let mut after_m = f64::NEG_INFINITY;
    for block in &mut blocks {
        block.cruise_mps = cruise_mps(route, [block.begin_m, block.end_m]);
        take_lines(block, lanes, roads.map, after_m + half_m);
        after_m = block.end_m;
    }
    blocks
}

/// Moves the place to wait to the first stop line of a block, beyond `after_m`.
fn take_lines(block: &mut Block, lanes: &[OnLane], map: &Map, after_m: f64) {
    let begin_m = block.stop_m;
    for on in lanes {
        for line in map.stop_lines_of(on.lane) {
            let s_m = on.offset_m + line.s_m;
            let is_on = (on.from_m..on.to_m).contains(&s_m);
            if !is_on || s_m < begin_m - LINE_M[0] || s_m > begin_m + LINE_M[1] || s_m < after_m {
                continue;
            }
            block.stop_m = block.stop_m.min(s_m);
            block.has_stop_sign |= line.sign == Some(StopSign::Stop) && line.signals.is_empty();
            if !line.signals.is_empty() {
                block.light_m = block.light_m.or(Some(s_m));
            }
        }
    }
}

/// Crossings of a route, the nearest first.
pub(super) fn crossings(route: &Route, roads: Roads<'_>) -> Vec<RouteCrossing> {
    let mut found = Vec::new();
    for (index, crossing) in roads.map.crossings().iter().enumerate() {
        let Some(first) = crossing.outline.first() else { continue };
        if route.project(*first).d_m.abs() > CROSSING_MAX_M {
            continue;
        }
        let Some(at_m) = crossing.covered_m(route.line()) else { continue };
        let cruise_mps = cruise_mps(route, at_m);
        found.push(RouteCrossing { index, at_m, stop_m: at_m[0] - CROSSING_GAP_M, cruise_mps });
    }
    found.sort_by(|a, b| a.stop_m.total_cmp(&b.stop_m));
    found
}

/// Largest speed on a part of a route by its bends and limits, m/s.
fn cruise_mps(route: &Route, part_m: [f64; 2]) -> f64 {
    let limit_mps = |s_m| route.stretch_at(s_m).and_then(|stretch| stretch.speed_limit_mps);
    slowest_mps(route.line(), part_m, LATERAL_MPS2, limit_mps)
}

/// Largest speed on a lane by its bends and limit, m/s.
fn lane_mps(lane: &Lane) -> f64 {
    slowest_mps(&lane.line, [0.0, lane.line.length()], OTHERS_LATERAL_MPS2, |_| lane.speed_limit_mps)
}

fn slowest_mps(
    line: &Polyline,
    [from_m, to_m]: [f64; 2],
    lateral_mps2: f64,
    limit_mps: impl Fn(f64) -> Option<f64>,
) -> f64 {
    let steps = ((to_m - from_m) / STEP_M).ceil().max(1.0);
    let places = (0..=steps as usize).map(|k| from_m + (to_m - from_m) * k as f64 / steps);
    let at = |s_m: f64| {
        let bend_1pm = line.at(s_m.clamp(0.0, line.length())).curvature_1pm.abs();
        let bend_mps = (lateral_mps2 / bend_1pm.max(1e-6)).sqrt().max(BEND_MIN_MPS);
        bend_mps.min(limit_mps(s_m).unwrap_or(f64::INFINITY))
    };
    places.map(at).fold(f64::INFINITY, f64::min)
}

/// True if vehicles use a lane.
pub(super) fn is_for_vehicles(lane: &Lane) -> bool {
    matches!(lane.kind, LaneKind::Driving | LaneKind::Cycling)
}
