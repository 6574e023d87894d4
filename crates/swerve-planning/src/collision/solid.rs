//! Oriented rectangles, their distances and overlaps.

use swerve_geom::{Obb, Point2, math};

/// An oriented rectangle with precomputed direction, so that repeated checks need no trigonometry.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Solid {
    /// X coordinate of the centre, metres.
    pub x_m: f64,
    /// Y coordinate of the centre, metres.
    pub y_m: f64,
    /// Cosine of the heading.
    pub cos: f64,
    /// Sine of the heading.
    pub sin: f64,
    /// Half its extent along its heading, metres.
    pub half_length_m: f64,
    /// Half its extent across its heading, metres.
    pub half_width_m: f64,
}

/// Upper bound on the rounding error of a distance between places on a map, metres.
const ROUNDING_M: f64 = 1e-6;

impl From<&Obb> for Solid {
    fn from(obb: &Obb) -> Self {
        let (sin, cos) = math::sin_cos(obb.center.heading_rad);
        Self {
            x_m: obb.center.x_m,
            y_m: obb.center.y_m,
            cos,
            sin,
            half_length_m: obb.half_length_m,
            half_width_m: obb.half_width_m,
        }
    }
}

impl Solid {
    /// Radius of the circumscribed circle, metres.
    pub fn radius_m(&self) -> f64 {
        math::hypot(self.half_length_m, self.half_width_m)
    }

    /// Corners: front left, rear left, rear right, front right.
    pub fn corners(&self) -> [Point2; 4] {
        let (ax, ay) = (self.cos * self.half_length_m, self.sin * self.half_length_m);
        let (lx, ly) = (-self.sin * self.half_width_m, self.cos * self.half_width_m);
        [
            Point2::new(self.x_m + ax + lx, self.y_m + ay + ly),
            Point2::new(self.x_m - ax + lx, self.y_m - ay + ly),
            Point2::new(self.x_m - ax - lx, self.y_m - ay - ly),
            Point2::new(self.x_m + ax - lx, self.y_m + ay - ly),
        ]
    }

    /// Squared distance from the nearest corner of `other`, m²; zero if a corner is inside.
    #[inline]
    fn nearest_corner_squared(&self, other: &Self) -> f64 {
        let squared = other.corners().map(|corner| {
            let (dx, dy) = (corner.x_m - self.x_m, corner.y_m - self.y_m);
            let along = ((self.cos * dx + self.sin * dy).abs() - self.half_length_m).max(0.0);
            let across = ((self.cos * dy - self.sin * dx).abs() - self.half_width_m).max(0.0);
            along * along + across * across
        });
        squared.into_iter().fold(f64::INFINITY, |least, one| if one < least { one } else { least })
    }

    /// Widest gap between the two along any of their sides, metres; if positive, they are disjoint and at least that
    /// far apart (separating axis theorem).
    #[inline]
    fn gap_m(&self, other: &Self) -> f64 {
        let (dx, dy) = (other.x_m - self.x_m, other.y_m - self.y_m);
        let c = (self.cos * other.cos + self.sin * other.sin).abs();
        let s = (self.cos * other.sin - self.sin * other.cos).abs();
        let gap = |along: f64, own: f64, l: f64, w: f64| along.abs() - (own + l + w);
        let (a, b) = (self, other);
        let along_a = gap(a.cos * dx + a.sin * dy, a.half_length_m, b.half_length_m * c, b.half_width_m * s);
        let across_a = gap(a.cos * dy - a.sin * dx, a.half_width_m, b.half_length_m * s, b.half_width_m * c);
        let along_b = gap(b.cos * dx + b.sin * dy, b.half_length_m, a.half_length_m * c, a.half_width_m * s);
        let across_b = gap(b.cos * dy - b.sin * dx, b.half_width_m, a.half_length_m * s, a.half_width_m * c);
        along_a.max(across_a).max(along_b.max(across_b))
    }

    /// Returns true if the two rectangles share a point.
    pub fn overlaps(&self, other: &Self) -> bool {
        let apart = self.gap_m(other) > 0.0;
        !apart
    }

    /// Distance between the two rectangles, metres; zero if they share a point.
    pub fn distance_m(&self, other: &Self) -> f64 {
        self.distance_below(other, f64::INFINITY)
    }

    /// As [`distance_m`](Self::distance_m), capped at `cap_m`.
    #[inline]
    pub(super) fn distance_below(&self, other: &Self, cap_m: f64) -> f64 {
        let gap_m = self.gap_m(other);
        let apart = gap_m > 0.0;
        if !apart {
            return cap_m.min(0.0);
        }
        if gap_m > cap_m + ROUNDING_M {
            return cap_m;
        }
        // For two disjoint convex polygons, one of the two nearest points is a corner.
        let squared = other.nearest_corner_squared(self).min(self.nearest_corner_squared(other));
        cap_m.min(squared.sqrt())
    }

    /// Distance between the two centres, metres.
    pub(super) fn center_distance_m(&self, other: &Self) -> f64 {
        math::hypot(other.x_m - self.x_m, other.y_m - self.y_m)
    }
}
