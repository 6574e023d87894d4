//! The common interface of trackers of boxes on the ground.

use swerve_geom::{Map, Pose2};
use swerve_msg::{ActorId, ActorKind, Detections, TrackList};

use crate::{Ab3dMot, Tracker};

/// A tracker of boxes on the ground.
pub trait GroundTracker: Send {
    /// Updates the tracks with the detections of one instant and the ego's pose in the map at that instant. Returns the
    /// reported tracks, ordered by identity.
    fn update(&mut self, found: &Detections, ego: Pose2<Map>) -> TrackList;

    /// Score of a reported track; `None` for a tracker without scores.
    fn score(&self, _: ActorId) -> Option<f64> {
        None
    }

    /// Number of boxes after which a track of a person, the kind lost most often, is reported.
    fn hits_min(&self) -> usize {
        1
    }
}

/// SORT in the ground plane, with a Kalman filter and optimal assignment: pairs boxes by Mahalanobis distance.
impl GroundTracker for Tracker {
    fn update(&mut self, found: &Detections, ego: Pose2<Map>) -> TrackList {
        self.update(found, ego)
    }

    fn score(&self, id: ActorId) -> Option<f64> {
        self.score(id)
    }

    fn hits_min(&self) -> usize {
        self.params().hits_min
    }
}

/// AB3DMOT: pairs boxes by their overlap in space.
impl GroundTracker for Ab3dMot {
    fn update(&mut self, found: &Detections, ego: Pose2<Map>) -> TrackList {
        self.update(found, ego)
    }

    fn score(&self, id: ActorId) -> Option<f64> {
        self.score(id)
    }

    fn hits_min(&self) -> usize {
        self.params().rules(ActorKind::Pedestrian).birth
    }
}
