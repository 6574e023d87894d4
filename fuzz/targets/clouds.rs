#![no_main]
//! Points of a PLY file, a voxel map of them, and a scan matched with it; a map's file, as it is and with its digest put
//! right, and a lidar looked for on it.

use swerve_fuzz::map_with_digest;
use swerve_localization::map_file::MapFile;
use swerve_localization::matcher::{Guess, Matcher};
use swerve_localization::ndt::{self, Isometry3, Limits, Vector3};
use swerve_localization::sweep::Sweep;
use swerve_localization::voxels::VoxelMap;
use swerve_localization::{downsampled, ply};

/// A flat turn of a lidar.
fn turn() -> Vec<(Vector3<f64>, f64)> {
    let point = |k: i32| (Vector3::new(f64::from(k % 12), f64::from(k / 12), 0.0) * 1.1, 0.0);
    (0..144).map(point).collect()
}

fn on_a_map(bytes: &[u8]) {
    let Ok(map) = MapFile::read(bytes) else { return };
    assert_eq!(map.write(), bytes, "a map has one form");
    let still = Isometry3::identity();
    let guess = Guess { map_from_lidar: still, sigma_m: 1.0, sigma_rad: 0.1, particles: 4 };
    let mut matcher = Matcher::new(&map, 1, guess);
    for _ in 0..2 {
        let _either_way = matcher.take(&turn(), &Sweep::steady(&still), &still);
    }
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    on_a_map(bytes);
    on_a_map(&map_with_digest(bytes.to_vec()));
    let Ok(points) = ply::read(bytes) else { return };
    let map = VoxelMap::of_points(1.0, &points);
    let _either_way =
        ndt::align(&[&map], &downsampled(&points, 0.25), &Isometry3::identity(), &Limits::default());
});
