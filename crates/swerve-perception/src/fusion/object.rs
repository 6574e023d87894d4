//! Objects at the latest instant.

use swerve_core::Time;
use swerve_geom::{Ego, Map, Pose2};
use swerve_msg::{ActorKind, DetectedBox};

use super::place::{Spread, moved};
use super::sight::Sighted;

/// Standard deviation of each velocity component of pedestrians and cyclists, and of vehicles, m/s.
const PERSON_MPS: f64 = 2.0;
const VEHICLE_MPS: f64 = 8.0;

/// Object at the latest instant.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Object {
    pub(super) found: DetectedBox,
    pub(super) spread: Spread,
    /// True if its distance comes from the ground plane, the least accurate source.
    pub(super) is_guessed: bool,
    /// True if no earlier list contained it.
    pub(super) is_new: bool,
}

impl Object {
    /// Squared Mahalanobis distance to another object; `None` if the covariance is singular.
    pub(super) fn distance(&self, other: &Self) -> Option<f64> {
        self.spread.distance(self.found.pose.point() - other.found.pose.point(), other.spread)
    }

    /// True for a vehicle of a known class.
    pub(super) fn is_vehicle(&self) -> bool {
        !self.found.kind.is_person() && self.found.kind != ActorKind::Static
    }

    pub(super) fn told(&self) -> DetectedBox {
        DetectedBox { covariance_m2: Some(self.spread.entries()), ..self.found }
    }
}

impl Sighted<'_> {
    /// Converts a box to an object at a later instant.
    pub(super) fn object(
        &self,
        found: &DetectedBox,
        place: (Pose2<Ego>, Spread),
        (stamp, ego): (Time, Pose2<Map>),
        is_guessed: bool,
    ) -> Object {
        let (pose, spread) = moved(place, self.ego, ego);
        let pace_mps = if found.kind.is_person() { PERSON_MPS } else { VEHICLE_MPS };
        let spread = spread.grown(pace_mps * (stamp - self.found.stamp).as_secs());
        Object { found: DetectedBox { pose, ..*found }, spread, is_guessed, is_new: self.is_new }
    }
}
