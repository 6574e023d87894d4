use swerve_flow::{At, Context, Operator, Port};
use swerve_msg::{ObstacleList, PredictionList, TrackList};
use swerve_prediction::{History, HistoryParams, linear};

use swerve_planning::posed::Preset;

use crate::config::Config;

/// Follows what the sensor reports by its identity and keeps past sightings.
pub(super) struct Tracker {
    history: History,
}

impl Tracker {
    pub(super) fn new(config: &Config) -> Self {
        let params =
            HistoryParams { sightings_max: config.prediction.past_steps, ..HistoryParams::default() };
        Self { history: History::new(params) }
    }
}

impl Operator for Tracker {
    type In = (At<ObstacleList>,);
    type Out = Port<TrackList>;

    fn step(&mut self, _: &mut Context<'_>, (obstacles,): &Self::In, out: &mut Self::Out) {
        if let Some(obstacles) = obstacles.get() {
            out.loan().send(self.history.update(obstacles));
        }
    }
}

/// Straight lines through past sightings.
pub(super) struct Predictor {
    params: linear::Params,
}

impl Predictor {
    pub(super) fn new(config: &Config) -> Self {
        Self { params: linear_params(config) }
    }
}

fn linear_params(config: &Config) -> linear::Params {
    let prediction = &config.prediction;
    let preset = match prediction.preset {
        Preset::Paper => linear::Params::paper(),
        Preset::Best => linear::Params::best(),
    };
    linear::Params {
        past_steps: prediction.past_steps,
        future_steps: (prediction.horizon_ms / prediction.step_ms).round() as usize,
        step_s: prediction.step_ms * 1e-3,
        ..preset
    }
}

impl Operator for Predictor {
    type In = (At<TrackList>,);
    type Out = Port<PredictionList>;

    fn step(&mut self, _: &mut Context<'_>, (tracks,): &Self::In, out: &mut Self::Out) {
        if let Some(tracks) = tracks.get() {
            out.loan().send(linear::predict(tracks, &self.params));
        }
    }
}
