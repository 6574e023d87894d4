//! The predictor and its horizon.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Ranges, Span};
use swerve_prediction::learned::Weights;
use swerve_prediction::{Horizon, Predictor};
use swerve_pylot::Preset;
use swerve_text::KeyProblem;

use super::planner::{problems_of_ranges, within};
use crate::kind::KeyProblems;
use crate::named::Name;
use crate::predictors::{AnyPredictor, Linear, NamedPredictor as _, PredictorSetup};
use crate::registry::Registry;
use crate::section::{Section, of_config};
use crate::setup::Setup;

/// Name of a predictor: a built-in one, or one that [`Registry::with_predictor`] adds.
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

/// Sightings kept for predictors with a longer past than a line needs: 3.2 s at 20 Hz.
const LONG_PAST: usize = 64;
/// Sightings kept to estimate braking: 0.6 s at 20 Hz.
const BRAKING_PAST: usize = 13;

impl PredictionConfig {
    /// `[prediction]`.
    pub const SECTION: Section<Self> = of_config!(prediction, Self::problems);

    fn problems(&self, setup: &Setup) -> KeyProblems {
        let mut found = problems_of_ranges(self);
        found.extend(self.file_weights().err().map(|message| ("weights".to_owned(), message)));
        found.extend(self.built(&setup.registry, None).err().unwrap_or_default());
        found
    }

    /// Returns true if road users that drive along the road are predicted along it.
    pub(crate) fn follows_road(&self, registry: &Registry) -> bool {
        let always = registry.predictors.get(self.predictor.as_str()).is_some_and(AnyPredictor::is_on_road);
        always || self.along_road.unwrap_or(self.preset == Preset::Best)
    }

    /// Predicted instants.
    pub fn horizon(&self) -> Horizon {
        let steps = (self.horizon_ms / self.step_ms).round() as usize;
        Horizon { steps, step: Span::from_secs(self.step_ms * 1e-3) }
    }

    /// Builds the predictor, with weights from a file in place of the shipped ones.
    ///
    /// # Errors
    /// Problems by their keys in `prediction`.
    pub fn built(
        &self,
        registry: &Registry,
        weights: Option<&Weights>,
    ) -> Result<Box<dyn Predictor>, Vec<KeyProblem>> {
        let named = registry.predictors.named("predictor", self.predictor.as_str())?;
        named.build(PredictorSetup { config: self, weights }).map_err(|found| within("params", found))
    }

    /// Sightings that tracks have to keep.
    pub fn sightings(&self) -> usize {
        match self.predictor.as_str() {
            Linear::NAME if self.preset == Preset::Best => self.past_steps.max(BRAKING_PAST),
            Linear::NAME => self.past_steps,
            _ => self.past_steps.max(LONG_PAST),
        }
    }
}

impl Default for PredictionConfig {
    fn default() -> Self {
        Self {
            predictor: PredictorName::new(Linear::NAME),
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
