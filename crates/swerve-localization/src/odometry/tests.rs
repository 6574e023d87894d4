use nalgebra::{Isometry3, Point3, Vector3};
use swerve_core::Rng;
use swerve_geom::math;

use super::{Odometry, Turned};
use crate::eskf::exp;

/// Surfaces of a street with alternately set-back houses, in the map.
fn street() -> Vec<Vector3<f64>> {
    let mut rng = Rng::keyed(11, "street", &[]);
    let mut points = Vec::new();
    for house in 0..30 {
        let begin = 8.0 * f64::from(house) - 20.0;
        let back = rng.uniform(7.0, 10.0);
        for _ in 0..4500 {
            let (along, up) = (rng.uniform(0.0, 6.5), rng.uniform(0.0, 5.0));
            points.push(Vector3::new(begin + along, back, up));
            points.push(Vector3::new(begin + along + 2.0, -back - 1.0, up));
            points.push(Vector3::new(begin, back + 0.4 * along, up));
            points.push(Vector3::new(begin + 2.0, -back - 1.0 - 0.4 * along, up));
            points.push(Vector3::new(begin + 1.23 * along, rng.uniform(-7.0, 7.0), 0.0));
        }
    }
    points
}

/// Pose of a lidar 1.8 m above ground at 14 m/s with a varying heading.
fn pose(t_s: f64) -> Isometry3<f64> {
    let yaw = 0.05 * math::sin(0.8 * t_s);
    let place = Vector3::new(14.0 * t_s, 0.6 * math::sin(0.5 * t_s), 1.8);
    Isometry3::from_parts(place.into(), exp(&Vector3::new(0.0, 0.0, yaw)))
}

/// A scan that ends at an instant: points of the street, each as seen from the lidar at its own instant, with 2 cm of
/// noise.
fn turn(street: &[Vector3<f64>], end_s: f64, rng: &mut Rng) -> Vec<(Vector3<f64>, f64)> {
    let mut points = Vec::new();
    for _ in 0..30_000 {
        let point = street[rng.below(street.len())];
        let share = -rng.unit();
        let seen = pose(end_s + 0.1 * share).inverse() * Point3::from(point);
        let length = seen.coords.norm();
        if length < 60.0 {
            points.push((seen.coords * (1.0 + 0.02 * rng.normal() / length), share));
        }
    }
    points
}

#[test]
fn odometry_drifts_less_than_half_a_percent_along_a_street() {
    let (street, mut rng) = (street(), Rng::keyed(1, "turns", &[]));
    let (mut odometry, mut end) = (Odometry::new(), Isometry3::identity());
    for k in 0..=72 {
        let turned = odometry.take(&turn(&street, 0.1 * f64::from(k), &mut rng));
        assert!(matches!(turned, Turned::At(_)), "{k}: {turned:?}");
        end = turned.pose();
    }
    let truth = pose(0.0).inverse() * pose(7.2);
    let off_m = (truth.translation.vector - end.translation.vector).norm();
    let way_m = truth.translation.vector.norm();
    println!("{off_m:.3} m after {way_m:.1} m: {:.2} %", 100.0 * off_m / way_m);
    assert!(off_m / way_m < 0.005, "{off_m} m after {way_m} m");
}

#[test]
fn odometry_continues_after_scans_without_points() {
    let (street, mut rng) = (street(), Rng::keyed(2, "turns", &[]));
    let mut odometry = Odometry::new();
    let nothing = odometry.take(&[]);
    assert_eq!(nothing, Turned::Unmatched(Isometry3::identity()));
    for k in 0..10 {
        odometry.take(&turn(&street, 0.1 * f64::from(k), &mut rng));
    }
    let wild = [
        Vector3::new(f64::NAN, 1.0, 1.0),
        Vector3::new(f64::INFINITY, 0.0, 0.0),
        Vector3::new(1e300, 0.0, 0.0),
    ];
    let blind = odometry.take(&wild.map(|point| (point, f64::NAN)));
    assert!(matches!(blind, Turned::Unmatched(_)), "{blind:?}");
    let after = odometry.take(&turn(&street, 1.1, &mut rng));
    let truth = pose(0.0).inverse() * pose(1.1);
    let off_m = (truth.translation.vector - after.pose().translation.vector).norm();
    assert!(matches!(after, Turned::At(_)) && off_m < 0.1, "{off_m} {after:?}");
}
