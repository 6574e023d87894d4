//! Distances between outlines on the ground, computed by parry.

use parry2d_f64::math::{Pose, Rotation, Vector};
use parry2d_f64::query;
use parry2d_f64::shape::{Ball, Cuboid, Shape};
use swerve_geom::{Obb, Pose2, math};

/// A rectangle or a circle with its pose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Body<S> {
    pose: Pose,
    shape: S,
}

/// Rectangle as a body.
pub(crate) fn rectangle(obb: &Obb) -> Body<Cuboid> {
    Body { pose: pose(obb.center), shape: Cuboid::new(Vector::new(obb.half_length_m, obb.half_width_m)) }
}

/// Circle around a pose as a body.
pub(crate) fn circle(center: Pose2, radius_m: f64) -> Body<Ball> {
    Body { pose: pose(center), shape: Ball::new(radius_m) }
}

impl<S: Shape> Body<S> {
    /// Distance between two bodies, metres; zero if they touch, NaN if a pose is not finite.
    pub(crate) fn distance_m<T: Shape>(&self, other: &Body<T>) -> f64 {
        // parry asserts conditions that NaN violates.
        if !(self.pose.is_finite() && other.pose.is_finite()) {
            return f64::NAN;
        }
        let measured = query::distance(&self.pose, &self.shape, &other.pose, &other.shape);
        measured.expect("parry measures rectangles and circles").distance
    }
}

/// Pose with Swerve's sine and cosine, which are bit-identical on every machine.
fn pose(pose: Pose2) -> Pose {
    let (sin, cos) = math::sin_cos(pose.heading_rad);
    Pose::from_parts(Vector::new(pose.x_m, pose.y_m), Rotation::from_cos_sin_unchecked(cos, sin))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared_area_m2;
    use parry2d_f64::transformation::convex_polygons_intersection_points;
    use swerve_core::Rng;

    /// A random rectangle up to 12 m long and 3 m wide, centred within `reach_m` of the origin along each axis.
    fn random(rng: &mut Rng, reach_m: f64) -> Obb {
        let at = [rng.uniform(-reach_m, reach_m), rng.uniform(-reach_m, reach_m)];
        let center = Pose2::new(at[0], at[1], rng.uniform(-4.0, 4.0));
        Obb::new(center, rng.uniform(0.2, 12.0), rng.uniform(0.2, 3.0))
    }

    #[test]
    fn rectangle_distances_match_parry() {
        let mut rng = Rng::keyed(1, "rectangles", &[]);
        let (mut apart, mut worst_m) = (0, 0.0_f64);
        for _ in 0..20_000 {
            let (a, b) = (random(&mut rng, 5.0), random(&mut rng, 5.0));
            let (ours, theirs) = (a.distance(&b), rectangle(&a).distance_m(&rectangle(&b)));
            assert_eq!(ours == 0.0, theirs == 0.0, "{a:?} {b:?}");
            worst_m = worst_m.max((ours - theirs).abs());
            apart += usize::from(ours > 0.0);
        }
        assert!((5_000..15_000).contains(&apart), "{apart} of 20000 are apart");
        assert!(worst_m < 1e-13, "{worst_m:e} m");
    }

    #[test]
    fn circle_to_rectangle_distances_match_parry() {
        let mut rng = Rng::keyed(1, "circles", &[]);
        for _ in 0..20_000 {
            let a = random(&mut rng, 4.0);
            let center = Pose2::new(rng.uniform(-9.0, 9.0), rng.uniform(-9.0, 9.0), 0.0);
            let radius_m = rng.uniform(0.1, 1.0);
            let ours = (a.distance_to_point(center.point()) - radius_m).max(0.0);
            let theirs = rectangle(&a).distance_m(&circle(center, radius_m));
            assert!((ours - theirs).abs() < 1e-13, "{a:?} {center:?} {radius_m}: {ours} {theirs}");
        }
    }

    #[test]
    fn distance_of_non_finite_poses_is_nan() {
        let mut rng = Rng::keyed(1, "not finite", &[]);
        let (a, mut b) = (random(&mut rng, 4.0), random(&mut rng, 4.0));
        for bad in [f64::NAN, f64::INFINITY] {
            b.center.x_m = bad;
            assert!(rectangle(&a).distance_m(&rectangle(&b)).is_nan());
            assert!(rectangle(&a).distance_m(&circle(b.center, 1.0)).is_nan());
        }
    }

    fn shared_by_parry_m2(a: &Obb, b: &Obb) -> f64 {
        let corners = |obb: &Obb| obb.corners().map(|c| Vector::new(c.x_m, c.y_m));
        let mut polygon = Vec::new();
        convex_polygons_intersection_points(&corners(a), &corners(b), &mut polygon);
        let Some(&first) = polygon.first() else { return 0.0 };
        0.5 * polygon.windows(2).map(|p| (p[0] - first).perp_dot(p[1] - first)).sum::<f64>()
    }

    #[test]
    fn shared_areas_match_parry_except_for_coincident_rectangles() {
        let mut rng = Rng::keyed(1, "areas", &[]);
        for _ in 0..20_000 {
            let (a, b) = (random(&mut rng, 2.0), random(&mut rng, 2.0));
            let (ours, theirs) = (shared_area_m2(&a, &b), shared_by_parry_m2(&a, &b));
            assert!((ours - theirs).abs() < 1e-12, "{a:?} {b:?}: {ours} {theirs}");
        }
        // Reason for the separate implementation: for coincident rectangles, i.e. a perfect detection, parry counts the
        // area twice.
        let square = Obb::new(Pose2::new(0.0, 0.0, 0.0), 2.0, 2.0);
        assert_eq!((shared_area_m2(&square, &square), shared_by_parry_m2(&square, &square)), (4.0, 8.0));
    }
}
