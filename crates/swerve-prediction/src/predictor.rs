//! Predictors by name: each turns tracks into ways in which their actors may go on.

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
use swerve_core::param::{ParamError, require_all_within};
use swerve_core::{Span, Time};
use swerve_msg::{Forecast, ForecastList, Route, Track, TrackList};

use crate::lanes::LaneGraph;
use crate::learned::{Model, Weights};
use crate::past::Past;

pub use truth::{Telling, Told, foretold};

/// Predictors by name.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PredictorName {
    /// The paper's straight line through the last five sightings.
    #[default]
    Linear,
    /// On with the velocity of the last half second.
    ConstantVelocity,
    /// A Kalman filter over position and a velocity that slowly dies away.
    Kalman,
    /// A Kalman filter over position, velocity and acceleration; turn and acceleration die away within a second.
    Ctra,
    /// Three filters at once, weighed by how well they foretold the past: going on, turning, stopping. Three modes.
    Imm,
    /// People push each other off (Helbing and Molnár 1995).
    SocialForce,
    /// Everybody takes half of the care that nobody touches anybody (van den Berg et al. 2011).
    Orca,
    /// Vehicles keep to the lane and their distance (Treiber's intelligent driver model), or brake: two modes. People go
    /// on or stop.
    LaneIdm,
    /// A net after MultiPath (Chai et al. 2019), reduced: anchors with offsets and spreads, all at once.
    Multipath,
    /// A net after multiple futures prediction (Tang and Salakhutdinov 2019), reduced: hidden modes, unrolled step by step
    /// for everybody at once.
    Mfp,
    /// A net after R2P2 (Rhinehart et al. 2018), reduced: a policy of one step, whose noise makes samples.
    R2p2,
    /// What will happen, where somebody tells it ([`foretold`]): for experiments.
    Truth,
}

impl PredictorName {
    /// All that foretell from tracks alone, in the order of this list.
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

    /// Without a model of deceleration: the present speed is kept.
    fn knows_no_braking(self) -> bool {
        matches!(self, Self::ConstantVelocity | Self::Kalman | Self::SocialForce | Self::Orca)
    }

    /// As it is written in configurations.
    pub fn name(self) -> &'static str {
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

/// Which instants are predicted: the list's stamp and `steps` after it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Horizon {
    /// Poses after the present one.
    pub steps: usize,
    /// Between two of them.
    pub step: Span,
}

impl Horizon {
    /// The first part outside its range, if there is one.
    pub fn validate(&self) -> Result<(), ParamError> {
        require_all_within(&[
            ("steps", self.steps as f64, [1.0, 10_000.0]),
            ("step_s", self.step.as_secs(), [1e-3, 10.0]),
        ])
    }

    /// The instants, the stamp first.
    fn instants(&self, stamp: Time) -> impl Iterator<Item = Time> {
        let step = self.step;
        (0..=self.steps as i64).map(move |k| stamp + step * k)
    }
}

/// What drivers keep to, as far as it is known.
#[derive(Clone, Copy, Debug, Default)]
pub enum Ground<'a> {
    /// Nothing: straight ahead is the lane.
    #[default]
    Open,
    /// One road, along which everybody keeps his offset, either way.
    Road(&'a Route),
    /// Lanes, and the ways over them.
    Lanes(&'a LaneGraph),
}

impl<'a> Ground<'a> {
    /// A road, if there is one.
    pub fn road(road: Option<&'a Route>) -> Self {
        road.map_or(Self::Open, Self::Road)
    }

    /// Lanes, if there are any.
    pub fn lanes(lanes: Option<&'a LaneGraph>) -> Self {
        lanes.map_or(Self::Open, Self::Lanes)
    }
}

/// One actor's track beside what of its past can be gone by.
pub(crate) struct Seen<'a> {
    pub(crate) track: &'a Track,
    pub(crate) past: Past,
}

/// Everybody who can be on a road.
pub(crate) fn seen(tracks: &TrackList) -> Vec<Seen<'_>> {
    let plausible = tracks.tracks.iter().filter(|track| track.is_plausible());
    plausible.map(|track| Seen { track, past: Past::of(track, tracks.stamp) }).collect()
}

/// How every track may go on, in the map frame.
///
/// [`PredictorName::LaneIdm`] keeps to `ground`. On [`Ground::Road`] all others predict vehicles that drive along the road
/// in its coordinates, without the modes that leave its ground, and those without a model of deceleration predict that
/// braking vehicles brake on to a stop; no other ground changes them.
/// Tracks know nothing of [`PredictorName::Truth`], which goes on as [`PredictorName::ConstantVelocity`] here. Tracks that cannot be on a road ([`Track::is_plausible`]) are left out. Covariances are those of people on foot and of
/// vehicles as recorded (docs/prediction.md), not of these actors.
pub fn forecast(
    name: PredictorName,
    tracks: &TrackList,
    horizon: &Horizon,
    ground: Ground<'_>,
) -> ForecastList {
    match ground {
        Ground::Road(route) if name != PredictorName::LaneIdm => {
            let predict = |tracks: &TrackList| on_ground(name, tracks, horizon, Ground::Open);
            along_road::forecasts(tracks, route, name.knows_no_braking(), predict)
        }
        _ => on_ground(name, tracks, horizon, ground),
    }
}

/// The forecasts in the coordinates in which the tracks are.
fn on_ground(name: PredictorName, tracks: &TrackList, horizon: &Horizon, ground: Ground<'_>) -> ForecastList {
    let stamp = tracks.stamp;
    let seen = seen(tracks);
    let forecasts = match name {
        PredictorName::Linear => straight::linear(&seen, stamp, horizon),
        PredictorName::ConstantVelocity => straight::constant_velocity(&seen, stamp, horizon),
        PredictorName::Kalman => filters::forecasts(&seen, stamp, horizon, filters::KALMAN),
        PredictorName::Ctra => filters::forecasts(&seen, stamp, horizon, filters::CTRA),
        PredictorName::Imm => filters::forecasts(&seen, stamp, horizon, filters::IMM),
        PredictorName::SocialForce => social_force::forecasts(&seen, stamp, horizon),
        PredictorName::Orca => orca::forecasts(&seen, stamp, horizon),
        PredictorName::LaneIdm => lane_idm::forecasts(&seen, stamp, horizon, ground),
        PredictorName::Multipath | PredictorName::Mfp | PredictorName::R2p2 => {
            let weights = shipped(name).expect("each of these has learnt");
            learned::forecasts(&seen, stamp, horizon, weights)
        }
        PredictorName::Truth => return foretold(tracks, horizon, &Telling::default(), &|_, _| None),
    };
    ForecastList { stamp, forecasts, joint: name == PredictorName::Mfp }
}

/// As [`PredictorName::Imm`].
pub(crate) fn imm(seen: &[Seen], stamp: Time, horizon: &Horizon) -> Vec<Forecast> {
    filters::forecasts(seen, stamp, horizon, filters::IMM)
}

/// The weights that a predictor is shipped with, if it is one that has learnt.
pub fn shipped(name: PredictorName) -> Option<&'static Weights> {
    learned::shipped(name)
}

/// Forecasts by weights other than the shipped ones, otherwise as by [`forecast`].
pub fn forecast_by(
    weights: &Weights,
    tracks: &TrackList,
    horizon: &Horizon,
    ground: Ground<'_>,
) -> ForecastList {
    let predict = |tracks: &TrackList| {
        let forecasts = learned::forecasts(&seen(tracks), tracks.stamp, horizon, weights);
        ForecastList { stamp: tracks.stamp, forecasts, joint: weights.shape.model == Model::Mfp }
    };
    match ground {
        Ground::Road(route) => along_road::forecasts(tracks, route, false, predict),
        _ => predict(tracks),
    }
}
