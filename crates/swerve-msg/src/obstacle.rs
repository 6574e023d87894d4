//! Obstacles, tracks and predictions.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use swerve_core::{Time, unless_default};
use swerve_geom::{Obb, Point2, Pose2, Vector2};

use crate::ego::{is_plausible_place, is_plausible_velocity};

/// Identifies an actor or a track within one run.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ActorId(pub u32);

impl ActorId {
    /// The ego, in a world with one; the first of several.
    pub const EGO: Self = Self(0);
}

/// Names of the actors of a run.
pub type ActorNames = BTreeMap<ActorId, String>;

/// Kind of an actor.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ActorKind {
    /// A passenger car or van.
    Car,
    /// A truck or bus.
    Truck,
    /// A motorcycle with its rider.
    Motorcycle,
    /// A bicycle with its rider.
    Cyclist,
    /// A person on foot.
    Pedestrian,
    /// Any immovable object: walls, poles, boxes.
    Static,
}

impl ActorKind {
    /// Returns true for a person outside a motor vehicle.
    pub fn is_person(self) -> bool {
        matches!(self, Self::Pedestrian | Self::Cyclist)
    }
}

/// Full dimensions of a box, metres.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Extent {
    /// Along the heading.
    pub length_m: f64,
    /// Across the heading.
    pub width_m: f64,
    /// Vertical.
    pub height_m: f64,
}

impl Extent {
    /// Ground rectangle of a box of this size centred at `center`.
    pub fn footprint(self, center: Pose2) -> Obb {
        Obb::new(center, self.length_m, self.width_m)
    }
}

/// An obstacle detected at one instant.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Obstacle {
    /// Identity if the source knows one (ground truth: the actor's).
    pub id: ActorId,
    /// Kind of the obstacle.
    pub kind: ActorKind,
    /// Pose of the footprint's centre in the map.
    pub pose: Pose2,
    /// Size.
    pub extent: Extent,
    /// Velocity over ground in the map frame, m/s.
    pub velocity_mps: Vector2,
    /// Share of its sample points that are visible to the sensor, 0 to 1.
    pub visible_share: f64,
}

/// All obstacles of a sensor or detector at one instant.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct ObstacleList {
    /// Instant of the measurement.
    pub stamp: Time,
    /// Ordered by identity.
    pub obstacles: Vec<Obstacle>,
}

/// One past position of a track.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Sighting {
    /// Instant of the sighting.
    pub at: Time,
    /// Position of the centre in the map.
    pub point: Point2,
}

/// An obstacle tracked over time.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Track {
    /// Stable identity.
    pub id: ActorId,
    /// Kind of the obstacle.
    pub kind: ActorKind,
    /// Present pose of the centre in the map.
    pub pose: Pose2,
    /// Size.
    pub extent: Extent,
    /// Reported or estimated velocity over ground, m/s.
    pub velocity_mps: Vector2,
    /// Past positions, oldest first; the last is the present one.
    pub history: Vec<Sighting>,
}

/// All live tracks.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TrackList {
    /// Instant that the tracks describe.
    pub stamp: Time,
    /// Ordered by identity.
    pub tracks: Vec<Track>,
}

/// Predicted pose at one instant.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct PredictedPose {
    /// Instant.
    pub at: Time,
    /// Pose of the centre in the map.
    pub pose: Pose2,
}

/// One possible future motion (mode) of a road user. All modes of a road user are adjacent in the list.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Prediction {
    /// Identity of the track.
    pub id: ActorId,
    /// Kind of the obstacle.
    pub kind: ActorKind,
    /// Size.
    pub extent: Extent,
    /// Probability of this path, 0 to 1. Those of all modes of a road user sum to 1.
    pub probability: f64,
    /// Poses at increasing instants; the first describes the stamp of the list. Never empty.
    pub path: Vec<PredictedPose>,
    /// Covariance of the centre in the map at each pose of the path: xx, xy, yy, m². Empty if the uncertainty is
    /// unknown.
    #[serde(default, serialize_with = "unless_default")]
    pub covariances_m2: Vec<[f64; 3]>,
}

/// Predicted motion of all tracks.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PredictionList {
    /// Instant of the newest sighting used.
    pub stamp: Time,
    /// Ordered by identity.
    pub predictions: Vec<Prediction>,
    /// True if the modes are known to be joint: mode `k` of one road user occurs with mode `k` of all others, and all have equally
    /// many modes. Probabilities remain those of each road user, since a bound on the collision probability sums over
    /// them.
    #[serde(default, serialize_with = "unless_default")]
    pub joint: bool,
}

/// Largest plausible variance of a predicted position, m²: a standard deviation of 10 km.
const VARIANCE_MAX_M2: f64 = 1e8;

impl Extent {
    fn is_plausible(&self) -> bool {
        [self.length_m, self.width_m, self.height_m].iter().all(|x| (0.0..=1e4).contains(x))
    }
}

impl Obstacle {
    /// Returns true if all values are finite and plausible on a road.
    pub fn is_plausible(&self) -> bool {
        is_plausible_place(&self.pose)
            && is_plausible_velocity(&self.velocity_mps)
            && self.extent.is_plausible()
    }
}

impl Track {
    /// As [`Obstacle::is_plausible`], including its history.
    pub fn is_plausible(&self) -> bool {
        let past = |sighting: &Sighting| {
            is_plausible_place(&Pose2::new(sighting.point.x_m, sighting.point.y_m, 0.0))
        };
        is_plausible_place(&self.pose)
            && is_plausible_velocity(&self.velocity_mps)
            && self.extent.is_plausible()
            && self.history.iter().all(past)
    }
}

impl PredictionList {
    /// Modes of one road user; empty if it is not predicted.
    pub fn modes_of(&self, id: ActorId) -> &[Prediction] {
        Prediction::by_actor(&self.predictions).find(|modes| modes[0].id == id).unwrap_or_default()
    }
}

impl Prediction {
    /// The only mode of a road user, without covariances.
    pub const fn single(id: ActorId, kind: ActorKind, extent: Extent, path: Vec<PredictedPose>) -> Self {
        Self { id, kind, extent, probability: 1.0, path, covariances_m2: Vec::new() }
    }

    /// Groups predictions to the modes of each road user, which are adjacent.
    pub fn by_actor(predictions: &[Self]) -> impl Iterator<Item = &[Self]> {
        predictions.chunk_by(|a, b| a.id == b.id)
    }

    /// The most probable of the modes of a road user; the first of equals.
    pub fn likeliest(modes: &[Self]) -> Option<&Self> {
        modes.iter().reduce(|best, mode| if mode.probability > best.probability { mode } else { best })
    }

    /// As [`Obstacle::is_plausible`], along the whole path. Covariances are finite and positive semidefinite, one for
    /// each pose, or missing.
    pub fn is_plausible(&self) -> bool {
        let is_covariance = |[xx, xy, yy]: &[f64; 3]| {
            [xx, yy].iter().all(|variance| (0.0..=VARIANCE_MAX_M2).contains(*variance)) && xy * xy <= xx * yy
        };
        !self.path.is_empty()
            && self.path.iter().all(|at| is_plausible_place(&at.pose))
            && self.extent.is_plausible()
            && (self.covariances_m2.is_empty() || self.covariances_m2.len() == self.path.len())
            && self.covariances_m2.iter().all(is_covariance)
    }

    /// Pose of the centre at `instant`: linear between the poses, constant before the first and after the last.
    pub fn pose_at(&self, instant: Time) -> Pose2 {
        let after = self.path.partition_point(|p| p.at <= instant);
        if after == 0 {
            return self.path[0].pose;
        }
        if after == self.path.len() {
            return self.path[after - 1].pose;
        }
        let (a, b) = (&self.path[after - 1], &self.path[after]);
        let t = (instant - a.at).as_secs() / (b.at - a.at).as_secs();
        let point = a.pose.point() + (b.pose.point() - a.pose.point()) * t;
        let turn = swerve_geom::angle_between(a.pose.heading_rad, b.pose.heading_rad);
        Pose2::new(point.x_m, point.y_m, a.pose.heading_rad + turn * t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(covariances_m2: Vec<[f64; 3]>) -> PredictionList {
        let path = (0..2)
            .map(|k| PredictedPose { at: Time::from_ms(100 * k), pose: Pose2::new(k as f64, 0.0, 0.0) });
        let extent = Extent { length_m: 4.5, width_m: 1.8, height_m: 1.5 };
        let one = Prediction::single(ActorId(7), ActorKind::Car, extent, path.collect());
        PredictionList {
            stamp: Time::ZERO,
            predictions: vec![Prediction { covariances_m2, ..one }],
            joint: false,
        }
    }

    /// The message of earlier versions: without covariances and joint modes.
    #[derive(Serialize)]
    struct Earlier {
        stamp: Time,
        predictions: Vec<EarlierPrediction>,
    }

    #[derive(Serialize)]
    struct EarlierPrediction {
        id: ActorId,
        kind: ActorKind,
        extent: Extent,
        probability: f64,
        path: Vec<PredictedPose>,
    }

    #[test]
    fn list_without_covariances_has_the_digest_of_earlier_versions_and_reads_their_logs() {
        let now = list(Vec::new());
        let of = |one: &Prediction| EarlierPrediction {
            id: one.id,
            kind: one.kind,
            extent: one.extent,
            probability: one.probability,
            path: one.path.clone(),
        };
        let earlier = Earlier { stamp: now.stamp, predictions: now.predictions.iter().map(of).collect() };
        assert_eq!(swerve_core::digest_of(&now), swerve_core::digest_of(&earlier));
        let mut cbor = Vec::new();
        ciborium::into_writer(&earlier, &mut cbor).unwrap();
        assert_eq!(ciborium::from_reader::<PredictionList, _>(&cbor[..]).unwrap(), now);
    }

    #[test]
    fn covariances_are_read_back_and_change_the_digest() {
        let with = list(vec![[0.1, 0.0, 0.1], [0.4, 0.1, 0.2]]);
        let mut cbor = Vec::new();
        ciborium::into_writer(&with, &mut cbor).unwrap();
        assert_eq!(ciborium::from_reader::<PredictionList, _>(&cbor[..]).unwrap(), with);
        assert_ne!(swerve_core::digest_of(&with), swerve_core::digest_of(&list(Vec::new())));
    }

    #[test]
    fn implausible_covariances_are_found() {
        let is_plausible = |covariances_m2: Vec<[f64; 3]>| list(covariances_m2).predictions[0].is_plausible();
        assert!(is_plausible(vec![]) && is_plausible(vec![[0.0; 3], [0.4, 0.1, 0.2]]));
        for wrong in
            [[f64::NAN, 0.0, 1.0], [-0.1, 0.0, 1.0], [1.0, f64::NAN, 1.0], [1.0, 1.1, 1.0], [1e9, 0.0, 1.0]]
        {
            assert!(!is_plausible(vec![[0.0; 3], wrong]), "{wrong:?}");
        }
        assert!(!is_plausible(vec![[0.0; 3]]), "one for two poses");
    }
}
