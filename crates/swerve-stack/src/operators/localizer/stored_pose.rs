//! The pose stored at the end of the drive before, from which a filter starts without a fix.
//!
//! Receivers with dead reckoning store position and heading when they are switched off, and go on from there by wheels
//! and gyroscope (u-blox, "NEO-M8U receiver description", save-on-shutdown). A simulated drive begins in the middle of
//! a trip: its stored pose is that of its start with errors drawn by the seed.

use swerve_core::{Rng, Time};
use swerve_geom::Pose2;
use swerve_localization::{Initial, Params};

use crate::site::Site;

/// Instant of the pose: the start of the drive.
pub(super) const START: Time = Time::ZERO;

/// A pose and its standard deviations: each axis of the position (m), heading (rad).
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct StoredPose {
    pose: Pose2,
    sigma: [f64; 2],
}

impl StoredPose {
    /// Stored pose of a run, with its errors. `None` where `localization.stored_pose` is absent.
    pub(super) fn new(site: &Site<'_>) -> Option<Self> {
        let config = site.config();
        let [place_m, heading_deg] = config.localization.stored_pose?;
        let around = site.surroundings();
        let start = around.scenario.ego_pose(&around.scenario.road.line(), &around.vehicle.shape);
        Some(Self::drawn(start, [place_m, heading_deg.to_radians()], config.seed))
    }

    /// Start pose with errors of these standard deviations.
    fn drawn(start: Pose2, sigma: [f64; 2], seed: u64) -> Self {
        let mut rng = Rng::keyed(seed, "stored pose", &[]);
        let [x, y, turn] = core::array::from_fn(|_| rng.normal());
        let [place_m, heading_rad] = sigma;
        let pose = Pose2::new(
            start.x_m + place_m * x,
            start.y_m + place_m * y,
            start.heading_rad + heading_rad * turn,
        );
        Self { pose, sigma }
    }

    /// Initial state at `stamp` of a car that has rolled straight on at a constant speed.
    pub(super) fn initial(&self, params: &Params, stamp: Time, speed_mps: f64) -> Initial {
        let rolled_s = (stamp - START).as_secs();
        let Pose2 { x_m, y_m, heading_rad, .. } = self.pose.ahead(speed_mps * rolled_s);
        Initial::level(params, [x_m, y_m, heading_rad], speed_mps, self.sigma)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stored_pose_errors_have_the_configured_deviations() {
        let start = Pose2::new(5.0, 3.0, 0.5);
        let count = 2000;
        let mut squares = [0.0; 3];
        for seed in 0..count {
            let StoredPose { pose, .. } = StoredPose::drawn(start, [0.3, 0.01], seed);
            let off = [pose.x_m - 5.0, pose.y_m - 3.0, pose.heading_rad - 0.5];
            squares = core::array::from_fn(|k| squares[k] + off[k] * off[k]);
        }
        // A variance from 2000 draws has a standard deviation of sqrt(2 / 2000) = 3 %: 10 % are three of them.
        for (square, sigma) in squares.into_iter().zip([0.3, 0.3, 0.01]) {
            assert!((square / count as f64 / (sigma * sigma) - 1.0).abs() < 0.1, "{square}");
        }
        assert_eq!(StoredPose::drawn(start, [0.3, 0.01], 7), StoredPose::drawn(start, [0.3, 0.01], 7));
    }

    #[test]
    fn initial_state_is_that_of_the_first_speed() {
        let stored = StoredPose { pose: Pose2::new(5.0, 3.0, 0.0), sigma: [0.3, 0.01] };
        let params = Params { imu_at_m: [1.2, 0.4, 0.3], ..Params::default() };
        let Initial { position_m, velocity_mps, sigma, .. } =
            stored.initial(&params, Time::from_ms(20), 40.0);
        // 0.8 m in 20 ms, and the unit's lever arm. A heading error of 0.01 rad is 0.4 m/s to the side.
        for (found, expected) in position_m.iter().zip([7.0, 3.4, 0.3]) {
            assert!((found - expected).abs() < 1e-12, "{position_m}");
        }
        assert_eq!([velocity_mps.x, velocity_mps.y, velocity_mps.z], [40.0, 0.0, 0.0]);
        assert_eq!(sigma, [0.3, 0.4, 0.01]);
    }
}
