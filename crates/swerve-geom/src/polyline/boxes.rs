//! Bounding boxes of stretches of a line, by which a projection leaves out most segments.

use crate::Point2;

/// Number of segments per box.
pub(super) const SEGMENTS: usize = 8;
/// Reserve for rounding errors of squared distances, as a share and in m².
const RESERVE: f64 = 1e-9;

/// Bounding boxes of successive stretches of a line. They follow from its points: all boxes compare equal. A line that is
/// read from a file has none, and then all its segments are looked at.
#[derive(Clone, Debug, Default)]
pub(super) struct Boxes(Vec<[f64; 4]>);

impl PartialEq for Boxes {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Boxes {
    /// Creates the boxes of a line through `points`; none for a short line.
    pub(super) fn new(points: &[Point2]) -> Self {
        let segments = points.len().saturating_sub(1);
        if segments <= 2 * SEGMENTS {
            return Self::default();
        }
        let of = |k: usize| {
            let stretch = &points[k..=(k + SEGMENTS).min(segments)];
            let none = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
            stretch.iter().fold(none, |[x0, y0, x1, y1], p| {
                [x0.min(p.x_m), y0.min(p.y_m), x1.max(p.x_m), y1.max(p.y_m)]
            })
        };
        Self((0..segments).step_by(SEGMENTS).map(of).collect())
    }

    /// True if there are boxes, and enough segments to use them for.
    pub(super) fn serve(&self, segments: usize) -> bool {
        segments > 2 * SEGMENTS && !self.0.is_empty()
    }

    /// The box nearest to a point among those of the segments from `first` to `last`.
    pub(super) fn nearest(&self, point: Point2, first: usize, last: usize) -> usize {
        let (mut nearest, mut least) = (first / SEGMENTS, f64::INFINITY);
        for k in first / SEGMENTS..=(last - 1) / SEGMENTS {
            let squared = self.squared_m2(k, point);
            if squared < least {
                (nearest, least) = (k, squared);
            }
        }
        nearest
    }

    /// True if a segment in a box can be as near to a point as a squared distance, m².
    pub(super) fn may_reach(&self, k: usize, point: Point2, squared_m2: f64) -> bool {
        self.squared_m2(k, point) <= squared_m2 * (1.0 + RESERVE) + RESERVE
    }

    /// Squared distance from a point to a box, m².
    fn squared_m2(&self, k: usize, point: Point2) -> f64 {
        let [x0, y0, x1, y1] = self.0[k];
        let x_m = (x0 - point.x_m).max(point.x_m - x1).max(0.0);
        let y_m = (y0 - point.y_m).max(point.y_m - y1).max(0.0);
        x_m * x_m + y_m * y_m
    }
}
