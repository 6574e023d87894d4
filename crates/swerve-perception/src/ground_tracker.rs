//! The trackers of boxes on the ground, one of which a pipeline has.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::ParamError;
use swerve_geom::{Map, Pose2};
use swerve_msg::{ActorId, ActorKind, Detections, TrackList};

use crate::{Ab3dMot, Tracker, ab3dmot, tracker};

/// The name of a tracker.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Algorithm {
    /// [`Tracker`].
    #[default]
    Sort,
    /// [`Ab3dMot`].
    Ab3dmot,
}

/// Parameters of the tracker that is chosen.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum GroundParams {
    /// Of [`Tracker`].
    Sort(tracker::Params),
    /// Of [`Ab3dMot`].
    Ab3dmot(ab3dmot::Params),
}

impl Default for GroundParams {
    fn default() -> Self {
        Self::Sort(tracker::Params::default())
    }
}

impl GroundParams {
    /// The first parameter outside its range.
    ///
    /// # Errors
    /// There is one.
    pub fn validate(&self) -> Result<(), ParamError> {
        match self {
            Self::Sort(params) => params.validate(),
            Self::Ab3dmot(params) => params.validate(),
        }
    }

    /// Boxes that a track has to have had to be reported: of a person, who is what sight of is lost most.
    pub fn hits_min(&self) -> usize {
        match self {
            Self::Sort(params) => params.hits_min,
            Self::Ab3dmot(params) => params.rules(ActorKind::Pedestrian).birth,
        }
    }
}

/// Follows boxes over time by the algorithm that is chosen.
#[derive(Clone, PartialEq, Debug)]
pub enum GroundTracker {
    /// By distances in standard deviations.
    Sort(Tracker),
    /// By overlap in space.
    Ab3dmot(Ab3dMot),
}

impl GroundTracker {
    /// Without any past.
    ///
    /// # Errors
    /// A parameter outside its range.
    pub fn new(params: GroundParams) -> Result<Self, ParamError> {
        Ok(match params {
            GroundParams::Sort(params) => Self::Sort(Tracker::new(params)?),
            GroundParams::Ab3dmot(params) => Self::Ab3dmot(Ab3dMot::new(params)?),
        })
    }

    /// Takes in what a detector reports of one instant, with the ego's pose in the map then, and gives the tracks that
    /// are reported of it.
    pub fn update(&mut self, found: &Detections, ego: Pose2<Map>) -> TrackList {
        match self {
            Self::Sort(tracker) => tracker.update(found, ego),
            Self::Ab3dmot(tracker) => tracker.update(found, ego),
        }
    }

    /// How sure a track that is reported is.
    pub fn score(&self, id: ActorId) -> Option<f64> {
        match self {
            Self::Sort(tracker) => tracker.score(id),
            Self::Ab3dmot(tracker) => tracker.score(id),
        }
    }
}
