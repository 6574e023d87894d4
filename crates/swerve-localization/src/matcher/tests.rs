use nalgebra::{Isometry3, Vector3};

use super::{Guess, Matcher};
use crate::eskf::exp;
use crate::map_file::MapFile;
use crate::ndt::tests::yard;
use crate::sweep::Sweep;
use crate::voxels::VoxelSums;

fn map(points: &[Vector3<f64>]) -> MapFile {
    let mut sums = VoxelSums::new(1.0);
    points.iter().for_each(|point| sums.add(point));
    MapFile::new(1.0, sums.voxels())
}

fn pose(x: f64, y: f64, yaw: f64) -> Isometry3<f64> {
    Isometry3::from_parts(Vector3::new(x, y, 1.5).into(), exp(&Vector3::new(0.0, 0.0, yaw)))
}

fn turn(points: &[Vector3<f64>], from: &Isometry3<f64>) -> Vec<(Vector3<f64>, f64)> {
    let inverse = from.inverse();
    points.iter().step_by(3).map(|p| (inverse.rotation * p + inverse.translation.vector, 0.0)).collect()
}

fn guess(at: Isometry3<f64>, sigma_m: f64, sigma_rad: f64, particles: u32) -> Guess {
    Guess { map_from_lidar: at, sigma_m, sigma_rad, particles }
}

fn off(matcher: &Matcher, truth: &Isometry3<f64>) -> [f64; 2] {
    let off = truth.inverse() * matcher.pose();
    [off.translation.vector.norm(), off.rotation.angle()]
}

#[test]
fn matcher_tracks_from_a_rough_start_and_recovers_after_a_gap() {
    let points = yard(false);
    let map = map(&points);
    let still = Isometry3::identity();
    let mut matcher = Matcher::new(&map, 1, guess(pose(1.5, -1.0, 0.08), 1.5, 0.09, 200));
    let (mut last, mut same) = (pose(0.0, 0.0, 0.0), None);
    for k in 0..30 {
        let truth = pose(0.2 * f64::from(k), 0.0, 0.01 * f64::from(k));
        let moved = if k == 0 { still } else { last.inverse() * truth };
        last = truth;
        // Odometry has a scale error of 2 %; some scans in between are empty.
        let told = Isometry3::from_parts((moved.translation.vector * 1.02).into(), moved.rotation);
        let blind = (10..18).contains(&k);
        let seen = if blind { Vec::new() } else { turn(&points, &truth) };
        let found = matcher.take(&seen, &Sweep::steady(&still), &told);
        assert_eq!(found.is_none(), blind, "{k}");
        let [m, rad] = off(&matcher, &truth);
        assert!(m < if blind { 0.15 } else { 0.05 } && rad < 0.005, "{k}: {m} m, {rad} rad");
        same = found;
    }
    let mut again = Matcher::new(&map, 1, guess(last, 0.5, 0.05, 50));
    let first = again.take(&turn(&points, &last), &Sweep::steady(&still), &still).unwrap();
    let difference = first.map_from_scan.inverse() * same.unwrap().map_from_scan;
    assert!(difference.translation.vector.norm() < 0.02);
}

#[test]
fn global_search_without_a_heading_finds_the_same_bits_each_time() {
    let points = yard(false);
    let map = map(&points);
    let truth = pose(3.0, -1.0, 2.2);
    let still = Isometry3::identity();
    let find = || {
        let mut matcher = Matcher::new(&map, 3, guess(pose(0.0, 0.0, 0.0), 3.0, 3.0, 4000));
        let found = matcher.take(&turn(&points, &truth), &Sweep::steady(&still), &still);
        (found, matcher)
    };
    let (found, matcher) = find();
    let [m, rad] = off(&matcher, &truth);
    assert!(found.is_some() && m < 0.05 && rad < 0.01, "{m} m, {rad} rad");
    assert_eq!(find().0, found);
}

#[test]
fn starts_two_metres_and_five_degrees_off_converge() {
    let points = yard(false);
    let map = map(&points);
    let (truth, still) = (pose(1.0, -0.5, 0.3), Isometry3::identity());
    let seen = turn(&points, &truth);
    let mut matcher = Matcher::new(&map, 1, guess(truth, 1.5, 0.09, 200));
    for k in 0..20 {
        let angle = core::f64::consts::TAU * f64::from(k) / 20.0;
        let side = if k % 2 == 0 { 0.0873 } else { -0.0873 };
        let (sin, cos) = swerve_geom::math::sin_cos(angle);
        matcher.begin_at(guess(pose(1.0 + 2.0 * cos, -0.5 + 2.0 * sin, 0.3 + side), 1.5, 0.09, 200));
        let found = matcher.take(&seen, &Sweep::steady(&still), &still);
        let [m, rad] = off(&matcher, &truth);
        assert!(found.is_some() && m < 0.1 && rad < 0.0035, "{k}: {m} m, {rad} rad");
    }
}

#[test]
fn invalid_scans_do_not_match_and_leave_the_matcher_intact() {
    let points = yard(false);
    let map = map(&points);
    let still = Isometry3::identity();
    let truth = pose(0.0, 0.0, 0.0);
    let mut matcher = Matcher::new(&map, 1, guess(truth, 0.5, 0.05, 50));
    assert!(matcher.take(&turn(&points, &truth), &Sweep::steady(&still), &still).is_some());
    let nowhere = [
        Vector3::new(f64::NAN, 1.0, 0.0),
        Vector3::new(f64::INFINITY, 0.0, 1.0),
        Vector3::new(1e300, 0.0, 0.0),
    ];
    let wild: Vec<_> = nowhere.iter().cycle().take(3000).map(|point| (*point, f64::NAN)).collect();
    assert!(matcher.take(&wild, &Sweep::steady(&still), &still).is_none());
    let no_motion = Isometry3::translation(f64::NAN, 0.0, 0.0);
    assert!(matcher.take(&turn(&points, &truth), &Sweep::steady(&no_motion), &no_motion).is_none());
    assert!(matcher.take(&turn(&points, &truth), &Sweep::steady(&still), &still).is_some());
    // Two million points within a few metres: processing terminates.
    let place = |k: u32| {
        let at = |times: u32| f64::from(k.wrapping_mul(times) % 1000) * 0.008 - 4.0;
        (Vector3::new(at(7919), at(104_729), at(1_299_709)), -0.5)
    };
    let many: Vec<_> = (0..2_000_000).map(place).collect();
    let _ = matcher.take(&many, &Sweep::steady(&still), &still);
    assert!(matcher.pose().translation.vector.norm() < 3.0);
}

/// After a gap of eight metres and 0.8 rad without scans or odometry, an external pose that is 0.5 m and three
/// degrees off leads to a match with the first scan. Without it there is no match.
#[test]
fn external_pose_relocalizes_the_matcher_after_a_gap() {
    let points = yard(false);
    let map = map(&points);
    let still = Isometry3::identity();
    let before = pose(-4.0, 0.0, 0.0);
    let mut matcher = Matcher::new(&map, 1, guess(before, 0.5, 0.05, 200));
    assert!(matcher.take(&turn(&points, &before), &Sweep::steady(&still), &still).is_some());
    let mut alone = matcher.clone();
    let truth = pose(4.0, 1.0, 0.8);
    matcher.suppose_at(guess(pose(4.4, 0.7, 0.85), 0.5, 0.05, 200));
    let seen = turn(&points, &truth);
    let found = matcher.take(&seen, &Sweep::steady(&still), &still);
    let [m, rad] = off(&matcher, &truth);
    assert!(found.is_some() && m < 0.05 && rad < 0.005, "{m} m, {rad} rad");
    assert!(alone.take(&seen, &Sweep::steady(&still), &still).is_none());
}
