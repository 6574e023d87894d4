//! The predictor and its horizon.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Ranges, Span};
use swerve_prediction::Horizon;
use swerve_pylot::Preset;

use crate::named::Name;

/// Name of a predictor: a built-in one, or one that [`Registry::with_predictor`](crate::Registry::with_predictor) adds.
pub type PredictorName = Name<swerve_prediction::PredictorName>;

/// The predictor.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct PredictionConfig {
    /// Predictor; all but `linear` use a longer past of each track.
    pub predictor: PredictorName,
    /// Parameters of a custom predictor that differ from its defaults.
    #[serde(skip_serializing_if = "toml::Table::is_empty")]
    #[schemars(with = "crate::config::AnyTable")]
    pub params: toml::Table,
    /// File of weights of a learned predictor (`multipath`, `mfp`, `r2p2`), from `swerve train prediction`; the shipped
    /// weights when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weights: Option<String>,
    /// Velocity of a track with one sighting, for `linear`: the reported velocity (`best`), or zero (`paper`).
    pub preset: Preset,
    /// Sightings that the straight line is fitted to. With the preset `best`, `linear` also detects braking over the
    /// last 0.6 s: a braking vehicle is predicted to brake until it stops.
    #[schemars(range(min = 1, max = 1000))]
    pub past_steps: usize,
    /// Prediction horizon, ms.
    #[schemars(range(min = 50.0, max = 60_000.0))]
    pub horizon_ms: f64,
    /// Time between predicted poses, ms.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub step_ms: f64,
    /// Predicts that road users that drive along the road follow it, in the road's coordinates; when absent with the
    /// preset `best`. `lane_idm` always does; `truth` ignores it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub along_road: Option<bool>,
    /// Publishes the covariances of the predictor, and whether its modes are joint. Planners then also keep clear of the uncertainty of each position:
    /// of one standard deviation, with `planning.collision = "risk"` of as many as `risk_max` requires.
    pub covariances: bool,
    /// `truth` only: horizon of the known future, ms; road users go straight on after that. `horizon_ms` when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 60_000.0))]
    pub truth_horizon_ms: Option<f64>,
    /// `truth` only: standard deviation of the predicted positions, along each axis and per second of prediction,
    /// metres.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub truth_noise_mps: f64,
}

/// Straight lines.
const LINEAR: &str = swerve_prediction::PredictorName::Linear.name();
/// Sightings kept for predictors with a longer past than a line needs: 3.2 s at 20 Hz.
const LONG_PAST: usize = 64;
/// Sightings kept to estimate braking: 0.6 s at 20 Hz.
const BRAKING_PAST: usize = 13;

impl PredictionConfig {
    /// Predicted instants.
    pub fn horizon(&self) -> Horizon {
        let steps = (self.horizon_ms / self.step_ms).round() as usize;
        Horizon { steps, step: Span::from_secs(self.step_ms * 1e-3) }
    }

    /// Sightings that tracks have to keep.
    pub fn sightings(&self) -> usize {
        match self.predictor.as_str() {
            LINEAR if self.preset == Preset::Best => self.past_steps.max(BRAKING_PAST),
            LINEAR => self.past_steps,
            _ => self.past_steps.max(LONG_PAST),
        }
    }
}

impl Default for PredictionConfig {
    fn default() -> Self {
        Self {
            predictor: PredictorName::new(LINEAR),
            params: toml::Table::new(),
            weights: None,
            preset: Preset::Best,
            past_steps: 5,
            horizon_ms: 5000.0,
            step_ms: 100.0,
            along_road: None,
            covariances: false,
            truth_horizon_ms: None,
            truth_noise_mps: 0.0,
        }
    }
}
