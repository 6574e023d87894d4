//! Lanes between two lines: the centre line, and the distances of both from it.
//!
//! **Centre line.** Points of both borders at the same share of their lengths are a pair; the centre line runs through
//! the middles of the pairs. A line that the file provides takes the place of the middles. Corners are rounded where a
//! border would be more than [`CORNER_M`] off on the outside: all that is beside a corner has one arc length, where a
//! border has one distance.
//!
//! **Borders.** Between two vertices, the distance of a border across the line is a linear function of arc length for
//! each straight piece of the border. Its stations are where the normals at vertices meet the border, and its own
//! vertices. Where a border ends before its lane, it is extended straight.

use swerve_geom::{Point2, Vector2, math};
use swerve_map::{Border, Borders, Station};

use crate::import::STEP_M;

/// Vertices closer than this are one, metres; as in `Polyline::new`.
const SAME_M: f64 = 1e-6;

/// Pairs closer than this are one, metres.
const PAIR_M: f64 = 0.05;

/// Largest error of a border on the outside of a corner, metres.
const CORNER_M: f64 = 5e-4;

/// Largest distance of a rounded corner from its vertex, metres.
const CUT_M: f64 = 0.02;

/// Most pieces of a rounded corner.
const ROUND_MAX: f64 = 512.0;

/// Most vertices of a border that are examined beside a piece of the line.
const WINDOW: usize = 64;

/// Values of distances are multiples of this, metres: constant widths stay constant.
const GRAIN_PER_M: f64 = 1e9;

/// Line without repeated points.
pub(crate) fn distinct(points: impl IntoIterator<Item = Point2>) -> Vec<Point2> {
    let mut kept: Vec<Point2> = Vec::new();
    for point in points {
        if kept.last().is_none_or(|last| last.distance(point) > SAME_M) {
            kept.push(point);
        }
    }
    kept
}

/// Length of a line, metres.
pub(crate) fn length_m(points: &[Point2]) -> f64 {
    points.windows(2).map(|two| two[0].distance(two[1])).sum()
}

/// Vertex of a centre line, and the distance of the farther border, metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Vertex {
    pub(crate) at: Point2,
    pub(crate) reach_m: f64,
}

impl Vertex {
    fn between(left: Point2, right: Point2) -> Self {
        Self { at: middle(left, right), reach_m: 0.5 * left.distance(right) }
    }
}

/// Centre line through the middles of given pairs.
pub(crate) fn middles(left: &[Point2], right: &[Point2]) -> Vec<Vertex> {
    let mut vertices: Vec<Vertex> = Vec::with_capacity(left.len());
    for (left, right) in left.iter().zip(right) {
        let vertex = Vertex::between(*left, *right);
        if vertices.last().is_none_or(|last| last.at.distance(vertex.at) > SAME_M) {
            vertices.push(vertex);
        }
    }
    vertices
}

/// Centre line between two borders, or along `given`.
pub(crate) fn centered(left: &[Point2], right: &[Point2], given: Option<&[Point2]>) -> Vec<Vertex> {
    let shares: Vec<Vec<f64>> = [Some(left), Some(right), given].into_iter().flatten().map(shares).collect();
    let longest_m = length_m(left).max(length_m(right));
    let near = PAIR_M / longest_m.max(PAIR_M);
    let inner = |share: &f64| (near..1.0 - near).contains(share);
    let mut at: Vec<f64> = shares.iter().flatten().copied().filter(inner).collect();
    at.extend([0.0, 1.0]);
    at.sort_by(f64::total_cmp);
    at.dedup_by(|b, a| *b - *a < near && *b < 1.0);
    let mut cursors = [0; 3];
    let mut vertices: Vec<Vertex> = Vec::with_capacity(at.len());
    for share in at {
        let [left, right] = [0, 1].map(|k| along([left, right][k], &shares[k], share, &mut cursors[k]));
        let mut vertex = Vertex::between(left, right);
        if let Some(given) = given {
            let at = along(given, &shares[2], share, &mut cursors[2]);
            vertex = Vertex { at, reach_m: left.distance(at).max(right.distance(at)) };
        }
        if vertices.last().is_none_or(|last| last.at.distance(vertex.at) > SAME_M) {
            vertices.push(vertex);
        }
    }
    vertices
}

fn middle(a: Point2, b: Point2) -> Point2 {
    a + (b - a) * 0.5
}

/// Share of the length of a line up to each vertex.
fn shares(points: &[Point2]) -> Vec<f64> {
    let mut s_m = 0.0;
    let mut shares = vec![0.0];
    for two in points.windows(2) {
        s_m += two[0].distance(two[1]);
        shares.push(s_m);
    }
    shares.iter_mut().for_each(|share| *share /= s_m.max(SAME_M));
    shares
}

/// Point at a share of a line, for growing shares.
fn along(points: &[Point2], shares: &[f64], share: f64, from: &mut usize) -> Point2 {
    while *from + 2 < points.len() && shares[*from + 1] < share {
        *from += 1;
    }
    let (Some(a), Some(b)) = (points.get(*from), points.get(*from + 1)) else { return points[0] };
    let piece = shares[*from + 1] - shares[*from];
    let t = if piece > 0.0 { ((share - shares[*from]) / piece).clamp(0.0, 1.0) } else { 0.0 };
    *a + (*b - *a) * t
}

/// The same line with vertices at most [`STEP_M`] apart.
pub(crate) fn dense(vertices: &[Vertex]) -> Vec<Vertex> {
    let mut dense: Vec<Vertex> = vertices.first().copied().into_iter().collect();
    for two in vertices.windows(2) {
        let [a, b] = [two[0], two[1]];
        let steps = (a.at.distance(b.at) / STEP_M).ceil().max(1.0) as usize;
        dense.extend((1..steps).map(|k| {
            let t = k as f64 / steps as f64;
            Vertex { at: a.at + (b.at - a.at) * t, reach_m: a.reach_m + (b.reach_m - a.reach_m) * t }
        }));
        dense.push(b);
    }
    dense
}

/// Points of a line, with arcs in place of corners beside which a border would be inexact. The arcs touch both pieces.
pub(crate) fn rounded(vertices: &[Vertex]) -> Vec<Point2> {
    let mut line = Vec::with_capacity(vertices.len());
    for (k, &Vertex { at, reach_m }) in vertices.iter().enumerate() {
        let (Some(before), Some(after)) = (k.checked_sub(1).map(|k| vertices[k]), vertices.get(k + 1)) else {
            line.push(at);
            continue;
        };
        let (from, to) = (direction(before.at, at), direction(at, after.at));
        let turn_rad = math::atan2(from.cross(to), from.dot(to));
        let bend_rad = turn_rad.abs();
        // A border that is inclined to the line changes its distance by its slope times the turn at a vertex.
        let slope = |other: Vertex| (other.reach_m - reach_m).abs() / other.at.distance(at).max(SAME_M);
        let inclined = 0.5 * bend_rad + slope(before).max(slope(*after)).min(1.0);
        let pieces = (reach_m * inclined * bend_rad / CORNER_M).ceil().min(ROUND_MAX);
        if pieces <= 1.0 {
            line.push(at);
            continue;
        }
        let room_m = 0.4 * before.at.distance(at).min(at.distance(after.at));
        let cut_m = room_m.min(CUT_M / math::tan(0.25 * bend_rad));
        let radius_m = cut_m / math::tan(0.5 * bend_rad);
        for step in 0..=pieces as usize {
            let (sin, cos) = math::sin_cos(bend_rad * (step as f64 / pieces));
            let aside_m = turn_rad.signum() * radius_m * (1.0 - cos);
            line.push(at + from * (radius_m * sin - cut_m) + from.left() * aside_m);
        }
    }
    distinct(line)
}

fn direction(from: Point2, to: Point2) -> Vector2 {
    (to - from) * (1.0 / from.distance(to).max(SAME_M))
}

/// Borders of a lane, measured across its centre line of at least two distinct vertices.
pub(crate) fn measured(line: &[Point2], left: &[Point2], right: &[Point2]) -> Borders {
    Borders::new(border(line, left, 1.0), border(line, right, -1.0))
}

/// True if the middle of the left border is to the right of the right one's middle, or both are in one place.
pub(crate) fn is_swapped(line: &[Point2], left: &[Point2], right: &[Point2]) -> bool {
    let sum = |border: &[Point2], side| {
        let stations = stations(line, border, side, f64::NEG_INFINITY);
        stations.iter().map(|station| station.distance_m).sum::<f64>() / stations.len().max(1) as f64
    };
    sum(left, 1.0) + sum(right, -1.0) <= 0.0
}

fn border(line: &[Point2], border: &[Point2], side: f64) -> Border {
    Border::linear(&stations(line, border, side, 0.0)).unwrap_or(Border::constant(0.0))
}

/// Straight piece of a line, as a frame: arc length along it, distance to the side.
struct Piece {
    from: Point2,
    along: Vector2,
    length_m: f64,
    side: f64,
}

impl Piece {
    fn place(&self, point: Point2) -> Station {
        let off = point - self.from;
        Station { s_m: self.along.dot(off), distance_m: self.side * self.along.cross(off) }
    }

    /// Where the normal at an arc length meets the line through two points.
    fn across(&self, two: &[Point2], s_m: f64) -> f64 {
        let [a, b] = [self.place(two[0]), self.place(two[1])];
        let piece_m = b.s_m - a.s_m;
        if piece_m.abs() < SAME_M {
            return if (s_m - a.s_m).abs() < (s_m - b.s_m).abs() { a.distance_m } else { b.distance_m };
        }
        let slope = (b.distance_m - a.distance_m) / piece_m;
        // Beyond the ends of the border, not more than at 45°.
        if s_m < a.s_m.min(b.s_m) || s_m > a.s_m.max(b.s_m) {
            let near = if (s_m - a.s_m).abs() < (s_m - b.s_m).abs() { a } else { b };
            return near.distance_m + slope.clamp(-1.0, 1.0) * (s_m - near.s_m);
        }
        a.distance_m + slope * (s_m - a.s_m)
    }
}

/// Distances of a border from a line, at least `least_m`.
fn stations(line: &[Point2], border: &[Point2], side: f64, least_m: f64) -> Vec<Station> {
    let mut list = Stations { all: Vec::with_capacity(line.len()), least_m };
    let (mut begin_m, mut at) = (0.0, 0);
    if border.len() < 2 {
        return list.all;
    }
    for two in line.windows(2) {
        let length_m = two[0].distance(two[1]);
        let piece = Piece { from: two[0], along: direction(two[0], two[1]), length_m, side };
        let s_m = |k: usize| piece.place(border[k]).s_m;
        for _ in 0..WINDOW {
            if at == 0 || s_m(at) <= 0.0 {
                break;
            }
            at -= 1;
        }
        while at + 2 < border.len() && s_m(at + 1) <= 0.0 {
            at += 1;
        }
        list.push(begin_m, piece.across(&border[at..], 0.0));
        let (mut last_m, mut next) = (0.0, at + 1);
        while next + 1 < border.len() && next <= at + WINDOW && s_m(next) < piece.length_m {
            let Station { s_m, distance_m } = piece.place(border[next]);
            if s_m > last_m + SAME_M && s_m < piece.length_m - SAME_M {
                list.push(begin_m + s_m, distance_m);
                last_m = s_m;
            }
            next += 1;
        }
        list.push(begin_m + length_m, piece.across(&border[next - 1..], length_m));
        begin_m += length_m;
    }
    list.all
}

struct Stations {
    all: Vec<Station>,
    least_m: f64,
}

impl Stations {
    /// Appends a station: at most two at one arc length, of which equal ones are one.
    fn push(&mut self, s_m: f64, distance_m: f64) {
        let distance_m = ((distance_m * GRAIN_PER_M).round() / GRAIN_PER_M).max(self.least_m);
        let count = self.all.len();
        match self.all.last_mut() {
            Some(last) if last.s_m >= s_m && last.distance_m == distance_m => {}
            Some(last) if last.s_m >= s_m => {
                let s_m = last.s_m;
                if count > 1 && self.all[count - 2].s_m == s_m {
                    self.all[count - 1].distance_m = distance_m;
                } else {
                    self.all.push(Station { s_m, distance_m });
                }
            }
            _ => self.all.push(Station { s_m, distance_m }),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests;
