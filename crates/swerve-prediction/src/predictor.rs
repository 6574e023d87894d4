//! Predictors by name: each turns tracks into ways in which their actors may go on.

mod drawn;
mod filters;
mod lane_idm;
mod orca;
mod social_force;
mod straight;
#[cfg(test)]
mod tests;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require, require_within};
use swerve_core::{Span, Time};
use swerve_msg::{ForecastList, Route, Track, TrackList};

use crate::past::Past;

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
}

impl PredictorName {
    /// All, in the order of this list.
    pub const ALL: [Self; 8] = [
        Self::Linear,
        Self::ConstantVelocity,
        Self::Kalman,
        Self::Ctra,
        Self::Imm,
        Self::SocialForce,
        Self::Orca,
        Self::LaneIdm,
    ];

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
        require("steps", self.steps, (1..=10_000).contains(&self.steps), "from 1 to 10000")?;
        require_within("step_s", self.step.as_secs(), [1e-3, 10.0])
    }

    /// The instants, the stamp first.
    fn instants(&self, stamp: Time) -> impl Iterator<Item = Time> {
        let step = self.step;
        (0..=self.steps as i64).map(move |k| stamp + step * k)
    }
}

/// One actor's track beside what of its past can be gone by.
struct Seen<'a> {
    track: &'a Track,
    past: Past,
}

/// How every track may go on, in the map frame. `road` is what [`PredictorName::LaneIdm`] keeps to; without it, straight
/// ahead is the lane.
///
/// Tracks that cannot be on a road ([`Track::is_plausible`]) are left out. Covariances are those of people on foot and of
/// vehicles as recorded (docs/prediction.md), not of these actors.
pub fn forecast(
    name: PredictorName,
    tracks: &TrackList,
    horizon: &Horizon,
    road: Option<&Route>,
) -> ForecastList {
    let stamp = tracks.stamp;
    let plausible = tracks.tracks.iter().filter(|track| track.is_plausible());
    let seen: Vec<Seen> = plausible.map(|track| Seen { track, past: Past::of(track, stamp) }).collect();
    let forecasts = match name {
        PredictorName::Linear => straight::linear(&seen, stamp, horizon),
        PredictorName::ConstantVelocity => straight::constant_velocity(&seen, stamp, horizon),
        PredictorName::Kalman => filters::forecasts(&seen, stamp, horizon, filters::KALMAN),
        PredictorName::Ctra => filters::forecasts(&seen, stamp, horizon, filters::CTRA),
        PredictorName::Imm => filters::forecasts(&seen, stamp, horizon, filters::IMM),
        PredictorName::SocialForce => social_force::forecasts(&seen, stamp, horizon),
        PredictorName::Orca => orca::forecasts(&seen, stamp, horizon),
        PredictorName::LaneIdm => lane_idm::forecasts(&seen, stamp, horizon, road),
    };
    ForecastList { stamp, forecasts, joint: false }
}
