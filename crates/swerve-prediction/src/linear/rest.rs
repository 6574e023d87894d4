//! Road users at rest whose sightings scatter.
//!
//! Errors of the sensor and of the ego's pose move a person who stands by millimetres from frame to frame. A line through a
//! quarter of a second of such sightings has a slope of decimetres a second, and extrapolated over seconds it leads into the
//! lane. A slope is a motion only where it differs from zero by more than its standard error explains (the t test of a
//! regression coefficient; Draper and Smith, Applied Regression Analysis, section 1.4).

use std::borrow::Cow;

use swerve_core::Time;
use swerve_geom::{Point2, Vector2};
use swerve_msg::Sighting;

use super::{DEVIATIONS, Line};

/// Slower than this an actor is reported to be at rest, m/s: below a shuffle, above what centimetres of noise make of a
/// velocity that a sensor or a tracker reports.
pub(crate) const REST_MPS: f64 = 0.1;

/// Sightings over this time are searched for motion, seconds.
const WINDOW_S: f64 = 0.6;

/// Fewest sightings that show a scatter: a line through two has no residuals.
const SIGHTINGS_MIN: usize = 3;

/// Least deviation of a sighting, metres. Errors of a pose estimate change slowly: the residuals of a short line do not show
/// them. Source: sightings of people on foot, fitted to ETH and UCY (docs/prediction.md).
const SIGHTING_M: f64 = 0.03;

/// A place at rest is the mean of so many of the newest sightings.
const MEAN_OF: usize = 5;

/// The sightings of a track; those of the last [`WINDOW_S`] all at one place if the actor is at rest: reported slower than
/// `rest_speed_mps`, and without a significant motion over these sightings.
///
/// Both have to agree: a reported velocity shows at once that an actor sets off, and sightings show it where velocities are
/// not reported.
pub(crate) fn settled(
    history: &[Sighting],
    reported_mps: Vector2,
    rest_speed_mps: f64,
) -> Cow<'_, [Sighting]> {
    let Some(last) = history.last().filter(|_| reported_mps.norm() < rest_speed_mps) else {
        return Cow::Borrowed(history);
    };
    // Stamps are whole nanoseconds, windows are not.
    let from = history.partition_point(|one| (last.at - one.at).as_secs() > WINDOW_S + 1e-6);
    if history.len() - from < SIGHTINGS_MIN || moves(&history[from..], last.at) {
        return Cow::Borrowed(history);
    }
    let place = mean(&history[from.max(history.len().saturating_sub(MEAN_OF))..], last.point);
    let settle =
        |(k, one): (usize, &Sighting)| if k < from { *one } else { Sighting { point: place, ..*one } };
    Cow::Owned(history.iter().enumerate().map(settle).collect())
}

/// The mean place of `sightings`; exact where all are at `near`.
fn mean(sightings: &[Sighting], near: Point2) -> Point2 {
    let share = 1.0 / sightings.len() as f64;
    sightings.iter().fold(near, |sum, one| sum + (one.point - near) * share)
}

/// True of sightings at one speed that differs from zero by more than [`DEVIATIONS`] of its standard error.
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
    // Two coordinates, of each of which the line takes two degrees of freedom.
    let residual_m2 = sightings.iter().map(off_m2).sum::<f64>() / (2.0 * n - 4.0);
    let error_mps = residual_m2.sqrt().max(SIGHTING_M) / spread_s2.sqrt();
    line.velocity_mps.norm() > DEVIATIONS * error_mps
}

#[cfg(test)]
mod tests;
