//! The way of a lidar by its own points, without a map beforehand.
//!
//! Each turn is straightened by the motion of the one before, matched point to point with the points of those before, and
//! added to them. How far points may be from their neighbours follows how far the motion was from what was expected.
//! Source: Vizzo and others, "KISS-ICP", IEEE RA-L 2023.

use nalgebra::{Isometry3, Vector3};
use swerve_geom::math;

use crate::downsampled;
use crate::eskf;
use crate::icp::{self, PointMap};
use crate::sweep::{RANGE_M, Sweep};

/// Edge of a cube of the map, metres, and most points in it.
const CUBE_M: f64 = 1.0;
const PER_CUBE: usize = 20;
/// Deviation from the expected motion before any is known, metres; a smaller one than the second tells nothing.
const DEVIATION_M: [f64; 2] = [2.0, 0.1];
/// Fewer points are no turn.
const POINTS_MIN: usize = 50;
const ITERATIONS: u32 = 50;

/// A lidar on its way.
#[derive(Clone, Debug)]
pub struct Odometry {
    map: PointMap,
    pose: Isometry3<f64>,
    /// Motion over the last turn, in the frame at its begin.
    motion: Isometry3<f64>,
    /// Sum of squared deviations, m², and how many.
    deviation: (f64, f64),
}

/// What became of a turn.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Turned {
    /// The lidar is here at the end of the turn, in the frame of its first one.
    At(Isometry3<f64>),
    /// Too few points, or none near those before: it goes on as it went.
    Unmatched(Isometry3<f64>),
}

impl Turned {
    /// Where it is, matched or not.
    pub fn pose(&self) -> Isometry3<f64> {
        let (Self::At(pose) | Self::Unmatched(pose)) = self;
        *pose
    }
}

impl Odometry {
    /// At the start of a way.
    pub fn new() -> Self {
        let still = Isometry3::identity();
        let deviation = (DEVIATION_M[0] * DEVIATION_M[0], 1.0);
        let map = PointMap::new(CUBE_M, PER_CUBE);
        Self { map, pose: still, motion: still, deviation }
    }

    /// The next turn: points in the lidar's frame at the instant of each, and the share of the turn from its end,
    /// -1 to 0. It is expected to move as over the turn before; where it is not at rest at first, use
    /// [`take_moved`](Self::take_moved): on flat ground two smeared turns look as if nothing moved.
    pub fn take(&mut self, points: &[(Vector3<f64>, f64)]) -> Turned {
        let motion = self.motion;
        self.take_moved(points, &Sweep::steady(&motion), &motion)
    }

    /// The same where it is known by other means about how the lidar moved over the turn, and since the turn before: wheels
    /// and gyroscopes.
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

/// The same with a rotation of length 1.
fn normal(pose: Isometry3<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(pose.translation, eskf::unit(pose.rotation))
}

#[cfg(test)]
mod tests;
