use nalgebra::{Isometry3, Vector3};
use swerve_core::Rng;
use swerve_geom::simd::both;

use super::{Limits, Neighbours, align, pose_of};
use crate::eskf::exp;
use crate::grid::downsampled;
use crate::voxels::{VoxelMap, VoxelSums, coarser};
use crate::{icp, ply};

/// Inside of a yard: ground, two pairs of walls at a right angle, with noise; only the walls along x if `is_open`.
pub(crate) fn yard(is_open: bool) -> Vec<Vector3<f64>> {
    let mut rng = Rng::keyed(7, "yard", &[]);
    let mut points = Vec::new();
    for _ in 0..40_000 {
        let (a, b) = (rng.uniform(-20.0, 20.0), rng.uniform(0.0, 5.0));
        let noise = rng.uniform(-0.02, 0.02);
        points.push(Vector3::new(a, 3.0 * b - 7.5, noise));
        points.push(Vector3::new(a, 8.3 + noise, b));
        points.push(Vector3::new(a, -8.3 + noise, b));
        if !is_open {
            points.push(Vector3::new(-6.3 + noise, 0.6 * b - 7.5, 0.1 * (a + 20.0)));
            points.push(Vector3::new(12.4 + noise, 3.0 * b - 7.5, 0.1 * (a + 20.0)));
        }
    }
    points
}

fn pose(x: f64, y: f64, yaw: f64) -> Isometry3<f64> {
    Isometry3::from_parts(Vector3::new(x, y, 0.0).into(), exp(&Vector3::new(0.0, 0.0, yaw)))
}

/// Points as seen from a pose, downsampled.
fn scan(points: &[Vector3<f64>], from: &Isometry3<f64>) -> Vec<Vector3<f64>> {
    let inverse = from.inverse();
    let seen: Vec<_> = points
        .iter()
        .step_by(3)
        .map(|point| inverse * nalgebra::Point3::from(*point))
        .map(|p| p.coords)
        .collect();
    downsampled(&seen, 0.25)
}

#[test]
fn registration_recovers_the_pose() {
    let points = yard(false);
    let mut sums = VoxelSums::new(1.0);
    points.iter().for_each(|point| sums.add(point));
    let voxels = sums.voxels();
    let [coarse, middle, fine] = [4, 2, 1].map(|k| VoxelMap::new(f64::from(k), &coarser(&voxels, 1.0, k)));
    let truth = pose(0.4, -0.4, 0.03);
    let scan = scan(&points, &truth);
    for neighbours in [Neighbours::Direct1, Neighbours::Direct7] {
        let limits = Limits { neighbours, ..Limits::default() };
        let found =
            align(&[&coarse, &middle, &fine], &scan, &pose(0.0, 0.0, 0.0), &limits).expect("they match");
        let off = truth.inverse() * found.map_from_scan;
        assert!(found.converged && found.degenerate == 0, "{found:?}");
        assert!(off.translation.vector.norm() < 0.02 && off.rotation.vector().norm() < 0.002, "{off:?}");
        let variance = found.covariance.fixed_view::<3, 3>(0, 0).trace();
        assert!((1e-6..0.01).contains(&variance), "{variance}");
    }
}

#[test]
fn registration_has_the_same_bits_with_wide_instructions() {
    let points = yard(false);
    let maps = [2.0, 1.0].map(|size_m| VoxelMap::of_points(size_m, &points));
    let scan = scan(&points, &pose(0.4, -0.4, 0.03));
    for neighbours in [Neighbours::Direct1, Neighbours::Direct7] {
        let limits = Limits { neighbours, ..Limits::default() };
        // Counts that leave the last lanes partly filled.
        for count in [1000, 1001, 1002, 1003] {
            let [wide, narrow] = both(|| {
                align(&[&maps[0], &maps[1]], &scan[..count], &pose(0.0, 0.0, 0.0), &limits)
                    .expect("they match")
            });
            assert_eq!(wide, narrow);
        }
    }
}

#[test]
fn direction_along_bare_walls_is_unobservable() {
    let points = yard(true);
    let map = VoxelMap::of_points(1.0, &points);
    let scan: Vec<_> = scan(&points, &pose(0.0, 0.0, 0.0)).into_iter().filter(|p| p.x.abs() < 12.0).collect();
    let found = align(&[&map], &scan, &pose(0.0, 0.1, 0.0), &Limits::default()).expect("they match");
    assert_eq!(found.degenerate, 1, "{found:?}");
    let along = found.covariance[(0, 0)].sqrt();
    let across = found.covariance[(1, 1)].sqrt();
    assert!(along > 9.0 && across < 0.5, "{along} {across}");
    assert!((found.map_from_scan.translation.y).abs() < 0.01, "{found:?}");
}

#[test]
fn empty_and_invalid_scans_match_nothing() {
    let map = VoxelMap::of_points(1.0, &yard(false));
    let nowhere = Vector3::new(f64::NAN, 0.0, f64::INFINITY);
    for scan in [vec![], vec![nowhere; 100], vec![Vector3::new(1e30, 0.0, 0.0)]] {
        assert!(align(&[&map], &scan, &pose(0.0, 0.0, 0.0), &Limits::default()).is_none());
    }
    let empty = VoxelMap::of_points(1.0, &[]);
    assert!(empty.is_empty());
    assert!(align(&[&empty], &yard(false), &pose(0.0, 0.0, 0.0), &Limits::default()).is_none());
    assert!(align(&[], &yard(false), &pose(0.0, 0.0, 0.0), &Limits::default()).is_none());
}

/// Two sweeps of a street, half a metre apart, compared with their reference pose. Golden: that pose; VGICP of
/// small_gicp is 0.020 m and 0.383° from it on the same pair.
#[test]
fn street_sweeps_match_their_reference_pose() {
    let Some(folder) = swerve_tests::data_or_skip("localization/registration_pair") else { return };
    let cloud = |name: &str| ply::read(&std::fs::read(folder.join(name)).unwrap()).unwrap();
    let (source, target) = (downsampled(&cloud("source.ply"), 0.25), cloud("target.ply"));
    let text = std::fs::read_to_string(folder.join("T_target_source.txt")).unwrap();
    let rows: Vec<f64> = text.split_ascii_whitespace().map(|word| word.parse().unwrap()).collect();
    let reference = pose_of(&rows.try_into().unwrap()).unwrap();
    let mut sums = VoxelSums::new(2.0);
    target.iter().for_each(|point| sums.add(point));
    let voxels = sums.voxels();
    let [coarse, fine] = [2, 1].map(|k| VoxelMap::new(f64::from(2 * k), &coarser(&voxels, 2.0, k)));
    for neighbours in [Neighbours::Direct1, Neighbours::Direct7] {
        let limits = Limits { neighbours, ..Limits::default() };
        let found = align(&[&coarse, &fine], &source, &Isometry3::identity(), &limits).unwrap();
        let off = reference.inverse() * found.map_from_scan;
        let (m, deg) = (off.translation.vector.norm(), off.rotation.angle().to_degrees());
        println!(
            "{neighbours:?}: {m} m, {deg}°, {} iterations, degenerate {}",
            found.iterations, found.degenerate
        );
        assert!(m < 0.02 && deg < 0.4, "{neighbours:?}: {m} m, {deg}°, {found:?}");
    }
    let mut map = icp::PointMap::new(1.0, 20);
    map.add(&downsampled(&target, 0.25));
    let found = icp::align(&map, &source, &Isometry3::identity(), [1.0, 1.0], 100).unwrap();
    let off = reference.inverse() * found.map_from_scan;
    let (m, deg) = (off.translation.vector.norm(), off.rotation.angle().to_degrees());
    println!("icp: {m} m, {deg}°, {} iterations", found.iterations);
    assert!(m < 0.04 && deg < 0.4 && found.converged, "{m} m, {deg}°, {found:?}");
}
