//! Vertices of lanes: positions along a road, centre lines and borders at them.

use swerve_geom::{Point2, math};
use swerve_map::{Border, Borders, Station};

use super::{CHORD_M, STEP_M, VERTICES_MAX};
use crate::cubic::begins;
use crate::opendrive::{LaneEdges, LaneSection, Network, Road};

/// Shortest distance of vertices along the road, metres.
const STEP_MIN_M: f64 = 0.05;

/// Distance from the ends of a section at which it is evaluated, metres: a record that begins at its end does not hold.
const INSIDE_M: f64 = 1e-9;

/// Vertices closer than this are one, metres; as in `Polyline::new`.
const SAME_M: f64 = 1e-6;

/// Positions along the road at which the lanes of a section have vertices, metres; `None` for more than
/// [`VERTICES_MAX`].
pub(crate) fn stations(road: &Road, section: &LaneSection, [from_m, to_m]: [f64; 2]) -> Option<Vec<f64>> {
    let (first, last) = (from_m + INSIDE_M, to_m - INSIDE_M);
    if first >= last {
        return Some(Vec::new());
    }
    let range_m = [first, last];
    let mut breaks: Vec<f64> = begins(&road.line.0, |piece| piece.s_m, range_m).collect();
    breaks.extend(road.lane_offset.begins(range_m));
    breaks.extend(road.superelevation.begins(range_m));
    breaks.extend(begins(&road.lateral.shapes, |(s_m, _)| *s_m, range_m));
    section.lanes().for_each(|lane| breaks.extend(lane.records().begins(range_m)));
    breaks.push(last);
    breaks.sort_by(f64::total_cmp);
    breaks.dedup_by(|b, a| *b - *a < SAME_M);
    let mut stations = vec![first];
    let mut begin = first;
    for end in breaks {
        // Before the record that begins here, in case it is a step.
        let before = if end < last { end - INSIDE_M } else { end };
        let steps = ((before - begin) / step_m(road, section, [begin, before])).ceil().max(1.0) as usize;
        if stations.len() + steps > VERTICES_MAX {
            return None;
        }
        stations.extend((1..=steps).map(|k| begin + (before - begin) * (k as f64 / steps as f64)));
        if end < last {
            stations.push(end);
        }
        begin = end;
    }
    Some(stations)
}

/// Distance of vertices that keeps chords within [`CHORD_M`] of every border.
fn step_m(road: &Road, section: &LaneSection, [from_m, to_m]: [f64; 2]) -> f64 {
    let mut bend_1pm = 0.0_f64;
    for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let s_m = from_m + share * (to_m - from_m);
        let curvature = road.pose(s_m).curvature_1pm.abs();
        let (mut lateral_m, mut sideways_1pm) = (0.0_f64, 0.0_f64);
        for is_left in [true, false] {
            for (_, LaneEdges { inner, outer }) in road.edges(section, is_left, s_m) {
                lateral_m = lateral_m.max(inner.t_m.abs()).max(outer.t_m.abs());
                sideways_1pm = sideways_1pm.max(inner.bend_1pm.abs()).max(outer.bend_1pm.abs());
            }
        }
        bend_1pm = bend_1pm.max(curvature * (1.0 + curvature * lateral_m) + sideways_1pm);
    }
    if bend_1pm * STEP_M * STEP_M <= 8.0 * CHORD_M {
        return STEP_M;
    }
    (8.0 * CHORD_M / bend_1pm).sqrt().max(STEP_MIN_M)
}

/// Vertices of a lane, in the direction of s.
pub(super) struct Strip {
    vertices: Vec<Vertex>,
}

/// Centre of a lane, and the distances of its borders across the centre line.
#[derive(Clone, Copy)]
struct Vertex {
    /// Position along the road, metres.
    s_m: f64,
    at: Point2,
    /// In the direction of s.
    left_m: f64,
    right_m: f64,
}

/// Vertices of all lanes of a section: those to the left from inside to outside, then those to the right.
pub(super) fn strips(network: &Network, road: &Road, section: &LaneSection, stations: &[f64]) -> Vec<Strip> {
    let count = section.left.len() + section.right.len();
    let strip = |_| Strip { vertices: Vec::with_capacity(stations.len()) };
    let mut strips: Vec<Strip> = (0..count).map(strip).collect();
    for &s_m in stations {
        let pose = road.pose(s_m);
        let (sin, cos) = math::sin_cos(pose.heading_rad);
        let sides = [true, false].into_iter().flat_map(|is_left| road.edges(section, is_left, s_m));
        for (strip, (lane, edges)) in strips.iter_mut().zip(sides) {
            let [inner, outer] = [edges.inner, edges.outer].map(|edge| road.lateral(s_m, edge));
            let (left, right) = if lane.id > 0 { (outer, inner) } else { (inner, outer) };
            let center = (0.5 * (left.0 + right.0), 0.5 * (left.1 + right.1));
            let (x, y) = (pose.x_m - center.0 * sin, pose.y_m + center.0 * cos);
            let [x_m, y_m, _] = network.projected([x, y, 0.0]);
            let across = |border: (f64, f64)| across_m(pose.curvature_1pm, center, border);
            let at = Point2::new(x_m, y_m);
            strip.push(Vertex { s_m, at, left_m: across(left), right_m: across(right) });
        }
    }
    strips
}

/// Distance of a border across the centre line of its lane, from the lateral positions and slopes of both, metres.
///
/// The normal of a centre line with slope c meets a border of slope b, a distance h along t away, at
/// h sqrt(1 + c²) / (1 + b c).
fn across_m(curvature_1pm: f64, center: (f64, f64), border: (f64, f64)) -> f64 {
    let half_m = (border.0 - center.0).abs();
    if center.1 == 0.0 {
        return half_m;
    }
    let slope = |(lateral_m, slope): (f64, f64)| slope / (1.0 - curvature_1pm * lateral_m).max(0.1);
    let (b, c) = (slope(border), slope(center));
    half_m * math::hypot(1.0, c) / (1.0 + b * c).max(0.1)
}

impl Strip {
    fn push(&mut self, vertex: Vertex) {
        match self.vertices.last_mut() {
            // Of two at one place, the later, except at the begin.
            Some(last) if last.at.distance(vertex.at) <= SAME_M => {
                (last.left_m, last.right_m) = (vertex.left_m, vertex.right_m);
            }
            _ => self.vertices.push(vertex),
        }
    }

    /// Vertices in the direction of travel.
    fn along(&self, forward: bool) -> impl Iterator<Item = &Vertex> {
        let count = self.vertices.len();
        (0..count).map(move |k| &self.vertices[if forward { k } else { count - 1 - k }])
    }

    /// Centre line in the direction of travel.
    pub(super) fn points(&self, forward: bool) -> Vec<Point2> {
        self.along(forward).map(|vertex| vertex.at).collect()
    }

    /// Arc length along the centre line, in the direction of travel, at a position along the road, metres.
    pub(super) fn along_m(&self, s_m: f64, forward: bool) -> f64 {
        let pieces = self.vertices.windows(2).map(|two| (two[0], two[1], two[0].at.distance(two[1].at)));
        let along = |(a, b, length_m): (Vertex, Vertex, f64)| {
            let share = if forward { s_m - a.s_m } else { b.s_m - s_m };
            length_m * (share / (b.s_m - a.s_m)).clamp(0.0, 1.0)
        };
        pieces.map(along).sum()
    }

    /// Borders along the centre line.
    pub(super) fn borders(&self, forward: bool) -> Borders {
        let mut stations = [Vec::with_capacity(self.vertices.len()), Vec::with_capacity(self.vertices.len())];
        let (mut s_m, mut last) = (0.0, None);
        for vertex in self.along(forward) {
            s_m += last.map_or(0.0, |last: Point2| last.distance(vertex.at));
            last = Some(vertex.at);
            let beside =
                if forward { [vertex.left_m, vertex.right_m] } else { [vertex.right_m, vertex.left_m] };
            for (stations, distance_m) in stations.iter_mut().zip(beside) {
                stations.push(Station { s_m, distance_m });
            }
        }
        // Vertices are finite and apart, so that the stations are a border.
        let [left, right] =
            stations.map(|stations| Border::linear(&stations).unwrap_or(Border::constant(0.0)));
        Borders::new(left, right)
    }
}
