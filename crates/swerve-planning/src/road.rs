//! The drivable ground beside the route, preprocessed for many queries.

use core::cell::Cell;

use swerve_geom::{FrenetPoint, Point2};
use swerve_map::{Borders, Route};

use crate::collision::Solid;
use crate::request::Request;

/// Points of the line closer than this to the chord that skips them are dropped, metres: a straight road becomes one
/// segment.
const CHORD_M: f64 = 1e-6;

/// Upper bound on the rounding error of a distance between places on a map, metres.
const ROUNDING_M: f64 = 1e-6;

/// Part of a route over a map that counts: this far behind and ahead of the start, metres, and farther ahead by the way
/// of this time, seconds. No plan reaches beyond it.
const BEHIND_M: f64 = 60.0;
const AHEAD_S: f64 = 10.0;

/// One straight piece of the line.
#[derive(Clone, Copy, Debug)]
struct Piece {
    x_m: f64,
    y_m: f64,
    cos: f64,
    sin: f64,
    s_m: f64,
    length_m: f64,
}

/// Consecutive pieces with their bounding circle.
#[derive(Clone, Copy, Debug)]
struct Chunk {
    first: usize,
    end: usize,
    x_m: f64,
    y_m: f64,
    radius_m: f64,
}

/// Margins on the drivable ground, equal to those of [`Route::margin_m`] but faster.
#[derive(Clone, Debug, Default)]
pub struct Road {
    pieces: Vec<Piece>,
    chunks: Vec<Chunk>,
    borders: Borders,
}

impl Road {
    /// Creates the ground of a route.
    pub fn new(route: &Route) -> Self {
        let mut road = Self::default();
        road.set(route);
        road
    }

    /// Replaces the content, reusing the storage.
    pub fn set(&mut self, route: &Route) {
        self.set_between(route, [f64::NEG_INFINITY, f64::INFINITY]);
    }

    /// Replaces the content by the ground of a request. Of a route over a map, which may be long and meet itself, only
    /// the part near the start counts, and goes on straight beyond its ends.
    pub fn set_near(&mut self, request: &Request<'_>) {
        let is_over_map = !request.route.stretches().is_empty();
        let speed_mps = request.start.speed_mps.max(request.target_speed_mps).max(0.0);
        let near = |along_m: f64| [along_m - BEHIND_M, along_m + BEHIND_M + AHEAD_S * speed_mps];
        let all = [f64::NEG_INFINITY, f64::INFINITY];
        self.set_between(request.route, request.along_m.filter(|_| is_over_map).map_or(all, near));
    }

    fn set_between(&mut self, route: &Route, [from_m, to_m]: [f64; 2]) {
        self.borders.clone_from(route.borders());
        self.pieces.clear();
        self.chunks.clear();
        let points = route.line().points();
        let (mut from, mut s_m) = (0, 0.0);
        while from + 1 < points.len() {
            let to = furthest_straight(points, from);
            let along = points[to] - points[from];
            let length_m = along.norm();
            let (a, unit) = (points[from], along * (1.0 / length_m));
            if s_m + length_m >= from_m && s_m <= to_m {
                self.pieces.push(Piece { x_m: a.x_m, y_m: a.y_m, cos: unit.x, sin: unit.y, s_m, length_m });
            }
            s_m += length_m;
            from = to;
        }
        for first in (0..self.pieces.len()).step_by(8) {
            self.chunks.push(chunk(&self.pieces, first, (first + 8).min(self.pieces.len())));
        }
    }

    /// The nearest place of the line or of its straight continuation beyond the ends, with its chunk; the search starts
    /// at chunk `likely`.
    fn project_from(&self, likely: usize, point: Point2) -> (usize, FrenetPoint) {
        let mut best = (f64::INFINITY, FrenetPoint::default());
        if let [only] = self.pieces.as_slice() {
            only.look(point, [f64::NEG_INFINITY, f64::INFINITY], &mut best);
            return (0, best.1);
        }
        let (Some(chunk), end) = (self.chunks.get(likely), self.chunks.len()) else { return (0, best.1) };
        self.look(chunk, point, &mut best);
        let (mut best_m, mut at) = (best.0.sqrt(), likely);
        for (k, c) in self.chunks.iter().enumerate() {
            let reach_m = best_m + c.radius_m + ROUNDING_M;
            let (dx, dy) = (point.x_m - c.x_m, point.y_m - c.y_m);
            let near = dx * dx + dy * dy <= reach_m * reach_m;
            // The end pieces are unbounded.
            let beyond = k == 0 && self.pieces[0].along_m(point) < 0.0
                || k + 1 == end && self.pieces[self.pieces.len() - 1].is_passed(point);
            if k == likely || !(near || beyond) {
                continue;
            }
            let mut here = (f64::INFINITY, FrenetPoint::default());
            self.look(c, point, &mut here);
            // Of equally near places, as at a corner, those at the ends come first, then the first.
            let order = |k: usize| if k > 0 && k + 1 == end { 1 } else { 2 * k };
            if here.0 < best.0 || (here.0 == best.0 && order(k) < order(at)) {
                (best, best_m, at) = (here, here.0.sqrt(), k);
            }
        }
        (at, best.1)
    }

    /// The chunk with the nearest centre.
    fn nearest_chunk(&self, point: Point2) -> usize {
        let mut nearest = (f64::INFINITY, 0);
        for (k, c) in self.chunks.iter().enumerate() {
            let (dx, dy) = (point.x_m - c.x_m, point.y_m - c.y_m);
            let squared = dx * dx + dy * dy;
            if squared < nearest.0 {
                nearest = (squared, k);
            }
        }
        nearest.1
    }

    fn look(&self, chunk: &Chunk, point: Point2, best: &mut (f64, FrenetPoint)) {
        let end = self.pieces.len() - 1;
        for (i, p) in self.pieces[chunk.first..chunk.end].iter().enumerate() {
            let low = if chunk.first + i == 0 { f64::NEG_INFINITY } else { 0.0 };
            let high = if chunk.first + i == end { f64::INFINITY } else { p.length_m };
            p.look(point, [low, high], best);
        }
    }

    /// Projects points near to each other, the first near to the centre of `footprint`.
    fn projector(&self, footprint: &Solid) -> impl Fn(Point2) -> FrenetPoint {
        let middle = Point2::new(footprint.x_m, footprint.y_m);
        let likely = Cell::new(if self.chunks.len() > 1 { self.nearest_chunk(middle) } else { 0 });
        move |point| {
            let (chunk, place) = self.project_from(likely.get(), point);
            likely.set(chunk);
            place
        }
    }

    /// Returns true if [`keeps`](Self::keeps) takes long: beside a line that is not straight.
    pub(crate) fn is_bent(&self) -> bool {
        self.pieces.len() > 1
    }

    /// Distance of the outermost place of `footprint` inside the drivable ground, metres; negative outside.
    pub fn margin_m(&self, footprint: &Solid) -> f64 {
        self.borders.margin_m(footprint.corners(), self.projector(footprint))
    }

    /// Returns true if [`margin_m`](Self::margin_m) is at least `needed_m`.
    pub fn keeps(&self, footprint: &Solid, needed_m: f64) -> bool {
        self.borders.keeps(footprint.corners(), needed_m, self.projector(footprint))
    }
}

impl Piece {
    /// Distance of `point` from the piece's start along its direction, metres.
    fn along_m(&self, point: Point2) -> f64 {
        self.cos * (point.x_m - self.x_m) + self.sin * (point.y_m - self.y_m)
    }

    /// Returns true if `point` is beyond the piece's end along its direction.
    fn is_passed(&self, point: Point2) -> bool {
        self.along_m(point) > self.length_m
    }

    /// Updates `best` with the place nearest to `point` if it is nearer, by squared distance; the piece extends from
    /// `low` to `high`.
    #[inline]
    fn look(&self, point: Point2, [low, high]: [f64; 2], best: &mut (f64, FrenetPoint)) {
        let (dx, dy) = (point.x_m - self.x_m, point.y_m - self.y_m);
        let (raw, across) = (self.cos * dx + self.sin * dy, self.cos * dy - self.sin * dx);
        let along = raw.clamp(low, high);
        let squared = across * across + (raw - along) * (raw - along);
        if squared < best.0 {
            let d_m = if raw == along { across } else { squared.sqrt().copysign(across) };
            *best = (squared, FrenetPoint { s_m: self.s_m + along, d_m });
        }
    }
}

/// The last point such that all points between are on the straight line to it.
fn furthest_straight(points: &[Point2], from: usize) -> usize {
    let mut to = from + 1;
    let first = points[to] - points[from];
    while to + 1 < points.len() {
        let next = points[to + 1] - points[from];
        // The newest point must continue the first segment's direction, forwards.
        if first.cross(next).abs() > CHORD_M * first.norm() || next.dot(first) <= 0.0 {
            break;
        }
        if (points[to + 1] - points[to]).dot(first) <= 0.0 {
            break;
        }
        to += 1;
    }
    to
}

fn chunk(pieces: &[Piece], first: usize, end: usize) -> Chunk {
    let mut low = (f64::INFINITY, f64::INFINITY);
    let mut high = (f64::NEG_INFINITY, f64::NEG_INFINITY);
    for p in &pieces[first..end] {
        for (x, y) in [(p.x_m, p.y_m), (p.x_m + p.cos * p.length_m, p.y_m + p.sin * p.length_m)] {
            low = (low.0.min(x), low.1.min(y));
            high = (high.0.max(x), high.1.max(y));
        }
    }
    let radius_m = 0.5 * swerve_geom::math::hypot(high.0 - low.0, high.1 - low.1);
    Chunk { first, end, x_m: 0.5 * (low.0 + high.0), y_m: 0.5 * (low.1 + high.1), radius_m }
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_geom::{Obb, Polyline, Pose2, math};
    use swerve_map::{Border, Station};

    fn check(points: &[Point2]) {
        let station = |(s_m, distance_m)| Station { s_m, distance_m };
        let narrows = Border::linear(&[(20.0, 6.0), (35.0, 1.0), (50.0, 4.0)].map(station)).unwrap();
        for borders in [Borders::constant(6.0, 2.0), Borders::new(narrows, Border::constant(2.0))] {
            check_between(points, borders);
        }
    }

    fn check_between(points: &[Point2], borders: Borders) {
        let route = Route::new(Polyline::new(points).unwrap(), borders);
        let road = Road::new(&route);
        for k in 0..400 {
            let (x, y) = (f64::from(k % 20) * 5.0 - 10.0, f64::from(k / 20) * 3.0 - 20.0);
            let obb = Obb::new(Pose2::new(x, y, f64::from(k) * 0.1), 4.93, 1.86);
            let (slow, fast) = (route.margin_m(&obb), road.margin_m(&Solid::from(&obb)));
            assert!((slow - fast).abs() < 1e-5, "{obb:?}: {slow} {fast}");
        }
    }

    #[test]
    fn road_margin_matches_the_routes() {
        let straight: Vec<Point2> = (0..80).map(|k| Point2::new(f64::from(k), 0.0)).collect();
        check(&straight);
        let road = Road::new(&Route::uniform(Polyline::new(&straight).unwrap(), 1.0, 1.0));
        assert_eq!(road.pieces.len(), 1);
        let arc: Vec<Point2> = (0..80)
            .map(|k| {
                let (sin, cos) = math::sin_cos(0.03 * f64::from(k));
                Point2::new(30.0 * sin, 30.0 - 30.0 * cos)
            })
            .collect();
        check(&arc);
    }
}
