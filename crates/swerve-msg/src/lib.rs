//! Plain messages on the edges between operators.
//!
//! Units are SI, angles are in radians; planar poses are in the map frame unless the field states otherwise. Ground
//! truth of the simulator is in [`truth`]; only evaluation, visualisation and emulated detectors read it. Contains
//! no behaviour beyond small accessors, no engine and no file format.

mod actuation;
pub mod block;
mod closure;
mod deadline;
mod decision;
mod detection;
mod ego;
mod event;
mod gate;
mod health;
mod image;
mod lane;
mod localization;
mod obstacle;
mod odometry;
mod packed;
mod plan;
mod point_cloud;
mod radar;
mod supervision;
mod traffic_light;
pub mod truth;

pub use actuation::{Command, MotionCommand};
pub use closure::Closures;
pub use deadline::{ResponseBudget, RungTaken};
pub use decision::{Decision, Driving, DrivingState, ExpectedStop, SpeedLimit, StopPoint, StopReason};
pub use detection::{DetectedBox, Detections};
pub use ego::{EgoState, Gnss, Imu};
pub use event::{
    CollisionEvent, CollisionEvents, FaultInjection, LaneInvasion, LaneInvasions, RedLightEvent,
    RedLightEvents, RoadLine, Side, Signal,
};
pub use gate::{
    GateMode, GateOutput, Longitudinal, Refusal, Refusals, StopCause, Switch, VehicleReport, WireAlarm,
};
pub use health::SensorHealth;
pub use image::{CameraInfo, Encoding, Image, ImageError, Intrinsics, Pixels};
pub use lane::{LaneLine, Lanes};
pub use localization::{LocalPose, PoseMatch, PoseMode, PoseQuality};
pub use obstacle::{
    ActorId, ActorKind, ActorNames, Extent, Obstacle, ObstacleList, PredictedPose, Prediction,
    PredictionList, Sighting, Track, TrackList,
};
pub use odometry::WheelOdometry;
pub use packed::{Packable, Packed};
pub use plan::{Plan, PlanPoint, PlanStatus};
pub use point_cloud::{LidarPoint, PointCloud, PointCloudError};
pub use radar::{RadarDetection, RadarScan};
pub use supervision::{GoneProcess, Supervision};
pub use swerve_map::Route;
pub use traffic_light::{TrafficLight, TrafficLights};
