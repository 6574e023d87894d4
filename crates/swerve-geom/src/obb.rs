//! Oriented boxes in the ground plane.

use serde::{Deserialize, Serialize};

use crate::{Map, Point2, Pose2, Vector2, math};

/// An oriented rectangle in the ground plane of frame `F`.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Obb<F = Map> {
    /// Pose of the rectangle's centre.
    pub center: Pose2<F>,
    /// Half its extent along its heading, metres.
    pub half_length_m: f64,
    /// Half its extent across its heading, metres.
    pub half_width_m: f64,
}

impl<F: Copy> Obb<F> {
    /// A rectangle of the given full length and width around `center`.
    pub const fn new(center: Pose2<F>, length_m: f64, width_m: f64) -> Self {
        Self { center, half_length_m: 0.5 * length_m, half_width_m: 0.5 * width_m }
    }

    /// The axis-aligned rectangle between two corners.
    pub fn axis_aligned(x_min_m: f64, y_min_m: f64, x_max_m: f64, y_max_m: f64) -> Self {
        let center = Pose2::new(0.5 * (x_min_m + x_max_m), 0.5 * (y_min_m + y_max_m), 0.0);
        Self::new(center, x_max_m - x_min_m, y_max_m - y_min_m)
    }

    /// The rectangle grown by `margin_m` on all four sides.
    #[must_use]
    pub fn grown(&self, margin_m: f64) -> Self {
        Self {
            half_length_m: self.half_length_m + margin_m,
            half_width_m: self.half_width_m + margin_m,
            ..*self
        }
    }

    /// The corners: front left, rear left, rear right, front right (counter-clockwise).
    pub fn corners(&self) -> [Point2<F>; 4] {
        let (sin, cos) = math::sin_cos(self.center.heading_rad);
        let ahead = Vector2::new(cos, sin) * self.half_length_m;
        let left = Vector2::new(-sin, cos) * self.half_width_m;
        let c = self.center.point();
        [c + ahead + left, c - ahead + left, c - ahead - left, c + ahead - left]
    }

    /// Radius of the smallest circle around the centre that holds the rectangle.
    pub fn radius(&self) -> f64 {
        math::hypot(self.half_length_m, self.half_width_m)
    }

    /// Whether `point` lies inside or on the border.
    pub fn contains(&self, point: Point2<F>) -> bool {
        let local: Point2<F> = self.center.to_local(point);
        local.x_m.abs() <= self.half_length_m && local.y_m.abs() <= self.half_width_m
    }

    /// Distance from `point` to the rectangle, metres; zero inside.
    pub fn distance_to_point(&self, point: Point2<F>) -> f64 {
        let local: Point2<F> = self.center.to_local(point);
        let dx = (local.x_m.abs() - self.half_length_m).max(0.0);
        let dy = (local.y_m.abs() - self.half_width_m).max(0.0);
        math::hypot(dx, dy)
    }

    /// Whether the two rectangles share a point (separating axis theorem).
    pub fn overlaps(&self, other: &Self) -> bool {
        let between = other.center.point() - self.center.point();
        let (a, b) = (self.center.direction(), other.center.direction());
        let reach = |obb: &Self, dir: Vector2<F>, axis: Vector2<F>| {
            obb.half_length_m * dir.dot(axis).abs() + obb.half_width_m * dir.left().dot(axis).abs()
        };
        [a, a.left(), b, b.left()]
            .into_iter()
            .all(|axis| between.dot(axis).abs() <= reach(self, a, axis) + reach(other, b, axis))
    }

    /// Distance between the two rectangles, metres; zero when they share a point.
    pub fn distance(&self, other: &Self) -> f64 {
        if self.overlaps(other) {
            return 0.0;
        }
        // Of two convex polygons apart, one of the two nearest points is a corner.
        let nearest = |of: &Self, to: &Self| {
            of.corners().into_iter().map(|c| to.distance_to_point(c)).fold(f64::INFINITY, f64::min)
        };
        nearest(self, other).min(nearest(other, self))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn obb(x: f64, y: f64, h: f64) -> Obb {
        Obb::new(Pose2::new(x, y, h), 4.0, 2.0)
    }

    #[test]
    fn closed_forms() {
        assert_eq!(obb(0.0, 0.0, 0.0).distance(&obb(6.0, 0.0, 0.0)), 2.0);
        assert_eq!(obb(0.0, 0.0, 0.0).distance(&obb(0.0, 5.0, 0.0)), 3.0);
        assert!((obb(0.0, 0.0, 0.0).distance(&obb(7.0, 5.0, 0.0)) - 18f64.sqrt()).abs() < 1e-12);
        assert_eq!(obb(0.0, 0.0, 0.0).distance(&obb(1.0, 1.0, 0.7)), 0.0);
        assert!(obb(0.0, 0.0, 0.0).overlaps(&obb(0.1, 0.0, 0.0).grown(-0.9)), "containment overlaps");
        assert_eq!(obb(0.0, 0.0, 0.0).distance_to_point(Point2::new(5.0, 5.0)), 5.0);
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
        #[test]
        fn distance_is_symmetric_and_agrees_with_overlap(
            x in -9.0..9.0, y in -9.0..9.0, h in -3.0..3.0, g in -3.0..3.0,
        ) {
            let (a, b) = (obb(0.0, 0.0, g), obb(x, y, h));
            prop_assert!((a.distance(&b) - b.distance(&a)).abs() < 1e-9);
            // Against a brute-force sampling of both borders.
            let border = |o: &Obb| -> Vec<Point2> {
                let c = o.corners();
                (0..4).flat_map(|i| (0..40).map(move |k| c[i] + (c[(i + 1) % 4] - c[i]) * (f64::from(k) / 40.0))).collect()
            };
            let (pa, pb) = (border(&a), border(&b));
            let sampled = pa.iter().flat_map(|p| pb.iter().map(|q| p.distance(*q))).fold(f64::INFINITY, f64::min);
            if a.distance(&b) > 0.0 {
                prop_assert!(sampled >= a.distance(&b) - 1e-9 && sampled <= a.distance(&b) + 0.11);
            } else {
                prop_assert!(sampled <= 0.11 || pa.iter().any(|p| b.contains(*p)) || pb.iter().any(|p| a.contains(*p)));
            }
        }
    }
}
