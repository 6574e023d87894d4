//! The pose stored at the end of the drive before, from which a filter starts without a fix.
//!
//! Receivers with dead reckoning store place and heading when they are switched off, and go on from there by wheels and
//! gyroscope (u-blox, "NEO-M8U receiver description", save-on-shutdown). A simulated drive begins in the middle of a way:
//! its stored pose is that of its start with errors drawn by the seed.

use swerve_core::{Rng, Time};
use swerve_geom::Pose2;
use swerve_localization::{Initial, Localizer, Params};
use swerve_msg::WheelOdometry;

use super::Filter;
use crate::site::Site;

/// A pose and its standard deviations: each axis of the place (m), heading (rad).
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct StoredPose {
    pose: Pose2,
    sigma: [f64; 2],
    /// First reading of a sensor: the instant of the pose.
    since: Option<Time>,
}

impl StoredPose {
    /// That of a run, with its errors. `None` where `localization.stored_pose` is absent.
    pub(super) fn new(site: &Site<'_>) -> Option<Self> {
        let config = site.config();
        let [place_m, heading_deg] = config.localization.stored_pose?;
        let around = site.surroundings();
        let start = around.scenario.ego_pose(around.route.line(), &around.vehicle.shape);
        Some(Self::drawn(start, [place_m, heading_deg.to_radians()], config.seed))
    }

    /// The pose at the start with errors of these deviations.
    fn drawn(start: Pose2, sigma: [f64; 2], seed: u64) -> Self {
        let mut rng = Rng::keyed(seed, "stored pose", &[]);
        let [x, y, turn] = core::array::from_fn(|_| rng.normal());
        let [place_m, heading_rad] = sigma;
        let pose = Pose2::new(
            start.x_m + place_m * x,
            start.y_m + place_m * y,
            start.heading_rad + heading_rad * turn,
        );
        Self { pose, sigma, since: None }
    }

    /// The state at `stamp` of a car that rolls straight on at a speed.
    fn initial(&self, params: &Params, stamp: Time, speed_mps: f64) -> Initial {
        let rolled_s = self.since.map_or(0.0, |since| (stamp - since).as_secs());
        let Pose2 { x_m, y_m, heading_rad, .. } = self.pose.ahead(speed_mps * rolled_s);
        Initial::level(params, [x_m, y_m, heading_rad], speed_mps, self.sigma)
    }
}

impl Filter {
    /// Whether a stored pose waits for a speed by the wheels, which is due within two of their periods.
    pub(super) fn awaits_wheels(&mut self, now: Time) -> bool {
        let since = self.stored.as_mut().map(|stored| *stored.since.get_or_insert(now));
        since.is_some_and(|since| now - since <= self.wheels_due)
    }

    /// Starts from the stored pose with the first speed by the wheels, unless a fix came before.
    pub(super) fn start_stored(&mut self, wheels: &WheelOdometry) {
        let Some(stored) = self.stored.take().filter(|_| self.started.is_none()) else { return };
        let initial = stored.initial(&self.params, wheels.stamp, wheels.speed_mps);
        // The parameters were validated when the operator was made.
        if let Ok(localizer) = Localizer::starting_at(self.params, wheels.stamp, &initial) {
            (self.localizer, self.started) = (localizer, Some(wheels.stamp));
        }
    }
}
