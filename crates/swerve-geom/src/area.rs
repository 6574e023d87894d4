//! Areas of rectangles on the ground: intersection and convex hull of two.

use crate::{Obb, Point2};

/// Largest number of corners of the intersection of two rectangles.
const CORNERS_MAX: usize = 8;

/// Intersection area of two rectangles, m²: the corners of one are clipped by each side of the other (Sutherland and
/// Hodgman 1974). Zero if an input is not finite.
pub fn shared_area_m2<F: Copy>(a: &Obb<F>, b: &Obb<F>) -> f64 {
    let mut polygon = Vec::with_capacity(CORNERS_MAX);
    polygon.extend(a.corners());
    let cutter = b.corners();
    for k in 0..4 {
        let (from, side) = (cutter[k], cutter[(k + 1) % 4] - cutter[k]);
        // Corners are in counter-clockwise order: inside is to the left.
        let inside = |p: Point2<F>| side.cross(p - from);
        let mut rest = Vec::with_capacity(CORNERS_MAX);
        for (i, &p) in polygon.iter().enumerate() {
            let q = polygon[(i + 1) % polygon.len()];
            let (at_p, at_q) = (inside(p), inside(q));
            if at_p >= 0.0 {
                rest.push(p);
            }
            if (at_p > 0.0 && at_q < 0.0) || (at_p < 0.0 && at_q > 0.0) {
                rest.push(p + (q - p) * (at_p / (at_p - at_q)));
            }
        }
        polygon = rest;
    }
    let Some(&first) = polygon.first() else { return 0.0 };
    let doubled: f64 = polygon.windows(2).map(|pair| (pair[0] - first).cross(pair[1] - first)).sum();
    if doubled.is_finite() { (0.5 * doubled).max(0.0) } else { 0.0 }
}

/// Area of the convex hull of two rectangles, m² (Andrew's monotone chain, 1979). Not finite if an input is not.
pub fn hull_area_m2<F: Copy>(a: &Obb<F>, b: &Obb<F>) -> f64 {
    let mut corners = [a.corners(), b.corners()].concat();
    corners.sort_unstable_by(|p, q| p.x_m.total_cmp(&q.x_m).then(p.y_m.total_cmp(&q.y_m)));
    let last = corners[corners.len() - 1];
    let below = chain_area_m2(corners[0], corners.iter().copied());
    below + chain_area_m2(last, corners.iter().rev().copied())
}

/// Area between the straight line from the first point to the last and the convex chain to its right.
fn chain_area_m2<F: Copy>(first: Point2<F>, points: impl Iterator<Item = Point2<F>>) -> f64 {
    let mut chain: Vec<Point2<F>> = Vec::with_capacity(2 * CORNERS_MAX);
    for point in points {
        while let [.., p, q] = chain[..]
            && (q - p).cross(point - q) <= 0.0
        {
            chain.pop();
        }
        chain.push(point);
    }
    0.5 * chain.windows(2).map(|pair| (pair[0] - first).cross(pair[1] - first)).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pose2;
    use proptest::prelude::*;

    fn rectangle(x: f64, y: f64, heading: f64) -> Obb {
        Obb::new(Pose2::new(x, y, heading), 4.0, 2.0)
    }

    #[test]
    fn areas_match_closed_forms() {
        let at = rectangle(0.0, 0.0, 0.0);
        for (other, shared, hull) in [
            (at, 8.0, 8.0),
            (rectangle(2.0, 0.0, 0.0), 4.0, 12.0),
            (rectangle(10.0, 0.0, 0.0), 0.0, 28.0),
            (rectangle(0.0, 0.0, core::f64::consts::FRAC_PI_2), 4.0, 14.0),
        ] {
            assert!((shared_area_m2(&at, &other) - shared).abs() < 1e-12, "{other:?}");
            assert!((hull_area_m2(&at, &other) - hull).abs() < 1e-12, "{other:?}");
        }
        assert!(!hull_area_m2(&at, &rectangle(f64::NAN, 0.0, 0.0)).is_finite());
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
        #[test]
        fn hull_contains_both_rectangles_in_either_order(
            x in -9.0..9.0, y in -9.0..9.0, h in -3.0..3.0, g in -3.0..3.0,
        ) {
            let (a, b) = (rectangle(0.0, 0.0, g), rectangle(x, y, h));
            let hull = hull_area_m2(&a, &b);
            prop_assert!((hull - hull_area_m2(&b, &a)).abs() < 1e-9);
            prop_assert!(hull >= 16.0 - shared_area_m2(&a, &b) - 1e-9);
            let reach = 0.5 * (x.abs() + y.abs()) + a.radius();
            prop_assert!(hull <= 4.0 * reach * reach + 1e-9, "within a square around both");
        }
    }
}
