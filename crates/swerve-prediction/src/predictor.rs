//! Predictors by name: each turns tracks into predictions with modes and covariances.

mod along_road;
#[cfg(test)]
mod any_tracks;
mod drawn;
mod filters;
mod lane_idm;
mod learned;
pub(crate) mod orca;
mod social_force;
mod straight;
#[cfg(test)]
mod tests;
mod truth;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require_within};
use swerve_core::{Span, Time};
use swerve_map::Map;
use swerve_msg::{Prediction, PredictionList, Route, Track, TrackList};

use crate::learned::{Model, Weights};
use crate::past::Past;

pub use truth::{Telling, Told, foretold};

/// A predictor: from tracks to predictions.
pub trait Predictor: Send {
    /// Predicts the motion of every track, in the map frame: poses at the instants of `horizon` after the list's stamp,
    /// the pose at the stamp first, and their covariances if the predictor has them.
    fn predict(&mut self, tracks: &TrackList, horizon: &Horizon, ground: Ground<'_>) -> PredictionList;
}

/// Name of a built-in predictor.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PredictorName {
    /// Straight line through the last five sightings, as in the paper.
    #[default]
    Linear,
    /// Constant velocity of the last half second.
    ConstantVelocity,
    /// Kalman filter over position and a slowly decaying velocity.
    Kalman,
    /// Kalman filter over position, velocity and acceleration; turn rate and acceleration decay within a second.
    Ctra,
    /// Three filters weighted by their likelihood on the past: cruising, turning, stopping. Three modes.
    Imm,
    /// Social forces: pedestrians repel each other (Helbing and Molnár 1995).
    SocialForce,
    /// Reciprocal collision avoidance: each of two takes half of the avoidance (van den Berg et al. 2011).
    Orca,
    /// Vehicles follow their lane and keep their distance (Treiber's intelligent driver model), or brake: two modes.
    /// Pedestrians continue or stop.
    LaneIdm,
    /// Net after MultiPath (Chai et al. 2019), reduced: anchors with offsets and covariances, in a single pass.
    Multipath,
    /// Net after multiple futures prediction (Tang and Salakhutdinov 2019), reduced: latent modes, unrolled step by
    /// step for all actors at once.
    Mfp,
    /// Net after R2P2 (Rhinehart et al. 2018), reduced: a one-step policy whose noise yields samples.
    R2p2,
    /// Future ground truth, if it is provided ([`foretold`]): for experiments.
    Truth,
}

impl PredictorName {
    /// All predictors that use tracks only, in the order of the enum.
    pub const ALL: [Self; 11] = [
        Self::Linear,
        Self::ConstantVelocity,
        Self::Kalman,
        Self::Ctra,
        Self::Imm,
        Self::SocialForce,
        Self::Orca,
        Self::LaneIdm,
        Self::Multipath,
        Self::Mfp,
        Self::R2p2,
    ];

    /// Returns true for predictors without a model of deceleration: they keep the present speed.
    fn knows_no_braking(self) -> bool {
        matches!(self, Self::ConstantVelocity | Self::Kalman | Self::SocialForce | Self::Orca)
    }

    /// Name in configurations.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::ConstantVelocity => "constant_velocity",
            Self::Kalman => "kalman",
            Self::Ctra => "ctra",
            Self::Imm => "imm",
            Self::SocialForce => "social_force",
            Self::Orca => "orca",
            Self::LaneIdm => "lane_idm",
            Self::Multipath => "multipath",
            Self::Mfp => "mfp",
            Self::R2p2 => "r2p2",
            Self::Truth => "truth",
        }
    }
}

/// Predicted instants: the list's stamp and `steps` after it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Horizon {
    /// Number of poses after the present one.
    pub steps: usize,
    /// Interval between poses.
    pub step: Span,
}

impl Horizon {
    /// Checks both fields; the error names the first one that is out of range.
    pub fn validate(&self) -> Result<(), ParamError> {
        require_within("steps", self.steps as f64, [1.0, 10_000.0])?;
        require_within("step_s", self.step.as_secs(), [1e-3, 10.0])
    }

    /// Predicted instants, the stamp first.
    fn instants(&self, stamp: Time) -> impl Iterator<Item = Time> {
        let step = self.step;
        (0..=self.steps as i64).map(move |k| stamp + step * k)
    }
}

/// Road geometry that vehicles follow, as far as it is known.
#[derive(Clone, Copy, Debug, Default)]
pub enum Ground<'a> {
    /// Unknown: vehicles drive straight ahead.
    #[default]
    Open,
    /// A single road, along which road users keep their lateral offset, in either direction.
    Road(&'a Route),
    /// A lane map: vehicles follow the paths over its lanes.
    Lanes(&'a Map),
}

impl<'a> Ground<'a> {
    /// [`Ground::Road`] if there is a road, else [`Ground::Open`].
    pub fn road(road: Option<&'a Route>) -> Self {
        road.map_or(Self::Open, Self::Road)
    }

    /// [`Ground::Lanes`] if there are lanes, else [`Ground::Open`].
    pub fn lanes(lanes: Option<&'a Map>) -> Self {
        lanes.map_or(Self::Open, Self::Lanes)
    }
}

/// Possible motions of one road user; at least one.
type Modes = Vec<Prediction>;

/// A track with its usable past.
pub(crate) struct Tracked<'a> {
    pub(crate) track: &'a Track,
    pub(crate) past: Past,
}

/// Plausible tracks with their pasts.
pub(crate) fn seen(tracks: &TrackList) -> Vec<Tracked<'_>> {
    let plausible = tracks.tracks.iter().filter(|track| track.is_plausible());
    plausible.map(|track| Tracked { track, past: Past::of(track, tracks.stamp) }).collect()
}

/// Predicts the motion of every track, in the map frame.
///
/// [`PredictorName::LaneIdm`] follows `ground`. On [`Ground::Road`], all others predict vehicles that drive along the
/// road in its coordinates, without the modes that leave its ground, and those without a model of deceleration
/// predict that braking vehicles brake to a stop; other grounds have no effect on them. [`PredictorName::Truth`] has
/// no ground truth here and equals [`PredictorName::ConstantVelocity`]. Implausible tracks ([`Track::is_plausible`])
/// are dropped. Covariances are those of recorded pedestrians and vehicles (docs/prediction.md), not of the
/// individual actors.
pub fn predict(
    name: PredictorName,
    tracks: &TrackList,
    horizon: &Horizon,
    ground: Ground<'_>,
) -> PredictionList {
    let (modes, are_kept) = match ground {
        Ground::Road(route) if name != PredictorName::LaneIdm => {
            let predict = |tracks: &TrackList| on_ground(name, tracks, horizon, Ground::Open);
            along_road::predictions(tracks, route, name.knows_no_braking(), predict)
        }
        _ => (on_ground(name, tracks, horizon, ground), true),
    };
    listed(tracks, modes, are_kept && name == PredictorName::Mfp)
}

fn listed(tracks: &TrackList, modes: Vec<Modes>, joint: bool) -> PredictionList {
    PredictionList { stamp: tracks.stamp, predictions: modes.into_iter().flatten().collect(), joint }
}

/// Modes of each road user, in the coordinates of the tracks.
fn on_ground(name: PredictorName, tracks: &TrackList, horizon: &Horizon, ground: Ground<'_>) -> Vec<Modes> {
    let stamp = tracks.stamp;
    let seen = seen(tracks);
    match name {
        PredictorName::Linear => straight::linear(&seen, stamp, horizon),
        PredictorName::ConstantVelocity => straight::constant_velocity(&seen, stamp, horizon),
        PredictorName::Kalman => filters::predictions(&seen, stamp, horizon, filters::KALMAN),
        PredictorName::Ctra => filters::predictions(&seen, stamp, horizon, filters::CTRA),
        PredictorName::Imm => filters::predictions(&seen, stamp, horizon, filters::IMM),
        PredictorName::SocialForce => social_force::predictions(&seen, stamp, horizon),
        PredictorName::Orca => orca::predictions(&seen, stamp, horizon),
        PredictorName::LaneIdm => lane_idm::predictions(&seen, stamp, horizon, ground),
        PredictorName::Multipath | PredictorName::Mfp | PredictorName::R2p2 => {
            let weights = shipped(name).expect("each of these has learnt");
            learned::predictions(&seen, stamp, horizon, weights)
        }
        // Without ground truth.
        PredictorName::Truth => straight::constant_velocity(&seen, stamp, horizon),
    }
}

/// Modes of each road user by [`PredictorName::Imm`].
pub(crate) fn imm(seen: &[Tracked], stamp: Time, horizon: &Horizon) -> Vec<Modes> {
    filters::predictions(seen, stamp, horizon, filters::IMM)
}

/// Shipped weights of a learned predictor; `None` for others.
pub fn shipped(name: PredictorName) -> Option<&'static Weights> {
    learned::shipped(name)
}

/// As [`predict`], with weights other than the shipped ones.
pub fn predict_by(
    weights: &Weights,
    tracks: &TrackList,
    horizon: &Horizon,
    ground: Ground<'_>,
) -> PredictionList {
    let predict = |tracks: &TrackList| learned::predictions(&seen(tracks), tracks.stamp, horizon, weights);
    let (modes, are_kept) = match ground {
        Ground::Road(route) => along_road::predictions(tracks, route, false, predict),
        _ => (predict(tracks), true),
    };
    listed(tracks, modes, are_kept && weights.shape.model == Model::Mfp)
}
