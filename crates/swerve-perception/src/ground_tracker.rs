//! Selection between the trackers of boxes on the ground.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::ParamError;
use swerve_geom::{Map, Pose2};
use swerve_msg::{ActorId, ActorKind, Detections, TrackList};

use crate::{Ab3dMot, Tracker, ab3dmot, tracker};

/// Tracking algorithm.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Algorithm {
    /// SORT in the ground plane, with a Kalman filter and optimal assignment ([`Tracker`]).
    #[default]
    Sort,
    /// AB3DMOT, pairing boxes by their overlap in space ([`Ab3dMot`]).
    Ab3dmot,
}

/// Parameters of the selected tracker.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum GroundParams {
    /// Parameters of [`Tracker`].
    Sort(tracker::Params),
    /// Parameters of [`Ab3dMot`].
    Ab3dmot(ab3dmot::Params),
}

impl Default for GroundParams {
    fn default() -> Self {
        Self::Sort(tracker::Params::default())
    }
}

impl GroundParams {
    /// Checks that all parameters are in range.
    ///
    /// # Errors
    /// The first parameter outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        match self {
            Self::Sort(params) => params.validate(),
            Self::Ab3dmot(params) => params.validate(),
        }
    }

    /// Number of boxes after which a track of a person, the kind lost most often, is reported.
    pub fn hits_min(&self) -> usize {
        match self {
            Self::Sort(params) => params.hits_min,
            Self::Ab3dmot(params) => params.rules(ActorKind::Pedestrian).birth,
        }
    }
}

/// Tracker with a selectable algorithm.
#[derive(Clone, PartialEq, Debug)]
pub enum GroundTracker {
    /// Pairs boxes by Mahalanobis distance.
    Sort(Tracker),
    /// Pairs boxes by overlap in space.
    Ab3dmot(Ab3dMot),
}

impl GroundTracker {
    /// Tracker without tracks.
    ///
    /// # Errors
    /// If a parameter is outside its range.
    pub fn new(params: GroundParams) -> Result<Self, ParamError> {
        Ok(match params {
            GroundParams::Sort(params) => Self::Sort(Tracker::new(params)?),
            GroundParams::Ab3dmot(params) => Self::Ab3dmot(Ab3dMot::new(params)?),
        })
    }

    /// Updates the tracks with the detections of one instant and the ego's pose in the map at that instant. Returns the
    /// reported tracks.
    pub fn update(&mut self, found: &Detections, ego: Pose2<Map>) -> TrackList {
        match self {
            Self::Sort(tracker) => tracker.update(found, ego),
            Self::Ab3dmot(tracker) => tracker.update(found, ego),
        }
    }

    /// Score of a reported track.
    pub fn score(&self, id: ActorId) -> Option<f64> {
        match self {
            Self::Sort(tracker) => tracker.score(id),
            Self::Ab3dmot(tracker) => tracker.score(id),
        }
    }
}
