//! `autoware_perception_msgs`, and `UUID` of `unique_identifier_msgs`.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::builtin_interfaces::Duration;
use super::geometry_msgs::{
    AccelWithCovariance, Polygon, Pose, PoseWithCovariance, TwistWithCovariance, Vector3, pose, twist,
};
use super::std_msgs::Header;
use crate::check::parts::frame;
use crate::check::{Check, Invalid, within};

/// Identifier of an object.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct UUID {
    pub uuid: [u8; 16],
}

/// Possible class of an object, with its probability.
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

/// One predicted path: poses at equal time steps from now.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PredictedPath {
    pub path: Vec<Pose>,
    pub time_step: Duration,
    pub confidence: f32,
}

/// Present motion and predicted paths.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PredictedObjectKinematics {
    pub initial_pose_with_covariance: PoseWithCovariance,
    pub initial_twist_with_covariance: TwistWithCovariance,
    pub initial_acceleration_with_covariance: AccelWithCovariance,
    pub predicted_paths: Vec<PredictedPath>,
}

/// Outline: dimensions of a box, diameter of a cylinder in `x` and `y`, or a footprint.
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

/// One object.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PredictedObject {
    pub object_id: UUID,
    pub existence_probability: f32,
    pub classification: Vec<ObjectClassification>,
    pub kinematics: PredictedObjectKinematics,
    pub shape: Shape,
}

/// All objects; poses are those of the box centres.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PredictedObjects {
    pub header: Header,
    pub objects: Vec<PredictedObject>,
}

impl Check for PredictedObjects {
    fn check(&self) -> Result<(), Invalid> {
        frame("header.frame_id", &self.header.frame_id)?;
        for (i, object) in self.objects.iter().enumerate() {
            let at = |part: &str| format!("objects[{i}].{part}");
            within(&at("existence_probability"), f64::from(object.existence_probability), 0.0, 1.0)?;
            for label in &object.classification {
                within(&at("classification.label"), f64::from(label.label), 0.0, 11.0)?;
                within(&at("classification.probability"), f64::from(label.probability), 0.0, 1.0)?;
            }
            let kinematics = &object.kinematics;
            pose(
                &at("kinematics.initial_pose_with_covariance.pose"),
                &kinematics.initial_pose_with_covariance.pose,
            )?;
            twist(
                &at("kinematics.initial_twist_with_covariance.twist"),
                &kinematics.initial_twist_with_covariance.twist,
            )?;
            for path in &kinematics.predicted_paths {
                within(&at("kinematics.predicted_paths.confidence"), f64::from(path.confidence), 0.0, 1.0)?;
                for one in &path.path {
                    pose(&at("kinematics.predicted_paths.path"), one)?;
                }
            }
            within(&at("shape.type"), f64::from(object.shape.type_), 0.0, 2.0)?;
            let size = &object.shape.dimensions;
            for (axis, v) in [("x", size.x), ("y", size.y), ("z", size.z)] {
                within(&at(&format!("shape.dimensions.{axis}")), v, 0.0, 1000.0)?;
            }
        }
        Ok(())
    }
}
