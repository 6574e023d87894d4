//! Pavements around the corners of junctions, which maps often leave out.

use swerve_geom::{Point2, Polyline, angle_between};
use swerve_map::{Border, Borders, Lane, LaneId, LaneKind, Map, Side, Station as Width};

use super::side::{is_road, neighbour, outwards, sign};
use super::station::Strip;

/// Largest distance of two points of the line of a corner, metres.
const STEP_M: f64 = 1.0;
/// Most lanes inside a junction from one road to the next.
const LANES_MAX: usize = 16;

/// Pavement beside an end of a lane.
#[derive(Clone, Copy)]
struct Pavement {
    /// Distance from the border of the lane, metres.
    gap_m: f64,
    width_m: f64,
}

/// A way through a junction from a road with a pavement to another.
struct Corner<'m> {
    /// Lanes inside, in order.
    lanes: Vec<&'m Lane>,
    side: Side,
    /// Pavements before and after.
    ends: [Pavement; 2],
    /// Turn towards the pavement, radians.
    turn_rad: f64,
}

/// Lanes for pedestrians beside lanes inside junctions that lead from a road with a pavement to another. Of the ways that
/// begin at one lane, the one that turns most towards the pavement has it: the others lead across the junction.
pub(super) fn corners(map: &Map) -> Vec<Lane> {
    let is_inside =
        |id: LaneId| map.junctions_of(id).any(|junction| junction.lanes.binary_search(&id).is_ok());
    let mut found = Vec::new();
    for before in map.lanes().iter().filter(|lane| is_road(lane.kind) && !is_inside(lane.id)) {
        for side in [Side::Left, Side::Right] {
            let Some(pavement) = pavement(map, before, side, true) else { continue };
            let ways = before.successors.iter().filter_map(|first| way(map, *first, is_inside));
            let corners = ways.filter_map(|(lanes, after)| Corner::new(map, lanes, (pavement, after), side));
            let corner = corners.max_by(|a, b| a.turn_rad.total_cmp(&b.turn_rad));
            found.extend(corner.and_then(|corner| corner.pavement(LaneId(found.len() as u32))));
        }
    }
    found
}

/// Lanes inside a junction from one on, and the lane after them; `None` if there is none of both.
fn way(map: &Map, first: LaneId, is_inside: impl Fn(LaneId) -> bool) -> Option<(Vec<&Lane>, &Lane)> {
    let mut lanes = Vec::new();
    let mut next = map.lane(first)?;
    while is_inside(next.id) && lanes.len() < LANES_MAX {
        lanes.push(next);
        next = map.lane(*next.successors.first()?)?;
    }
    (!lanes.is_empty() && !is_inside(next.id)).then_some((lanes, next))
}

/// Pavement beside an end of a lane, beyond other lanes than those for driving.
fn pavement(map: &Map, lane: &Lane, side: Side, is_end: bool) -> Option<Pavement> {
    let mut gap_m = 0.0;
    for (next, is_along) in outwards(map, lane, side) {
        let width_m = next.width_m(if is_end == is_along { next.line.length() } else { 0.0 });
        match next.kind {
            LaneKind::Walking => return Some(Pavement { gap_m, width_m }),
            LaneKind::Driving => return None,
            _ => gap_m += width_m,
        }
    }
    None
}

impl<'m> Corner<'m> {
    fn new(map: &Map, lanes: Vec<&'m Lane>, (before, after): (Pavement, &Lane), side: Side) -> Option<Self> {
        if lanes.iter().any(|lane| neighbour(lane, side).is_some()) {
            return None;
        }
        let ends = [before, pavement(map, after, side, false)?];
        let [first, last] = [lanes.first()?, lanes.last()?];
        let from_rad = first.line.at(0.0).pose.heading_rad;
        let to_rad = last.line.at(last.line.length()).pose.heading_rad;
        Some(Self { lanes, side, ends, turn_rad: sign(side) * angle_between(from_rad, to_rad) })
    }

    fn pavement(&self, id: LaneId) -> Option<Lane> {
        let length_m: f64 = self.lanes.iter().map(|lane| lane.line.length()).sum();
        let along = |of: fn(&Pavement) -> f64, s_m: f64| {
            let [from, to] = self.ends.each_ref().map(of);
            from + (to - from) * (s_m / length_m)
        };
        let half_m = |s_m: f64| 0.5 * along(|end| end.width_m, s_m);
        let (mut points, mut begin_m): (Vec<Point2>, f64) = (Vec::new(), 0.0);
        for lane in &self.lanes {
            points.extend(Strip::new(lane).dense(STEP_M).iter().map(|station| {
                let s_m = begin_m + station.s_m;
                let out_m = along(|end| end.gap_m, s_m) + half_m(s_m);
                station.at(station.border_m(self.side) + sign(self.side) * out_m)
            }));
            begin_m += lane.line.length();
        }
        let line = Polyline::new(&points).ok()?;
        let ends = [(0.0, half_m(0.0)), (line.length(), half_m(length_m))];
        let border = Border::linear(&ends.map(|(s_m, distance_m)| Width { s_m, distance_m })).ok()?;
        let borders = Borders::new(border.clone(), border);
        Some(Lane { kind: LaneKind::Walking, ..Lane::new(id, line, borders) })
    }
}
