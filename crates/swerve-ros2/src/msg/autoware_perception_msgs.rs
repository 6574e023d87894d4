//! `autoware_perception_msgs`, and the identifier of `unique_identifier_msgs` inside them.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::builtin_interfaces::Duration;
use super::geometry_msgs::{
    AccelWithCovariance, Polygon, Pose, PoseWithCovariance, TwistWithCovariance, Vector3,
};
use super::std_msgs::Header;

/// Sixteen bytes that name a thing.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct UUID {
    pub uuid: [u8; 16],
}

/// What it may be, and how likely.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct ObjectClassification {
    pub label: u8,
    pub probability: f32,
}

impl ObjectClassification {
    pub const UNKNOWN: u8 = 0;
    pub const CAR: u8 = 1;
    pub const TRUCK: u8 = 2;
    pub const BUS: u8 = 3;
    pub const TRAILER: u8 = 4;
    pub const MOTORCYCLE: u8 = 5;
    pub const BICYCLE: u8 = 6;
    pub const PEDESTRIAN: u8 = 7;
    pub const OVER_DRIVABLE: u8 = 10;
    pub const UNDER_DRIVABLE: u8 = 11;
}

/// One way that it may go: poses at equal steps of time from now.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PredictedPath {
    pub path: Vec<Pose>,
    pub time_step: Duration,
    pub confidence: f32,
}

/// How it moves now, and how it may go on.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PredictedObjectKinematics {
    pub initial_pose_with_covariance: PoseWithCovariance,
    pub initial_twist_with_covariance: TwistWithCovariance,
    pub initial_acceleration_with_covariance: AccelWithCovariance,
    pub predicted_paths: Vec<PredictedPath>,
}

/// Its outline: full size of a box, or diameter of a cylinder in `x` and `y`, or a footprint.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Shape {
    #[serde(rename = "type")]
    pub type_: u8,
    pub footprint: Polygon,
    pub dimensions: Vector3,
}

impl Shape {
    pub const BOUNDING_BOX: u8 = 0;
    pub const CYLINDER: u8 = 1;
    pub const POLYGON: u8 = 2;
}

/// One thing.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PredictedObject {
    pub object_id: UUID,
    pub existence_probability: f32,
    pub classification: Vec<ObjectClassification>,
    pub kinematics: PredictedObjectKinematics,
    pub shape: Shape,
}

/// All things; poses are of the centres of their boxes.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PredictedObjects {
    pub header: Header,
    pub objects: Vec<PredictedObject>,
}
