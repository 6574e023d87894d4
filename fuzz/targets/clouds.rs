#![no_main]
//! Points of a PLY file, a voxel map of them, and a scan matched with it; a map's file.

use swerve_localization::map_file::MapFile;
use swerve_localization::ndt::{self, Isometry3, Limits};
use swerve_localization::voxels::VoxelMap;
use swerve_localization::{downsampled, ply};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Ok(map) = MapFile::read(bytes) {
        assert_eq!(map.write(), bytes, "a map has one form");
    }
    let Ok(points) = ply::read(bytes) else { return };
    let map = VoxelMap::of_points(1.0, &points);
    let _either_way =
        ndt::align(&[&map], &downsampled(&points, 0.25), &Isometry3::identity(), &Limits::default());
});
