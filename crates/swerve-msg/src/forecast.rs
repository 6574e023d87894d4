//! Multimodal predictions with uncertainty.

use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::Pose2;

use crate::obstacle::{ActorId, ActorKind, Extent, PredictedPose, Prediction, PredictionList};

/// Predicted pose at one instant, with its uncertainty.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ForecastPose {
    /// Instant.
    pub at: Time,
    /// Pose of the centre in the map.
    pub pose: Pose2,
    /// Covariance of the centre in the map: xx, xy, yy, m².
    pub covariance_m2: [f64; 3],
}

/// One possible future motion of an actor.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Mode {
    /// Probability of this mode, 0 to 1.
    pub probability: f64,
    /// Poses at increasing instants; the first describes the stamp of the list. Never empty.
    pub path: Vec<ForecastPose>,
}

/// All possible future motions of one actor.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Forecast {
    /// Identity of the track.
    pub id: ActorId,
    /// Kind of the actor.
    pub kind: ActorKind,
    /// Size.
    pub extent: Extent,
    /// At least one mode. All modes have the same instants; their probabilities sum to 1.
    pub modes: Vec<Mode>,
}

/// Possible future motions of all tracks.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct ForecastList {
    /// Instant of the newest sighting used.
    pub stamp: Time,
    /// Ordered by identity.
    pub forecasts: Vec<Forecast>,
    /// True if the modes are joint: mode `k` of one actor occurs with mode `k` of all others, and all have equally
    /// many modes. Probabilities remain those of each actor, since a bound on the collision probability sums over
    /// single actors.
    pub joint: bool,
}

impl Forecast {
    /// The most probable mode; the first of equals.
    pub fn likeliest(&self) -> Option<&Mode> {
        self.modes.iter().reduce(|best, mode| if mode.probability > best.probability { mode } else { best })
    }
}

impl From<&PredictionList> for ForecastList {
    /// Groups consecutive predictions of one actor to the modes of a forecast, with zero covariances.
    fn from(list: &PredictionList) -> Self {
        let pose = |at: &PredictedPose| ForecastPose { at: at.at, pose: at.pose, covariance_m2: [0.0; 3] };
        let mode = |one: &Prediction| Mode {
            probability: one.probability,
            path: one.path.iter().map(pose).collect(),
        };
        let of_one = |modes: &[Prediction]| {
            let Prediction { id, kind, extent, .. } = modes[0];
            Forecast { id, kind, extent, modes: modes.iter().map(mode).collect() }
        };
        let by_actor = list.predictions.chunk_by(|a, b| a.id == b.id);
        Self { stamp: list.stamp, forecasts: by_actor.map(of_one).collect(), joint: false }
    }
}

impl From<&ForecastList> for PredictionList {
    /// Converts each mode to a prediction with its probability, grouped by actor. Drops covariances.
    fn from(list: &ForecastList) -> Self {
        let of_one = |forecast: &Forecast| {
            let Forecast { id, kind, extent, .. } = *forecast;
            let prediction = |mode: &Mode| Prediction {
                id,
                kind,
                extent,
                probability: mode.probability,
                path: mode.path.iter().map(|at| PredictedPose { at: at.at, pose: at.pose }).collect(),
            };
            forecast.modes.iter().map(prediction).collect::<Vec<_>>()
        };
        Self { stamp: list.stamp, predictions: list.forecasts.iter().flat_map(of_one).collect() }
    }
}
