//! Lines fitted to sightings.

use swerve_core::Time;
use swerve_geom::{Point2, Vector2};
use swerve_msg::Sighting;

/// Significance of a motion or a deceleration, in standard errors.
pub(super) const DEVIATIONS: f64 = 3.0;

/// Motion at constant velocity.
#[derive(Clone, Copy)]
pub(super) struct Line {
    /// Position at the stamp.
    pub(super) point: Point2,
    pub(super) velocity_mps: Vector2,
}

impl Line {
    /// Least-squares fit of a straight motion to `sightings`, evaluated at `stamp`. `None` for fewer than two
    /// instants.
    pub(super) fn fit(sightings: &[Sighting], stamp: Time) -> Option<Self> {
        let n = sightings.len() as f64;
        let (mut t_mean, mut x_mean, mut y_mean) = (0.0, 0.0, 0.0);
        for sighting in sightings {
            t_mean += (sighting.at - stamp).as_secs() / n;
            x_mean += sighting.point.x_m / n;
            y_mean += sighting.point.y_m / n;
        }
        let (mut tt, mut tx, mut ty) = (0.0, 0.0, 0.0);
        for sighting in sightings {
            let t = (sighting.at - stamp).as_secs() - t_mean;
            tt += t * t;
            tx += t * (sighting.point.x_m - x_mean);
            ty += t * (sighting.point.y_m - y_mean);
        }
        if sightings.len() < 2 || tt <= 0.0 {
            return None;
        }
        let velocity_mps = Vector2::new(tx / tt, ty / tt);
        Some(Self { point: Point2::new(x_mean, y_mean) + velocity_mps * -t_mean, velocity_mps })
    }
}
