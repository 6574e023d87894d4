//! Linear extrapolation: straight lines fitted to past positions.
//!
//! Pylot (arXiv 2104.07830, prediction) fits `x(t)` and `y(t)` by least squares over the last positions and
//! extrapolates. It assumes the sensor period as the interval, and uses the ego frame. Here the stamps of the
//! sightings and the map frame are used, so that a missed frame or a turning ego does not distort the lines.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Ranges, Span, Time};
use swerve_geom::{Pose2, Vector2};
use swerve_msg::{PredictedPose, Prediction, PredictionList, Track, TrackList};

use crate::wander::wander;

/// Treatment of an obstacle with a single sighting.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SingleSighting {
    /// Extrapolate with its reported velocity.
    #[default]
    Velocity,
    /// Keep it at its position, as in Pylot.
    Static,
}

/// Speed below which the reported heading of an outline is kept, m/s. Errors of both poses make a vehicle at rest
/// seem to move at some decimetres per second in any direction, and a truck predicted across its lane would block the
/// next one.
pub(crate) const HEADING_SPEED_MPS: f64 = 0.5;

/// Parameters of the linear predictor.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Number of past positions that are fitted, the present one included. More of them smooth better and lag more.
    /// Pylot: 5.
    #[schemars(range(min = 1, max = 1000))]
    pub past_steps: usize,
    /// Number of poses predicted after the present one. Pylot: 40.
    #[schemars(range(min = 0, max = 10_000))]
    pub future_steps: usize,
    /// Time between predicted poses, seconds. Pylot: its sensor period, 0.05.
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub step_s: f64,
    /// Speed below which the heading is the reported one, m/s; above, it is the direction of motion.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub heading_speed_min_mps: f64,
    /// Treatment of an obstacle with one sighting.
    pub single_sighting: SingleSighting,
    /// Time over which sightings are searched for braking, seconds: a vehicle that brakes is predicted to continue
    /// braking until it stops. 0: all obstacles keep their speed, as in Pylot.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub brake_window_s: f64,
    /// Reported speed below which an actor is taken to be at rest unless its sightings show a significant motion,
    /// m/s. 0: the fitted velocity is always extrapolated, as in Pylot.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub rest_speed_mps: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            past_steps: 5,
            future_steps: 40,
            step_s: 0.05,
            heading_speed_min_mps: HEADING_SPEED_MPS,
            single_sighting: SingleSighting::Velocity,
            brake_window_s: 0.6,
            rest_speed_mps: REST_MPS,
        }
    }
}

/// Predicts the motion of every track in the map frame; `path[0]` of each is the pose at the list's stamp.
///
/// Tracks without a sighting are treated as having one, at their present pose; implausible ones are dropped
/// ([`Track::is_plausible`]).
pub fn predict(tracks: &TrackList, params: &Params) -> PredictionList {
    let plausible = tracks.tracks.iter().filter(|track| track.is_plausible());
    let predictions = plausible.map(|track| predict_track(track, tracks.stamp, params)).collect();
    PredictionList { stamp: tracks.stamp, predictions, joint: false }
}

pub(crate) fn predict_track(track: &Track, stamp: Time, params: &Params) -> Prediction {
    let history = settled(&track.history, track.velocity_mps, params.rest_speed_mps);
    let recent = &history[history.len().saturating_sub(params.past_steps)..];
    let line = Line::fit(recent, stamp).unwrap_or_else(|| Line {
        point: track.pose.point(),
        velocity_mps: match params.single_sighting {
            SingleSighting::Velocity => track.velocity_mps,
            SingleSighting::Static => Vector2::default(),
        },
    });
    let braking = Braking::of(track, stamp, params.brake_window_s);
    let line = braking.map_or(line, |braking| braking.line);
    let moves = line.velocity_mps.norm() > params.heading_speed_min_mps;
    let heading_rad = if moves { line.velocity_mps.heading() } else { track.pose.heading_rad };
    let step = Span::from_secs(params.step_s);
    let path = (0..=params.future_steps as i64)
        .map(|k| {
            let ahead = step * k;
            let ahead_s = ahead.as_secs();
            let point = line.point + line.velocity_mps * braking.map_or(ahead_s, |b| b.driven_s(ahead_s));
            PredictedPose { at: stamp + ahead, pose: Pose2::new(point.x_m, point.y_m, heading_rad) }
        })
        .collect();
    let Track { id, kind, extent, .. } = *track;
    let unseen_s = track.history.last().map_or(0.0, |last| (stamp - last.at).as_secs().max(0.0));
    let (wander, direction) = (wander(kind), Vector2::from_heading(heading_rad));
    let after_s = (0..=params.future_steps).map(|k| unseen_s + params.step_s * k as f64);
    let covariances_m2 = after_s.map(|t_s| wander.covariance_m2(direction, t_s)).collect();
    Prediction { id, kind, extent, probability: 1.0, path, covariances_m2 }
}

mod braking;
mod line;
mod rest;

pub(crate) use braking::Braking;
use line::Line;
pub(crate) use rest::{REST_MPS, settled};

#[cfg(test)]
mod tests;
