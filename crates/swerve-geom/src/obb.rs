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
    /// Creates a rectangle of the given full length and width around `center`.
    pub const fn new(center: Pose2<F>, length_m: f64, width_m: f64) -> Self {
        Self { center, half_length_m: 0.5 * length_m, half_width_m: 0.5 * width_m }
    }

    /// Creates the axis-aligned rectangle between two corners.
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

    /// Area, m².
    pub fn area_m2(&self) -> f64 {
        4.0 * self.half_length_m * self.half_width_m
    }

    /// Radius of the circumscribed circle.
    pub fn radius(&self) -> f64 {
        math::hypot(self.half_length_m, self.half_width_m)
    }

    /// Returns true if `point` is inside or on the border.
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

    /// Returns true if the two rectangles are certainly more than `reach_m` apart: a quick test without a square root,
    /// for which two sides of a rectangle stand in for its diagonal, as they are longer. False does not mean that they
    /// are near.
    pub fn is_beyond(&self, other: &Self, reach_m: f64) -> bool {
        let sides_m = self.half_length_m + self.half_width_m + (other.half_length_m + other.half_width_m);
        let apart_m = sides_m + reach_m;
        (other.center.point() - self.center.point()).norm_squared() > 1.01 * apart_m * apart_m
    }

    /// Returns true if the two rectangles share a point (separating axis theorem).
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

    /// Distance between the two rectangles, metres; zero if they share a point.
    pub fn distance(&self, other: &Self) -> f64 {
        if self.overlaps(other) {
            return 0.0;
        }
        // For two disjoint convex polygons, one of the two nearest points is a corner.
        let nearest = |of: &Self, to: &Self| {
            of.corners().into_iter().map(|c| to.distance_to_point(c)).fold(f64::INFINITY, f64::min)
        };
        nearest(self, other).min(nearest(other, self))
    }

    /// Time until `other`, moving at `relative_mps` relative to this rectangle, first touches it, seconds; zero if it
    /// does already, `None` if it never will. Neither rotates. They are disjoint while their projections on one of
    /// their four axes are (separating axis theorem).
    pub fn time_to_contact_s(&self, other: &Self, relative_mps: Vector2<F>) -> Option<f64> {
        let between = other.center.point() - self.center.point();
        let (a, b) = (self.center.direction(), other.center.direction());
        let reach = |obb: &Self, ahead: Vector2<F>, axis: Vector2<F>| {
            obb.half_length_m * ahead.dot(axis).abs() + obb.half_width_m * ahead.left().dot(axis).abs()
        };
        let slabs = [a, a.left(), b, b.left()].map(|axis| {
            (between.dot(axis), relative_mps.dot(axis), reach(self, a, axis) + reach(other, b, axis))
        });
        entry_s(slabs)
    }

    /// As [`time_to_contact_s`](Self::time_to_contact_s), for a circle.
    pub fn time_to_circle_s(
        &self,
        center: Point2<F>,
        radius_m: f64,
        relative_mps: Vector2<F>,
    ) -> Option<f64> {
        let (ahead, between) = (self.center.direction(), center - self.center.point());
        let along = (between.dot(ahead), relative_mps.dot(ahead));
        let across = (between.dot(ahead.left()), relative_mps.dot(ahead.left()));
        // The rectangle grown by the radius has round corners: it is the union of two rectangles and four circles.
        let slab = |(distance_m, speed_mps): (f64, f64), reach_m: f64| (distance_m, speed_mps, reach_m);
        let rectangles = [(radius_m, 0.0), (0.0, radius_m)].map(|(length_m, width_m)| {
            entry_s([slab(along, self.half_length_m + length_m), slab(across, self.half_width_m + width_m)])
        });
        let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].map(|(x, y)| {
            let from = (along.0 - x * self.half_length_m, across.0 - y * self.half_width_m);
            time_to_radius_s(from, (along.1, across.1), radius_m)
        });
        rectangles.into_iter().chain(corners).flatten().reduce(f64::min)
    }
}

/// Earliest time from now at which a point is within all slabs, seconds. A slab is the point's distance from its
/// centre, the point's speed and the half width.
fn entry_s<const N: usize>(slabs: [(f64, f64, f64); N]) -> Option<f64> {
    let (mut enter_s, mut leave_s) = (0.0_f64, f64::INFINITY);
    for (distance_m, speed_mps, reach_m) in slabs {
        if speed_mps == 0.0 {
            if distance_m.abs() > reach_m {
                return None;
            }
            continue;
        }
        let (one, other) = ((-reach_m - distance_m) / speed_mps, (reach_m - distance_m) / speed_mps);
        enter_s = enter_s.max(one.min(other));
        leave_s = leave_s.min(one.max(other));
    }
    (enter_s <= leave_s).then_some(enter_s)
}

/// Earliest time from now at which a moving point is within `radius_m` of the origin, seconds.
fn time_to_radius_s((x, y): (f64, f64), (vx, vy): (f64, f64), radius_m: f64) -> Option<f64> {
    let beyond = x * x + y * y - radius_m * radius_m;
    if beyond <= 0.0 {
        return Some(0.0);
    }
    let (speed_squared, closing) = (vx * vx + vy * vy, -(x * vx + y * vy));
    let root = closing * closing - speed_squared * beyond;
    (closing > 0.0 && root >= 0.0).then(|| (closing - root.sqrt()) / speed_squared)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn obb(x: f64, y: f64, h: f64) -> Obb {
        Obb::new(Pose2::new(x, y, h), 4.0, 2.0)
    }

    #[test]
    fn distances_match_closed_forms() {
        assert_eq!(obb(0.0, 0.0, 0.0).distance(&obb(6.0, 0.0, 0.0)), 2.0);
        assert_eq!(obb(0.0, 0.0, 0.0).distance(&obb(0.0, 5.0, 0.0)), 3.0);
        assert!((obb(0.0, 0.0, 0.0).distance(&obb(7.0, 5.0, 0.0)) - 18f64.sqrt()).abs() < 1e-12);
        assert_eq!(obb(0.0, 0.0, 0.0).distance(&obb(1.0, 1.0, 0.7)), 0.0);
        assert!(obb(0.0, 0.0, 0.0).overlaps(&obb(0.1, 0.0, 0.0).grown(-0.9)), "containment overlaps");
        assert_eq!(obb(0.0, 0.0, 0.0).distance_to_point(Point2::new(5.0, 5.0)), 5.0);
    }

    /// Half sides of 2 m and 1 m each: beyond 6 m and the reach, with a hundredth of the square in reserve.
    #[test]
    fn rectangle_is_beyond_the_sum_of_half_sides_and_reach() {
        let beyond = |x, h, reach_m| obb(0.0, 0.0, 0.0).is_beyond(&obb(x, 0.0, h), reach_m);
        for h in [0.0, 0.7, 1.6] {
            assert_eq!([beyond(6.02, h, 0.0), beyond(6.04, h, 0.0)], [false, true], "{h}");
            assert_eq!([beyond(-16.07, h, 10.0), beyond(-16.09, h, 10.0)], [false, true], "{h}");
        }
        assert!(!beyond(1e9, 0.0, f64::INFINITY));
        assert!(!beyond(f64::NAN, 0.0, 1.0));
    }

    #[test]
    fn time_to_contact_is_gap_over_closing_speed() {
        let still = obb(0.0, 0.0, 0.0);
        let time = |b: &Obb, x, y| still.time_to_contact_s(b, Vector2::new(x, y));
        assert_eq!(time(&obb(24.0, 0.0, 0.0), -10.0, 0.0), Some(2.0));
        assert_eq!(time(&obb(24.0, 1.9, 0.0), -10.0, 0.0), Some(2.0));
        assert_eq!(time(&obb(24.0, 2.1, 0.0), -10.0, 0.0), None);
        assert_eq!(time(&obb(24.0, 0.0, 0.0), 10.0, 0.0), None);
        assert_eq!(time(&obb(3.0, 0.0, 0.0), 10.0, 0.0), Some(0.0));
        // From the side, 12 m away: half width of 1 m and half length of 2 m between.
        let crossing = obb(0.0, -12.0, core::f64::consts::FRAC_PI_2);
        let time_s = time(&crossing, 0.0, 3.0).unwrap();
        assert!((time_s - 3.0).abs() < 1e-12, "{time_s}");
        // It approaches from the side and has passed before contact.
        assert_eq!(time(&crossing, 3.0, 3.0), None);
    }

    #[test]
    fn circle_touches_a_side_at_its_distance_and_a_corner_later() {
        let still = obb(0.0, 0.0, 0.0);
        let time = |x, y, vx| still.time_to_circle_s(Point2::new(x, y), 0.5, Vector2::new(vx, 0.0));
        // The front is at 2 m. The side is touched up to 1.5 m across: a circle at 1.6 m passes.
        assert_eq!(time(12.5, 0.0, -5.0), Some(2.0));
        assert_eq!(time(12.5, 1.6, -5.0), None);
        assert_eq!(time(12.5, 0.0, 5.0), None);
        assert_eq!(time(2.4, 0.0, 5.0), Some(0.0));
        // At 1.3 m across it touches the corner (2, 1) from 0.4 m ahead: 0.3² + 0.4² = 0.5².
        let time_s = time(12.4, 1.3, -5.0).unwrap();
        assert!((time_s - 2.0).abs() < 1e-12, "{time_s}");
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
        #[test]
        fn distance_is_zero_at_the_time_to_contact_and_positive_before(
            x in -9.0..9.0, y in -9.0..9.0, h in -3.0..3.0, vx in -5.0..5.0, vy in -5.0..5.0,
        ) {
            let (still, other, moves) = (obb(0.0, 0.0, 0.4), obb(x, y, h), Vector2::new(vx, vy));
            let after = |s: f64| Obb { center: Pose2::new(x + vx * s, y + vy * s, h), ..other };
            let steps = (0..200).map(|k| 0.05 * f64::from(k));
            match still.time_to_contact_s(&other, moves) {
                Some(time_s) => {
                    prop_assert!(still.distance(&after(time_s)) < 1e-9);
                    prop_assert!(steps.take_while(|s| *s < time_s - 1e-9).all(|s| still.distance(&after(s)) > 0.0));
                }
                None => prop_assert!(steps.map(after).all(|other| still.distance(&other) > 0.0)),
            }
            let gap_m = |s: f64| still.distance_to_point(Point2::new(x + vx * s, y + vy * s)) - 0.5;
            let steps = (0..200).map(|k| 0.05 * f64::from(k));
            match still.time_to_circle_s(Point2::new(x, y), 0.5, moves) {
                Some(time_s) => {
                    prop_assert!(gap_m(time_s) < 1e-9);
                    prop_assert!(steps.take_while(|s| *s < time_s - 1e-9).all(|s| gap_m(s) > 0.0));
                }
                None => prop_assert!(steps.map(gap_m).all(|gap_m| gap_m > 0.0)),
            }
        }

        #[test]
        fn distance_is_symmetric_and_agrees_with_overlap(
            x in -9.0..9.0, y in -9.0..9.0, h in -3.0..3.0, g in -3.0..3.0,
        ) {
            let (a, b) = (obb(0.0, 0.0, g), obb(x, y, h));
            prop_assert!((a.distance(&b) - b.distance(&a)).abs() < 1e-9);
            // Compared with brute-force sampling of both borders.
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
