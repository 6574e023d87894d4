//! Point clouds relative to an origin at their median.
//!
//! Surveyed clouds have coordinates of up to 5,000 km (UTM). About an origin that far away, a rotation by a millionth
//! of a degree and a translation by 0.1 m are almost the same motion, and scan matching cannot separate them. A cloud
//! moved to the median of its points in double precision is registered with the same accuracy anywhere.

use nalgebra::{Isometry3, Translation3, Vector3};

/// Points relative to an origin at their median.
#[derive(Clone, PartialEq, Debug)]
pub struct Centred {
    /// Median of the points along each axis, metres in the frame of the cloud.
    pub origin_m: Vector3<f64>,
    /// Points of the cloud minus the origin, metres, in the order of the cloud.
    pub points: Vec<Vector3<f64>>,
}

impl Centred {
    /// Moves a cloud to its median. Points that are not finite are ignored for the median.
    pub fn new(cloud: &[Vector3<f64>]) -> Self {
        let origin_m = Vector3::from([0, 1, 2].map(|axis| median(cloud, axis)));
        Self { origin_m, points: cloud.iter().map(|point| point - origin_m).collect() }
    }

    /// Converts a pose of the original cloud in the original `target` to one between the centred clouds.
    pub fn pose_in(&self, target: &Self, pose: &Isometry3<f64>) -> Isometry3<f64> {
        let place = pose.rotation * self.origin_m + pose.translation.vector - target.origin_m;
        Isometry3::from_parts(Translation3::from(place), pose.rotation)
    }

    /// Inverse of [`Self::pose_in`].
    pub fn pose_of(&self, target: &Self, centred: &Isometry3<f64>) -> Isometry3<f64> {
        let place = centred.translation.vector + target.origin_m - centred.rotation * self.origin_m;
        Isometry3::from_parts(Translation3::from(place), centred.rotation)
    }
}

fn median(cloud: &[Vector3<f64>], axis: usize) -> f64 {
    let is_finite = |point: &&Vector3<f64>| point.iter().all(|x| x.is_finite());
    let mut along: Vec<f64> = cloud.iter().filter(is_finite).map(|point| point[axis]).collect();
    if along.is_empty() {
        return 0.0;
    }
    let middle = along.len() / 2;
    *along.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::downsampled;
    use crate::ndt::tests::yard;
    use crate::ndt::{self, Limits};
    use crate::voxels::{VoxelMap, VoxelSums, coarser};

    /// A position in UTM: easting, northing and height, metres.
    const FAR_M: [f64; 3] = [691_000.0, 5_335_000.0, 520.0];

    /// Registration error at the origin of the source, metres and degrees, for clouds moved to `origin_m`.
    fn error(origin_m: Vector3<f64>) -> [f64; 2] {
        let turn = crate::eskf::exp(&Vector3::new(0.0, 0.0, 0.07));
        let truth = Isometry3::from_parts(Vector3::new(0.7, -0.4, 0.0).into(), turn);
        let scene = yard(false);
        let target: Vec<_> = scene.iter().map(|point| point + origin_m).collect();
        let seen = |point: &Vector3<f64>| truth.inverse().transform_point(&(*point).into()).coords + origin_m;
        let source: Vec<_> = scene.iter().step_by(3).map(seen).collect();
        let [source, target] = [&source, &target].map(|cloud| Centred::new(cloud));
        let mut sums = VoxelSums::new(2.0);
        target.points.iter().for_each(|point| sums.add(point));
        let voxels = sums.voxels();
        let maps = [2, 1].map(|k| VoxelMap::new(2.0 * f64::from(k), &coarser(&voxels, 2.0, k)));
        let guess = source.pose_in(&target, &Isometry3::identity());
        let scan = downsampled(&source.points, 0.25);
        let found = ndt::align(&[&maps[0], &maps[1]], &scan, &guess, &Limits::default()).unwrap();
        let found = source.pose_of(&target, &found.map_from_scan);
        // The truth is between clouds at the origin: p + o maps to truth(p) + o.
        let middle = source.origin_m;
        let wanted = truth.transform_point(&(middle - origin_m).into()).coords + origin_m;
        let off_m = (found.transform_point(&middle.into()).coords - wanted).norm();
        [off_m, (truth.rotation.inverse() * found.rotation).angle().to_degrees()]
    }

    #[test]
    fn registration_is_as_accurate_at_utm_coordinates_as_at_the_origin() {
        for k in [0.0, 1e-3, 1e-2, 1.0] {
            let [off_m, off_deg] = error(Vector3::from(FAR_M) * k);
            assert!(off_m < 0.01 && off_deg < 0.05, "{k}: {off_m} m, {off_deg}°");
        }
    }

    #[test]
    fn points_that_are_not_finite_do_not_move_the_origin() {
        let mut cloud: Vec<_> = (0..9).map(|k| Vector3::new(f64::from(k), 5e6, 1.0)).collect();
        cloud.extend([Vector3::repeat(f64::NAN), Vector3::new(f64::INFINITY, 0.0, 0.0)]);
        assert_eq!(Centred::new(&cloud).origin_m, Vector3::new(4.0, 5e6, 1.0));
        assert_eq!(Centred::new(&[]).origin_m, Vector3::zeros());
    }
}
