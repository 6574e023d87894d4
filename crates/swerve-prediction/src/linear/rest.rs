//! Detection of road users at rest with noisy sightings.
//!
//! Errors of the sensor and of the ego's pose shift a standing person by millimetres from frame to frame. A line
//! through a quarter of a second of such sightings has a slope of decimetres per second, and its extrapolation over
//! seconds enters the lane. A slope is taken for a motion only if it differs from zero by more than its standard
//! error explains (the t test of a regression coefficient; Draper and Smith, Applied Regression Analysis, section
//! 1.4).

use std::borrow::Cow;

use swerve_core::Time;
use swerve_geom::{Point2, Vector2};
use swerve_msg::Sighting;

use super::line::{DEVIATIONS, Line};

/// Reported speed below which an actor is taken to be at rest, m/s: below the slowest walk, above the velocity error
/// that centimetres of noise cause in a sensor or tracker.
pub(crate) const REST_MPS: f64 = 0.1;

/// Time over which sightings are searched for motion, seconds.
const WINDOW_S: f64 = 0.6;

/// Smallest number of sightings with residuals: a line through two has none.
const SIGHTINGS_MIN: usize = 3;

/// Smallest standard deviation of a sighting, metres. Errors of a pose estimate change slowly and are not visible in
/// the residuals of a short line. Source: sightings of pedestrians, fitted to ETH and UCY (docs/prediction.md).
const SIGHTING_M: f64 = 0.03;

/// Number of the newest sightings whose mean is the position at rest.
const MEAN_OF: usize = 5;

/// Sightings of a track. Those of the last [`WINDOW_S`] are moved to one position if the actor is at rest: its
/// reported speed is below `rest_speed_mps`, and these sightings show no significant motion.
///
/// Both conditions are required: a reported velocity shows immediately that an actor sets off, and sightings show it
/// if no velocity is reported.
pub(crate) fn settled(
    history: &[Sighting],
    reported_mps: Vector2,
    rest_speed_mps: f64,
) -> Cow<'_, [Sighting]> {
    let Some(last) = history.last().filter(|_| reported_mps.norm() < rest_speed_mps) else {
        return Cow::Borrowed(history);
    };
    // Stamps are whole nanoseconds, window lengths are not.
    let from = history.partition_point(|one| (last.at - one.at).as_secs() > WINDOW_S + 1e-6);
    if history.len() - from < SIGHTINGS_MIN || moves(&history[from..], last.at) {
        return Cow::Borrowed(history);
    }
    let place = mean(&history[from.max(history.len().saturating_sub(MEAN_OF))..], last.point);
    let settle =
        |(k, one): (usize, &Sighting)| if k < from { *one } else { Sighting { point: place, ..*one } };
    Cow::Owned(history.iter().enumerate().map(settle).collect())
}

/// Mean position of `sightings`; exact if all are at `near`.
fn mean(sightings: &[Sighting], near: Point2) -> Point2 {
    let share = 1.0 / sightings.len() as f64;
    sightings.iter().fold(near, |sum, one| sum + (one.point - near) * share)
}

/// Returns true if the sightings have a velocity that differs from zero by more than [`DEVIATIONS`] standard errors.
fn moves(sightings: &[Sighting], stamp: Time) -> bool {
    let Some(line) = Line::fit(sightings, stamp) else { return false };
    let n = sightings.len() as f64;
    let time_s = |one: &Sighting| (one.at - stamp).as_secs();
    let mean_s = sightings.iter().map(time_s).sum::<f64>() / n;
    let spread_s2: f64 = sightings.iter().map(|one| (time_s(one) - mean_s) * (time_s(one) - mean_s)).sum();
    let off_m2 = |one: &Sighting| {
        let off = one.point - (line.point + line.velocity_mps * time_s(one));
        off.dot(off)
    };
    // Two coordinates, each with two degrees of freedom taken by the line.
    let residual_m2 = sightings.iter().map(off_m2).sum::<f64>() / (2.0 * n - 4.0);
    let error_mps = residual_m2.sqrt().max(SIGHTING_M) / spread_s2.sqrt();
    line.velocity_mps.norm() > DEVIATIONS * error_mps
}

#[cfg(test)]
mod tests;
