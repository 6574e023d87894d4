//! Rectangles, their distances and overlaps.

use swerve_geom::{Obb, Point2, math};

/// An oriented rectangle with its direction at hand, so that repeated checks need no trigonometry.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Solid {
    /// Centre, metres.
    pub x_m: f64,
    /// Centre, metres.
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
    /// Radius of the circle around its centre that holds it, metres.
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

    /// Squared distance from `point`, m²; zero inside.
    fn distance_squared_to(&self, point: Point2) -> f64 {
        let (dx, dy) = (point.x_m - self.x_m, point.y_m - self.y_m);
        let along = ((self.cos * dx + self.sin * dy).abs() - self.half_length_m).max(0.0);
        let across = ((self.cos * dy - self.sin * dx).abs() - self.half_width_m).max(0.0);
        along * along + across * across
    }

    /// Whether the two share a point (separating axis theorem).
    pub fn overlaps(&self, other: &Self) -> bool {
        let (dx, dy) = (other.x_m - self.x_m, other.y_m - self.y_m);
        let c = (self.cos * other.cos + self.sin * other.sin).abs();
        let s = (self.cos * other.sin - self.sin * other.cos).abs();
        let apart = |along: f64, own: f64, l: f64, w: f64| along.abs() > own + l + w;
        let (a, b) = (self, other);
        !(apart(a.cos * dx + a.sin * dy, a.half_length_m, b.half_length_m * c, b.half_width_m * s)
            || apart(a.cos * dy - a.sin * dx, a.half_width_m, b.half_length_m * s, b.half_width_m * c)
            || apart(b.cos * dx + b.sin * dy, b.half_length_m, a.half_length_m * c, a.half_width_m * s)
            || apart(b.cos * dy - b.sin * dx, b.half_width_m, a.half_length_m * s, a.half_width_m * c))
    }

    /// Distance between the two, metres; zero when they share a point.
    pub fn distance_m(&self, other: &Self) -> f64 {
        if self.overlaps(other) {
            return 0.0;
        }
        // Of two convex polygons apart, one of the two nearest points is a corner.
        let nearest = |of: &Self, to: &Self| {
            of.corners().into_iter().map(|c| to.distance_squared_to(c)).fold(f64::INFINITY, f64::min)
        };
        nearest(self, other).min(nearest(other, self)).sqrt()
    }

    /// Distance of the two centres, metres.
    pub(super) fn center_distance_m(&self, other: &Self) -> f64 {
        math::hypot(other.x_m - self.x_m, other.y_m - self.y_m)
    }
}
