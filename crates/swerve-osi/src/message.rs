//! Messages of OSI with the fields that are written. All fields are optional in OSI; `None` is "not known".

use prost::Message;

/// `osi3.GroundTruth`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct GroundTruth {
    #[prost(message, optional, tag = "1")]
    pub(crate) version: Option<InterfaceVersion>,
    #[prost(message, optional, tag = "2")]
    pub(crate) timestamp: Option<Timestamp>,
    #[prost(message, optional, tag = "3")]
    pub(crate) host_vehicle_id: Option<Identifier>,
    #[prost(message, repeated, tag = "4")]
    pub(crate) stationary_object: Vec<StationaryObject>,
    #[prost(message, repeated, tag = "5")]
    pub(crate) moving_object: Vec<MovingObject>,
    #[prost(message, repeated, tag = "7")]
    pub(crate) traffic_light: Vec<TrafficLight>,
    #[prost(message, repeated, tag = "9")]
    pub(crate) lane_boundary: Vec<LaneBoundary>,
    #[prost(message, repeated, tag = "10")]
    pub(crate) lane: Vec<Lane>,
}

/// `osi3.InterfaceVersion`.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct InterfaceVersion {
    #[prost(uint32, optional, tag = "1")]
    pub(crate) version_major: Option<u32>,
    #[prost(uint32, optional, tag = "2")]
    pub(crate) version_minor: Option<u32>,
    #[prost(uint32, optional, tag = "3")]
    pub(crate) version_patch: Option<u32>,
}

/// `osi3.Timestamp`.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct Timestamp {
    #[prost(int64, optional, tag = "1")]
    pub(crate) seconds: Option<i64>,
    #[prost(uint32, optional, tag = "2")]
    pub(crate) nanos: Option<u32>,
}

/// `osi3.Identifier`.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct Identifier {
    #[prost(uint64, optional, tag = "1")]
    pub(crate) value: Option<u64>,
}

/// `osi3.Vector3d`.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct Vector3d {
    #[prost(double, optional, tag = "1")]
    pub(crate) x: Option<f64>,
    #[prost(double, optional, tag = "2")]
    pub(crate) y: Option<f64>,
    #[prost(double, optional, tag = "3")]
    pub(crate) z: Option<f64>,
}

/// `osi3.Dimension3d`, metres.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct Dimension3d {
    #[prost(double, optional, tag = "1")]
    pub(crate) length: Option<f64>,
    #[prost(double, optional, tag = "2")]
    pub(crate) width: Option<f64>,
    #[prost(double, optional, tag = "3")]
    pub(crate) height: Option<f64>,
}

/// `osi3.Orientation3d`, radians: yaw, then pitch, then roll.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct Orientation3d {
    #[prost(double, optional, tag = "1")]
    pub(crate) roll: Option<f64>,
    #[prost(double, optional, tag = "2")]
    pub(crate) pitch: Option<f64>,
    #[prost(double, optional, tag = "3")]
    pub(crate) yaw: Option<f64>,
}

/// `osi3.BaseMoving`.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct BaseMoving {
    #[prost(message, optional, tag = "1")]
    pub(crate) dimension: Option<Dimension3d>,
    #[prost(message, optional, tag = "2")]
    pub(crate) position: Option<Vector3d>,
    #[prost(message, optional, tag = "3")]
    pub(crate) orientation: Option<Orientation3d>,
    #[prost(message, optional, tag = "4")]
    pub(crate) velocity: Option<Vector3d>,
    #[prost(message, optional, tag = "5")]
    pub(crate) acceleration: Option<Vector3d>,
    #[prost(message, optional, tag = "6")]
    pub(crate) orientation_rate: Option<Orientation3d>,
}

/// `osi3.BaseStationary`.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct BaseStationary {
    #[prost(message, optional, tag = "1")]
    pub(crate) dimension: Option<Dimension3d>,
    #[prost(message, optional, tag = "2")]
    pub(crate) position: Option<Vector3d>,
    #[prost(message, optional, tag = "3")]
    pub(crate) orientation: Option<Orientation3d>,
}

/// `osi3.MovingObject`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct MovingObject {
    #[prost(message, optional, tag = "1")]
    pub(crate) id: Option<Identifier>,
    #[prost(message, optional, tag = "2")]
    pub(crate) base: Option<BaseMoving>,
    #[prost(int32, optional, tag = "3")]
    pub(crate) r#type: Option<i32>,
    #[prost(message, optional, tag = "5")]
    pub(crate) vehicle_attributes: Option<VehicleAttributes>,
    #[prost(message, optional, tag = "6")]
    pub(crate) vehicle_classification: Option<VehicleClassification>,
}

/// `osi3.MovingObject.VehicleAttributes`.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct VehicleAttributes {
    #[prost(double, optional, tag = "2")]
    pub(crate) radius_wheel: Option<f64>,
    #[prost(uint32, optional, tag = "3")]
    pub(crate) number_wheels: Option<u32>,
    #[prost(message, optional, tag = "4")]
    pub(crate) bbcenter_to_rear: Option<Vector3d>,
    #[prost(message, optional, tag = "5")]
    pub(crate) bbcenter_to_front: Option<Vector3d>,
}

/// `osi3.MovingObject.VehicleClassification`.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct VehicleClassification {
    #[prost(int32, optional, tag = "1")]
    pub(crate) r#type: Option<i32>,
}

/// `osi3.StationaryObject`.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct StationaryObject {
    #[prost(message, optional, tag = "1")]
    pub(crate) id: Option<Identifier>,
    #[prost(message, optional, tag = "2")]
    pub(crate) base: Option<BaseStationary>,
    #[prost(message, optional, tag = "3")]
    pub(crate) classification: Option<StationaryClassification>,
}

/// `osi3.StationaryObject.Classification`.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct StationaryClassification {
    #[prost(int32, optional, tag = "1")]
    pub(crate) r#type: Option<i32>,
}

/// `osi3.TrafficLight`: one bulb.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct TrafficLight {
    #[prost(message, optional, tag = "1")]
    pub(crate) id: Option<Identifier>,
    #[prost(message, optional, tag = "2")]
    pub(crate) base: Option<BaseStationary>,
    #[prost(message, optional, tag = "3")]
    pub(crate) classification: Option<TrafficLightClassification>,
}

/// `osi3.TrafficLight.Classification`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct TrafficLightClassification {
    #[prost(int32, optional, tag = "1")]
    pub(crate) color: Option<i32>,
    #[prost(int32, optional, tag = "2")]
    pub(crate) icon: Option<i32>,
    #[prost(int32, optional, tag = "3")]
    pub(crate) mode: Option<i32>,
    #[prost(message, repeated, tag = "5")]
    pub(crate) assigned_lane_id: Vec<Identifier>,
}

/// `osi3.LaneBoundary`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct LaneBoundary {
    #[prost(message, optional, tag = "1")]
    pub(crate) id: Option<Identifier>,
    #[prost(message, repeated, tag = "2")]
    pub(crate) boundary_line: Vec<BoundaryPoint>,
    #[prost(message, optional, tag = "3")]
    pub(crate) classification: Option<BoundaryClassification>,
}

/// `osi3.LaneBoundary.BoundaryPoint`.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct BoundaryPoint {
    #[prost(message, optional, tag = "1")]
    pub(crate) position: Option<Vector3d>,
    #[prost(double, optional, tag = "2")]
    pub(crate) width: Option<f64>,
}

/// `osi3.LaneBoundary.Classification`.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct BoundaryClassification {
    #[prost(int32, optional, tag = "1")]
    pub(crate) r#type: Option<i32>,
    #[prost(int32, optional, tag = "2")]
    pub(crate) color: Option<i32>,
}

/// `osi3.Lane`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct Lane {
    #[prost(message, optional, tag = "1")]
    pub(crate) id: Option<Identifier>,
    #[prost(message, optional, tag = "2")]
    pub(crate) classification: Option<LaneClassification>,
}

/// `osi3.Lane.Classification`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct LaneClassification {
    #[prost(int32, optional, tag = "1")]
    pub(crate) r#type: Option<i32>,
    #[prost(message, repeated, tag = "3")]
    pub(crate) centerline: Vec<Vector3d>,
    #[prost(bool, optional, tag = "4")]
    pub(crate) centerline_is_driving_direction: Option<bool>,
    #[prost(message, repeated, tag = "5")]
    pub(crate) left_adjacent_lane_id: Vec<Identifier>,
    #[prost(message, repeated, tag = "6")]
    pub(crate) right_adjacent_lane_id: Vec<Identifier>,
    #[prost(message, repeated, tag = "7")]
    pub(crate) lane_pairing: Vec<LanePairing>,
    #[prost(message, repeated, tag = "8")]
    pub(crate) right_lane_boundary_id: Vec<Identifier>,
    #[prost(message, repeated, tag = "9")]
    pub(crate) left_lane_boundary_id: Vec<Identifier>,
    #[prost(int32, optional, tag = "12")]
    pub(crate) subtype: Option<i32>,
}

/// `osi3.Lane.Classification.LanePairing`.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct LanePairing {
    #[prost(message, optional, tag = "1")]
    pub(crate) antecessor_lane_id: Option<Identifier>,
    #[prost(message, optional, tag = "2")]
    pub(crate) successor_lane_id: Option<Identifier>,
}

impl Identifier {
    pub(crate) fn new(value: u64) -> Option<Self> {
        Some(Self { value: Some(value) })
    }
}

impl Vector3d {
    pub(crate) fn new([x, y, z]: [f64; 3]) -> Self {
        Self { x: Some(x), y: Some(y), z: Some(z) }
    }
}

impl Orientation3d {
    pub(crate) fn new([roll, pitch, yaw]: [f64; 3]) -> Self {
        Self { roll: Some(roll), pitch: Some(pitch), yaw: Some(yaw) }
    }
}

impl Dimension3d {
    pub(crate) fn new([length, width, height]: [f64; 3]) -> Self {
        Self { length: Some(length), width: Some(width), height: Some(height) }
    }
}
