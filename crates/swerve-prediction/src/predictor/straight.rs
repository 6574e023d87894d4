//! Predictions by straight extrapolation.

use swerve_core::Time;
use swerve_msg::Track;

use super::drawn::single;
use super::{Horizon, Modes, Tracked};
use crate::linear;

/// Time over which the last velocity is averaged, seconds; with longer intervals, the last two sightings are used.
pub(super) const VELOCITY_WINDOW_S: f64 = 0.5;

/// Predictor of the paper.
pub(super) fn linear(seen: &[Tracked], stamp: Time, horizon: &Horizon) -> Vec<Modes> {
    let params = linear::Params {
        future_steps: horizon.steps,
        step_s: horizon.step.as_secs(),
        ..linear::Params::default()
    };
    let of_one = |seen: &Tracked| {
        let track = Track { history: seen.past.sightings.clone(), ..seen.track.clone() };
        vec![linear::predict_track(&track, stamp, &params)]
    };
    seen.iter().map(of_one).collect()
}

/// Constant velocity of the last half second.
pub(super) fn constant_velocity(seen: &[Tracked], stamp: Time, horizon: &Horizon) -> Vec<Modes> {
    let of_one = |seen: &Tracked| {
        let velocity_mps = seen.past.velocity_mps(VELOCITY_WINDOW_S);
        let now = seen.past.now(stamp, velocity_mps);
        let at = |k: usize| now + velocity_mps * (horizon.step.as_secs() * k as f64);
        single(seen, stamp, horizon, &(0..=horizon.steps).map(at).collect::<Vec<_>>())
    };
    seen.iter().map(of_one).collect()
}
