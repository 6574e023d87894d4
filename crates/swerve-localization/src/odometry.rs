//! Lidar odometry without a map.
//!
//! Each scan is deskewed by the motion of the previous one, registered point to point with the points of earlier
//! scans, and added to them. The largest distance of correspondences adapts to the deviation of the motion from its
//! prediction. Source: Vizzo and others, "KISS-ICP", IEEE RA-L 2023.

use nalgebra::{Isometry3, Vector3};
use swerve_geom::math;

use crate::downsampled;
use crate::eskf;
use crate::icp::{self, PointMap};
use crate::sweep::{RANGE_M, Sweep};

/// Edge of a cube of the map, metres, and largest number of points in it.
const CUBE_M: f64 = 1.0;
const PER_CUBE: usize = 20;
/// Initial deviation from the predicted motion, metres; and the value below which deviations are ignored.
const DEVIATION_M: [f64; 2] = [2.0, 0.1];
/// Smallest number of points of a valid scan.
const POINTS_MIN: usize = 50;
const ITERATIONS: u32 = 50;

/// Lidar odometry with a local map.
#[derive(Clone, Debug)]
pub struct Odometry {
    map: PointMap,
    pose: Isometry3<f64>,
    /// Motion over the last scan, in the frame at its start.
    motion: Isometry3<f64>,
    /// Sum of squared deviations, m², and their number.
    deviation: (f64, f64),
}

/// Result of processing a scan.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Turned {
    /// Pose of the lidar at the end of the scan, in the frame of the first scan.
    At(Isometry3<f64>),
    /// Predicted pose: there are too few points, or none near those of earlier scans.
    Unmatched(Isometry3<f64>),
}

impl Turned {
    /// Pose, registered or predicted.
    pub fn pose(&self) -> Isometry3<f64> {
        let (Self::At(pose) | Self::Unmatched(pose)) = self;
        *pose
    }
}

impl Odometry {
    /// Creates one at the start of a path.
    pub fn new() -> Self {
        let still = Isometry3::identity();
        let deviation = (DEVIATION_M[0] * DEVIATION_M[0], 1.0);
        let map = PointMap::new(CUBE_M, PER_CUBE);
        Self { map, pose: still, motion: still, deviation }
    }

    /// Processes a scan: points in the lidar's frame at the instant of each, with that instant as a share of the scan
    /// from its end, -1 to 0. The motion is predicted as constant. If the lidar moves initially, use
    /// [`take_moved`](Self::take_moved): on flat ground, two distorted scans look as if nothing moved.
    pub fn take(&mut self, points: &[(Vector3<f64>, f64)]) -> Turned {
        let motion = self.motion;
        self.take_moved(points, &Sweep::steady(&motion), &motion)
    }

    /// As [`take`](Self::take), with the motion over the scan and since the previous scan from another source, such
    /// as wheels and gyroscopes.
    pub fn take_moved(
        &mut self,
        points: &[(Vector3<f64>, f64)],
        sweep: &Sweep,
        motion: &Isometry3<f64>,
    ) -> Turned {
        let kept = downsampled(&sweep.straightened(points), 0.5 * CUBE_M);
        let scan = downsampled(&kept, 1.5 * CUBE_M);
        if self.map.is_empty() {
            if scan.len() < POINTS_MIN {
                return Turned::Unmatched(self.pose);
            }
            self.motion = *motion;
            self.add(&kept);
            return Turned::At(self.pose);
        }
        self.follow(&kept, &scan, motion)
    }

    fn add(&mut self, kept: &[Vector3<f64>]) {
        let rotation = self.pose.rotation.to_rotation_matrix().into_inner();
        let place = self.pose.translation.vector;
        let there: Vec<_> = kept.iter().map(|point| rotation * point + place).collect();
        self.map.add(&there);
        self.map.forget_beyond(&place, RANGE_M[1]);
    }

    fn follow(&mut self, kept: &[Vector3<f64>], scan: &[Vector3<f64>], motion: &Isometry3<f64>) -> Turned {
        let guess = normal(self.pose * motion);
        if scan.len() < POINTS_MIN {
            (self.pose, self.motion) = (guess, *motion);
            return Turned::Unmatched(guess);
        }
        let sigma_m = (self.deviation.0 / self.deviation.1).sqrt();
        let limits = [(3.0 * sigma_m).min(CUBE_M), sigma_m / 3.0];
        let Some(found) = icp::align(&self.map, scan, &guess, limits, ITERATIONS) else {
            (self.pose, self.motion) = (guess, *motion);
            return Turned::Unmatched(guess);
        };
        let pose = found.map_from_scan;
        let off = guess.inverse() * pose;
        let turn_rad = eskf::angle_between(&guess.rotation, &pose.rotation);
        let off_m = off.translation.vector.norm() + 2.0 * RANGE_M[1] * math::sin(0.5 * turn_rad);
        if off_m > DEVIATION_M[1] {
            self.deviation.0 += off_m * off_m;
            self.deviation.1 += 1.0;
        }
        self.motion = normal(self.pose.inverse() * pose);
        self.pose = pose;
        self.add(kept);
        Turned::At(pose)
    }
}

impl Default for Odometry {
    fn default() -> Self {
        Self::new()
    }
}

/// Pose with a normalised rotation.
fn normal(pose: Isometry3<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(pose.translation, eskf::unit(pose.rotation))
}

#[cfg(test)]
mod tests;
