use nalgebra::Vector3;
use swerve_core::Rng;

use super::{MapError, MapFile};
use crate::voxels::VoxelSums;

fn map() -> MapFile {
    map_at([0.0, 0.0])
}

/// Cubes of 7 points each, in a square about an origin.
fn map_at([east, north]: [f64; 2]) -> MapFile {
    let mut rng = Rng::keyed(3, "map", &[]);
    let mut sums = VoxelSums::new(1.0);
    for _ in 0..2000 {
        let [x, y] = [0; 2].map(|_| rng.uniform(-70.0, 70.0).trunc());
        for _ in 0..7 {
            let at = Vector3::new(x + 0.9 * rng.unit(), y + 0.9 * rng.unit(), 0.05 * rng.unit());
            sums.add(&(at + Vector3::new(east, north, 0.0)));
        }
    }
    MapFile::new(1.0, sums.voxels())
}

#[test]
fn map_is_read_as_written() {
    let map = map();
    assert!(map.tiles() == 16 && map.voxels().len() > 1500, "{} {}", map.tiles(), map.voxels().len());
    let bytes = map.write();
    let again = MapFile::read(&bytes).expect("it is a map");
    assert_eq!(again, map);
    assert_eq!(again.write(), bytes);
    let empty = MapFile::new(0.5, vec![]);
    assert_eq!(MapFile::read(&empty.write()), Ok(empty));
}

#[test]
fn map_at_utm_coordinates_has_the_same_surfaces() {
    let (here, there) = (map(), map_at([691_200.0, 5_335_040.0]));
    assert_eq!(here.voxels().len(), there.voxels().len());
    for (a, b) in here.voxels().iter().zip(there.voxels()) {
        assert_eq!(
            (a.index[0] + 691_200, a.index[1] + 5_335_040, a.count),
            (b.index[0], b.index[1], b.count)
        );
        // At 5,335 km the resolution of a double is 1e-9 m.
        assert!(a.mean_m.iter().zip(b.mean_m).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?} {b:?}");
    }
    assert_eq!(MapFile::read(&there.write()), Ok(there));
}

#[test]
fn flipped_bit_anywhere_is_one_error() {
    let mut bytes = map().write();
    for at in (0..bytes.len()).step_by(97).chain(0..64) {
        for bit in [0, 7] {
            bytes[at] ^= 1 << bit;
            let told = MapFile::read(&bytes).expect_err("a bit is another");
            assert!(!told.to_string().contains('\n'), "{told}");
            bytes[at] ^= 1 << bit;
        }
    }
    assert!(MapFile::read(&bytes).is_ok());
}

#[test]
fn truncated_files_and_other_versions_are_reported() {
    let bytes = map().write();
    for len in (0..bytes.len()).step_by(101).chain(0..80) {
        let told = MapFile::read(&bytes[..len]);
        assert!(matches!(told, Err(MapError::Magic | MapError::Length { .. })), "{len}: {told:?}");
    }
    let longer = [bytes.as_slice(), b"x"].concat();
    assert!(matches!(MapFile::read(&longer), Err(MapError::Length { .. })));
    let mut newer = bytes;
    newer[8] = 2;
    assert_eq!(MapFile::read(&newer), Err(MapError::Version(2)));
}

/// The digest matches, the contents are invalid.
#[test]
fn intact_file_with_impossible_voxels_is_rejected() {
    let good = map();
    let change = |change: fn(&mut MapFile)| {
        let mut map = good.clone();
        change(&mut map);
        MapFile::read(&map.write())
    };
    let cases = [
        change(|map| map.voxels[0].mean_m[1] = f32::NAN),
        change(|map| map.voxels[5].covariance_m2[0] = 1e9),
        change(|map| map.voxels[5].count = 1),
        change(|map| map.resolution_m = f64::INFINITY),
        change(|map| map.voxels.swap(0, 1)),
    ];
    for case in cases {
        assert!(matches!(case, Err(MapError::Content(_))), "{case:?}");
    }
}
