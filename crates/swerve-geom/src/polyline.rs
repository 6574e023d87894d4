//! Reference lines by arc length, and the Frenet frame along them.

mod boxes;

use core::ops::Range;

use serde::{Deserialize, Serialize};

use self::boxes::{Boxes, SEGMENTS};
use crate::{Point2, Pose2, Vector2, angle_between, wrap_angle};

/// A line through points, parametrised by arc length `s` (metres from its first point).
///
/// Positions are linear between the points; headings and curvatures are linear between per-point values,
/// so that sampling is smooth when the points are dense. Beyond its ends the line goes on straight.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Polyline {
    points: Vec<Point2>,
    s_m: Vec<f64>,
    heading_rad: Vec<f64>,
    curvature_1pm: Vec<f64>,
    #[serde(skip)]
    boxes: Boxes,
}

/// A point of the line with its direction and curvature.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PolylinePoint {
    /// Arc length from the first point, metres.
    pub s_m: f64,
    /// Position and heading of the line.
    pub pose: Pose2,
    /// Curvature, 1/m; positive turns left.
    pub curvature_1pm: f64,
}

/// A position in the Frenet frame of a line.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct FrenetPoint {
    /// Arc length of the nearest point of the line, metres.
    pub s_m: f64,
    /// Signed distance from the line, metres; positive to its left.
    pub d_m: f64,
}

/// Error of constructing a line from points.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
pub enum PolylineError {
    /// Fewer than two distinct points.
    #[error("a line needs at least two points that differ")]
    TooShort,
    /// A coordinate is infinite or NaN.
    #[error("point {0} of the line is not finite")]
    NotFinite(usize),
    /// The line is too long to be resampled.
    #[error("the line is {length_m:e} m long: expected at most {max_m:e} m")]
    TooLong {
        /// Length through the points, metres.
        length_m: f64,
        /// Largest length, metres.
        max_m: f64,
    },
}

/// Cosine of the largest angle between a pose and a line that runs in its direction.
const ALONG_COS: f64 = 0.5;

/// Branches farther from a pose than the nearest by more than this are ignored, metres.
const BRANCHES_M: f64 = 5.0;

/// Distances of branches that differ by less than this count as equal, metres.
const EQUALLY_NEAR_M: f64 = 0.5;

/// Largest number of samples of a resampled line: 250 km at every quarter of a metre.
const SAMPLES_MAX: f64 = 1e6;

impl Polyline {
    /// Creates a line through `points`; repeated points are merged.
    pub fn new(points: &[Point2]) -> Result<Self, PolylineError> {
        if let Some(bad) = points.iter().position(|p| !p.is_finite()) {
            return Err(PolylineError::NotFinite(bad));
        }
        let mut kept: Vec<Point2> = Vec::with_capacity(points.len());
        let mut s_m: Vec<f64> = Vec::with_capacity(points.len());
        for &p in points {
            let after_m = match (kept.last(), s_m.last()) {
                (Some(last), Some(last_m)) => {
                    let gap_m = last.distance(p);
                    (gap_m > 1e-6).then_some(last_m + gap_m)
                }
                _ => Some(0.0),
            };
            if let Some(after_m) = after_m {
                kept.push(p);
                s_m.push(after_m);
            }
        }
        if kept.len() < 2 {
            return Err(PolylineError::TooShort);
        }
        let heading_rad = headings(&kept, &s_m);
        let curvature_1pm = curvatures(&heading_rad, &s_m);
        let boxes = Boxes::new(&kept);
        Ok(Self { points: kept, s_m, heading_rad, curvature_1pm, boxes })
    }

    /// Creates a line through `points`, resampled every `step_m` along a natural cubic spline over arc length, so
    /// that heading and curvature are continuous where the points are sparse. At most a million samples.
    pub fn smooth(points: &[Point2], step_m: f64) -> Result<Self, PolylineError> {
        let coarse = Self::new(points)?;
        if coarse.length() > step_m * SAMPLES_MAX {
            return Err(PolylineError::TooLong { length_m: coarse.length(), max_m: step_m * SAMPLES_MAX });
        }
        let xs: Vec<f64> = coarse.points.iter().map(|p| p.x_m).collect();
        let ys: Vec<f64> = coarse.points.iter().map(|p| p.y_m).collect();
        let (mx, my) = (spline_moments(&coarse.s_m, &xs), spline_moments(&coarse.s_m, &ys));
        let n = (coarse.length() / step_m).ceil().max(1.0) as usize;
        let mut i = 0;
        let dense: Vec<Point2> = (0..=n)
            .map(|k| {
                let s = coarse.length() * k as f64 / n as f64;
                i = coarse.segment_from(i, s);
                let between = Between::new(&coarse.s_m, i, s);
                Point2::new(between.value(&xs, &mx), between.value(&ys, &my))
            })
            .collect();
        Self::new(&dense)
    }

    /// Length of the line, metres.
    pub fn length(&self) -> f64 {
        self.s_m[self.s_m.len() - 1]
    }

    /// Vertices of the line.
    pub fn points(&self) -> &[Point2] {
        &self.points
    }

    /// Vertices of the line, each with its arc length, metres.
    pub fn vertices(&self) -> impl DoubleEndedIterator<Item = (f64, Point2)> {
        self.s_m.iter().copied().zip(self.points.iter().copied())
    }

    /// The part of the line from one arc length to another; `None` if that has no length.
    pub fn part(&self, [from_m, to_m]: [f64; 2]) -> Option<Self> {
        let end = |s_m: f64| core::iter::once(self.at(s_m).pose.point());
        let inner = self.vertices().filter(|(s_m, _)| from_m < *s_m && *s_m < to_m).map(|(_, point)| point);
        let points: Vec<Point2> = end(from_m).chain(inner).chain(end(to_m)).collect();
        Self::new(&points).ok()
    }

    /// Position, heading and curvature at arc length `s_m`.
    pub fn at(&self, s_m: f64) -> PolylinePoint {
        self.at_in(self.segment(s_m), s_m)
    }

    /// As [`at`](Self::at), for a non-decreasing sequence of arc lengths: each search starts at the previous segment.
    pub fn at_each(&self, s_m: impl IntoIterator<Item = f64>) -> impl Iterator<Item = PolylinePoint> {
        let mut i = 0;
        s_m.into_iter().map(move |s_m| {
            i = self.segment_from(i, s_m);
            self.at_in(i, s_m)
        })
    }

    /// Evaluates the line at `s_m` within segment `i`.
    fn at_in(&self, i: usize, s_m: f64) -> PolylinePoint {
        let (a, b) = (self.points[i], self.points[i + 1]);
        let length = self.s_m[i + 1] - self.s_m[i];
        let t = (s_m - self.s_m[i]) / length;
        let point = a + (b - a) * t;
        let inside = t.clamp(0.0, 1.0);
        let turn = angle_between(self.heading_rad[i], self.heading_rad[i + 1]);
        let heading = wrap_angle(self.heading_rad[i] + turn * inside);
        let (k0, k1) = (self.curvature_1pm[i], self.curvature_1pm[i + 1]);
        let curvature_1pm = if t == inside { k0 + (k1 - k0) * t } else { 0.0 };
        PolylinePoint { s_m, pose: Pose2::new(point.x_m, point.y_m, heading), curvature_1pm }
    }

    /// Map position of `frenet`: `d_m` to the left of the line at `s_m`.
    pub fn to_map(&self, frenet: FrenetPoint) -> Point2 {
        let on_line = self.at(frenet.s_m).pose;
        on_line.point() + on_line.direction().left() * frenet.d_m
    }

    /// Projects `point` onto the nearest position of the whole line.
    pub fn project(&self, point: Point2) -> FrenetPoint {
        self.project_between(point, 0, self.points.len() - 1)
    }

    /// As [`project`](Self::project), restricted to arc lengths within `reach_m` of `near_s_m`.
    pub fn project_near(&self, point: Point2, near_s_m: f64, reach_m: f64) -> FrenetPoint {
        let first = self.segment(near_s_m - reach_m);
        let last = self.segment(near_s_m + reach_m) + 1;
        self.project_between(point, first, last)
    }

    /// Projections of `point` within `reach_m` of `near_s_m`: one on each stretch of the line on which the distance
    /// from the point has a local minimum, ends included.
    pub fn places_near(
        &self,
        point: Point2,
        near_s_m: f64,
        reach_m: f64,
    ) -> impl Iterator<Item = FrenetPoint> {
        self.branches(point, self.segment(near_s_m - reach_m), self.segment(near_s_m + reach_m) + 1)
    }

    /// Projects a pose onto the nearest position at which the line runs in its direction, within 60 degrees. Among
    /// positions that are about equally near, the first is taken. If none is about as near as the nearest of all,
    /// that one is returned.
    pub fn project_pose(&self, pose: Pose2) -> FrenetPoint {
        let (point, direction) = (pose.point(), pose.direction());
        let nearest = self.project(point);
        let runs_along = |i: usize| {
            let along = self.points[i + 1] - self.points[i];
            along.dot(direction) > ALONG_COS * along.norm()
        };
        let segments = self.points.len() - 1;
        let mut best: Option<FrenetPoint> = None;
        let mut i = 0;
        while i < segments {
            let first = i;
            while i < segments && runs_along(i) == runs_along(first) {
                i += 1;
            }
            if !runs_along(first) {
                continue;
            }
            // Nearest position of each branch: a stretch of the line that stays near.
            for place in self.branches(point, first, i) {
                let is_beside = place.d_m.abs() <= nearest.d_m.abs() + BRANCHES_M;
                if is_beside && best.is_none_or(|best| place.d_m.abs() < best.d_m.abs() - EQUALLY_NEAR_M) {
                    best = Some(place);
                }
            }
        }
        best.unwrap_or(nearest)
    }

    /// Nearest position of each part of the segments from `first` to `last` whose distance from `point` has a
    /// minimum.
    fn branches(&self, point: Point2, first: usize, last: usize) -> impl Iterator<Item = FrenetPoint> {
        let distance_m = move |i: usize| self.project_between(point, i, i + 1).d_m.abs();
        let mut i = first;
        core::iter::from_fn(move || {
            if i >= last {
                return None;
            }
            let from = i;
            let mut before_m = distance_m(i);
            let mut rises = false;
            while i + 1 < last {
                let next_m = distance_m(i + 1);
                if rises && next_m < before_m {
                    break;
                }
                rises |= next_m > before_m;
                before_m = next_m;
                i += 1;
            }
            i += 1;
            Some(self.project_between(point, from, i))
        })
    }

    /// Nearest position on the segments from `first` to `last`, the first of equally near ones. Segments in boxes that
    /// are farther away than a segment in the nearest box are left out.
    fn project_between(&self, point: Point2, first: usize, last: usize) -> FrenetPoint {
        let mut best = Nearest::default();
        if !self.boxes.serve(last.saturating_sub(first)) {
            self.offer(point, first..last, &mut best);
            return self.place(point, &best);
        }
        let segments_of = |k: usize| (k * SEGMENTS).max(first)..((k + 1) * SEGMENTS).min(last);
        let mut near = Nearest::default();
        self.offer(point, segments_of(self.boxes.nearest(point, first, last)), &mut near);
        let ends = [0, (self.points.len() - 2) / SEGMENTS];
        for k in first / SEGMENTS..=(last - 1) / SEGMENTS {
            // The end segments go on beyond their boxes.
            if ends.contains(&k) || self.boxes.may_reach(k, point, near.squared_m2) {
                self.offer(point, segments_of(k), &mut best);
            }
        }
        self.place(point, &best)
    }

    /// Compares the nearest position so far with those on some segments.
    fn offer(&self, point: Point2, segments: Range<usize>, best: &mut Nearest) {
        let end = self.points.len() - 2;
        for i in segments {
            let (a, b) = (self.points[i], self.points[i + 1]);
            let (along, to) = (b - a, point - a);
            let length_squared = along.norm_squared();
            let raw = to.dot(along) / length_squared;
            // The end segments are extended, so that positions before and beyond the line are defined.
            let low = if i == 0 { f64::NEG_INFINITY } else { 0.0 };
            let high = if i == end { f64::INFINITY } else { 1.0 };
            let t = raw.clamp(low, high);
            let off: Vector2 = to - along * t;
            let squared = off.norm_squared();
            if squared < best.squared_m2 {
                *best = Nearest { squared_m2: squared, segment: i, t };
            }
        }
    }

    /// Place of the nearest position to `point`; the begin of the line if there is none.
    fn place(&self, point: Point2, nearest: &Nearest) -> FrenetPoint {
        let &Nearest { squared_m2, segment: i, t } = nearest;
        if squared_m2 == f64::INFINITY {
            return FrenetPoint::default();
        }
        let (a, b) = (self.points[i], self.points[i + 1]);
        let (along, to) = (b - a, point - a);
        let side = if along.cross(to) < 0.0 { -1.0 } else { 1.0 };
        FrenetPoint { s_m: self.s_m[i] + t * along.norm_squared().sqrt(), d_m: side * squared_m2.sqrt() }
    }

    /// Index of the segment that contains `s_m`; the end segments also cover arc lengths beyond them.
    fn segment(&self, s_m: f64) -> usize {
        let after = self.s_m.partition_point(|&s| s <= s_m);
        after.saturating_sub(1).min(self.points.len() - 2)
    }

    /// As [`segment`](Self::segment), searched forward from segment `i`.
    fn segment_from(&self, mut i: usize, s_m: f64) -> usize {
        if s_m < self.s_m[i] {
            return self.segment(s_m);
        }
        while i + 2 < self.points.len() && self.s_m[i + 1] <= s_m {
            i += 1;
        }
        i
    }
}

/// Nearest position so far: squared distance, m², segment, and the share of it up to the position.
struct Nearest {
    squared_m2: f64,
    segment: usize,
    t: f64,
}

impl Default for Nearest {
    fn default() -> Self {
        Self { squared_m2: f64::INFINITY, segment: 0, t: 0.0 }
    }
}

/// Heading at each point: that of the end segment at the ends, elsewhere interpolated between the two adjacent
/// segments (weighted, so that the shorter one counts more).
fn headings(points: &[Point2], s_m: &[f64]) -> Vec<f64> {
    let segment: Vec<f64> = points.windows(2).map(|p| (p[1] - p[0]).heading()).collect();
    let last = segment.len() - 1;
    (0..points.len())
        .map(|i| {
            if i == 0 || i > last {
                return segment[i.min(last)];
            }
            let (before, after) = (s_m[i] - s_m[i - 1], s_m[i + 1] - s_m[i]);
            let turn = angle_between(segment[i - 1], segment[i]);
            wrap_angle(segment[i - 1] + turn * before / (before + after))
        })
        .collect()
}

/// Curvature at each point: change of heading over arc length, by central differences where there are two neighbours.
fn curvatures(heading_rad: &[f64], s_m: &[f64]) -> Vec<f64> {
    let last = s_m.len() - 1;
    (0..s_m.len())
        .map(|i| {
            let (a, b) = (i.saturating_sub(1), (i + 1).min(last));
            angle_between(heading_rad[a], heading_rad[b]) / (s_m[b] - s_m[a])
        })
        .collect()
}

/// Second derivatives at the knots of the natural cubic spline (tridiagonal system, Thomas algorithm).
fn spline_moments(s: &[f64], y: &[f64]) -> Vec<f64> {
    let n = s.len();
    let mut m = vec![0.0; n];
    let (mut c, mut d) = (vec![0.0; n], vec![0.0; n]);
    for i in 1..n - 1 {
        let (h0, h1) = (s[i] - s[i - 1], s[i + 1] - s[i]);
        let rhs = 6.0 * ((y[i + 1] - y[i]) / h1 - (y[i] - y[i - 1]) / h0);
        let pivot = 2.0 * (h0 + h1) - h0 * c[i - 1];
        c[i] = h1 / pivot;
        d[i] = (rhs - h0 * d[i - 1]) / pivot;
    }
    for i in (1..n - 1).rev() {
        m[i] = d[i] - c[i] * m[i + 1];
    }
    m
}

/// Interpolation weights at a position within segment `i` of cubic splines with common knots.
struct Between {
    i: usize,
    /// Length of the segment.
    h: f64,
    /// Weights of the values and of the moments at the segment's ends.
    values: [f64; 2],
    moments: [f64; 2],
}

impl Between {
    fn new(s: &[f64], i: usize, x: f64) -> Self {
        let h = s[i + 1] - s[i];
        let (a, b) = ((s[i + 1] - x) / h, (x - s[i]) / h);
        Self { i, h, values: [a, b], moments: [a * a * a - a, b * b * b - b] }
    }

    /// Value of the spline through `y` with moments `m`.
    fn value(&self, y: &[f64], m: &[f64]) -> f64 {
        let (i, h, [a, b], [p, q]) = (self.i, self.h, self.values, self.moments);
        a * y[i] + b * y[i + 1] + (p * m[i] + q * m[i + 1]) * h * h / 6.0
    }
}

#[cfg(test)]
mod tests;
