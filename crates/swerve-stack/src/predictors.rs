//! Predictors that a configuration can name: built-in ones, and those of other crates.

use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_core::ParamError;
use swerve_msg::{PredictionList, TrackList};
use swerve_prediction::learned::Weights;
use swerve_prediction::{Ground, Horizon, Predictor, PredictorName, linear, predict, predict_by, road};
use swerve_text::{KeyProblem, overridden};

use crate::config::PredictionConfig;
use crate::named::{NoKeys, Of};
use crate::problems::outside;

/// Settings of `[prediction]` for a predictor.
#[derive(Clone, Copy, Debug)]
pub struct PredictorSetup<'a> {
    /// `[prediction]`.
    pub config: &'a PredictionConfig,
    /// Weights from the file `prediction.weights`.
    pub weights: Option<&'a Weights>,
}

/// A predictor that `prediction.predictor` can name.
///
/// [`Registry::with_predictor`](crate::Registry::with_predictor) adds one. It then predicts in drives and studies, with
/// run times, and in `swerve eval prediction`, as built-in predictors do.
pub trait NamedPredictor: Predictor + Sized + 'static {
    /// Name in `prediction.predictor`.
    const NAME: &'static str;

    /// True if it gets the road even where `prediction.along_road` is false.
    const ON_ROAD: bool = false;

    /// Parameters: the keys of `prediction.params`.
    type Params: Serialize + DeserializeOwned;

    /// Default parameters.
    fn defaults(of: PredictorSetup<'_>) -> Self::Params;

    /// Creates the predictor.
    ///
    /// # Errors
    /// A parameter out of its range.
    fn with_params(params: Self::Params, of: PredictorSetup<'_>) -> Result<Self, ParamError>;
}

/// A predictor's type, erased.
pub(crate) trait AnyPredictor: Send + Sync {
    fn is_on_road(&self) -> bool;

    /// The predictor, from parameters that differ from the defaults.
    fn build(&self, of: PredictorSetup<'_>) -> Result<Box<dyn Predictor>, Vec<KeyProblem>>;
}

impl<P: NamedPredictor> AnyPredictor for Of<P> {
    fn is_on_road(&self) -> bool {
        P::ON_ROAD
    }

    fn build(&self, of: PredictorSetup<'_>) -> Result<Box<dyn Predictor>, Vec<KeyProblem>> {
        let params = overridden(&P::defaults(of), &of.config.params)?;
        Ok(Box::new(P::with_params(params, of).map_err(outside)?))
    }
}

/// Straight lines through past sightings, or along the road.
pub(crate) struct Linear(linear::Params);

impl Predictor for Linear {
    fn predict(&mut self, tracks: &TrackList, horizon: &Horizon, ground: Ground<'_>) -> PredictionList {
        let (future_steps, step_s) = (horizon.steps, horizon.step.as_secs());
        let mut list = linear::predict(tracks, &linear::Params { future_steps, step_s, ..self.0 });
        if let Ground::Road(route) = ground {
            road::follow(&mut list.predictions, route);
        }
        list
    }
}

impl NamedPredictor for Linear {
    const NAME: &'static str = PredictorName::Linear.name();
    type Params = NoKeys;

    fn defaults(_: PredictorSetup<'_>) -> NoKeys {
        NoKeys {}
    }

    fn with_params(_: NoKeys, PredictorSetup { config, .. }: PredictorSetup<'_>) -> Result<Self, ParamError> {
        Ok(Self(linear::Params { past_steps: config.past_steps, ..config.preset.linear() }))
    }
}

/// A built-in predictor of [`PredictorName::ALL`], with weights from a file in place of the shipped ones.
pub(crate) struct BuiltIn<const NAME: usize>(Option<Weights>);

impl<const NAME: usize> BuiltIn<NAME> {
    const OF: PredictorName = PredictorName::ALL[NAME];
}

impl<const NAME: usize> Predictor for BuiltIn<NAME> {
    fn predict(&mut self, tracks: &TrackList, horizon: &Horizon, ground: Ground<'_>) -> PredictionList {
        match &self.0 {
            Some(weights) => predict_by(weights, tracks, horizon, ground),
            None => predict(Self::OF, tracks, horizon, ground),
        }
    }
}

impl<const NAME: usize> NamedPredictor for BuiltIn<NAME> {
    const NAME: &'static str = Self::OF.name();
    const ON_ROAD: bool = matches!(Self::OF, PredictorName::LaneIdm);
    type Params = NoKeys;

    fn defaults(_: PredictorSetup<'_>) -> NoKeys {
        NoKeys {}
    }

    fn with_params(_: NoKeys, of: PredictorSetup<'_>) -> Result<Self, ParamError> {
        Ok(Self(of.weights.cloned()))
    }
}

/// The simulator's future, which the operator of predictors reads from the world; constant velocity without a world.
pub(crate) struct Truth;

impl Predictor for Truth {
    fn predict(&mut self, tracks: &TrackList, horizon: &Horizon, ground: Ground<'_>) -> PredictionList {
        predict(PredictorName::Truth, tracks, horizon, ground)
    }
}

impl NamedPredictor for Truth {
    const NAME: &'static str = PredictorName::Truth.name();
    type Params = NoKeys;

    fn defaults(_: PredictorSetup<'_>) -> NoKeys {
        NoKeys {}
    }

    fn with_params(_: NoKeys, _: PredictorSetup<'_>) -> Result<Self, ParamError> {
        Ok(Self)
    }
}
