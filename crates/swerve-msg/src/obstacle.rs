//! Obstacles, tracks and predictions.

use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::{Obb, Point2, Pose2, Vector2};

use crate::ego::{is_plausible_place, is_plausible_velocity};

/// Identifies an actor or a track within one run.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ActorId(pub u32);

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

/// Predicted motion of one obstacle.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Prediction {
    /// Identity of the track.
    pub id: ActorId,
    /// Kind of the obstacle.
    pub kind: ActorKind,
    /// Size.
    pub extent: Extent,
    /// Probability of this path, 0 to 1.
    pub probability: f64,
    /// Poses at increasing instants; the first describes the stamp of the list. Never empty.
    pub path: Vec<PredictedPose>,
}

/// Predicted motion of all tracks.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PredictionList {
    /// Instant of the newest sighting used.
    pub stamp: Time,
    /// Ordered by identity.
    pub predictions: Vec<Prediction>,
}

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

impl Prediction {
    /// As [`Obstacle::is_plausible`], along the whole path.
    pub fn is_plausible(&self) -> bool {
        !self.path.is_empty()
            && self.path.iter().all(|at| is_plausible_place(&at.pose))
            && self.extent.is_plausible()
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
