use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::Pose2;

use crate::obstacle::{ActorId, ActorKind, Extent, PredictedPose, Prediction, PredictionList};

/// Where something will be at one instant, and how sure that is.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ForecastPose {
    /// Instant.
    pub at: Time,
    /// Pose of its centre in the map.
    pub pose: Pose2,
    /// Covariance of the centre in the map: xx, xy, yy, m².
    pub covariance_m2: [f64; 3],
}

/// One way in which something may go on.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Mode {
    /// Probability of this mode, 0 to 1.
    pub probability: f64,
    /// Poses at increasing instants; the first describes the stamp of the list. Never empty.
    pub path: Vec<ForecastPose>,
}

/// All ways in which one actor may go on.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Forecast {
    /// Identity of the track.
    pub id: ActorId,
    /// What it is.
    pub kind: ActorKind,
    /// Size.
    pub extent: Extent,
    /// At least one, with the same instants each; probabilities sum to 1.
    pub modes: Vec<Mode>,
}

/// How everything tracked may go on.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct ForecastList {
    /// Instant of the newest sighting that this builds on.
    pub stamp: Time,
    /// Ordered by identity.
    pub forecasts: Vec<Forecast>,
    /// Whether mode `k` of one actor goes with mode `k` of every other: as many modes each. Probabilities are each actor's
    /// own all the same, since a bound on what may be touched adds up those of single actors.
    pub joint: bool,
}

impl Forecast {
    /// The mode of greatest probability, the first of equals.
    pub fn likeliest(&self) -> Option<&Mode> {
        self.modes.iter().reduce(|best, mode| if mode.probability > best.probability { mode } else { best })
    }
}

impl From<&ForecastList> for PredictionList {
    /// A prediction for every mode, with its probability: those of one actor follow each other. Covariances are left out.
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
