//! The plain messages on the edges between operators.
//!
//! Units are SI, angles radians; planar poses are in the map frame unless the field says otherwise. What the
//! simulator alone can know is in [`truth`]; only evaluation and operators named `truth_*` read it.
//! Absences: no behaviour beyond small accessors, no engine, no file format.

mod actuation;
mod ego;
mod obstacle;
mod plan;
mod route;
pub mod truth;

pub use actuation::Command;
pub use ego::{EgoState, Gnss, Imu};
pub use obstacle::{
    ActorId, ActorKind, Extent, Obstacle, ObstacleList, PredictedPose, Prediction, PredictionList, Sighting,
    Track, TrackList,
};
pub use plan::{Plan, PlanPoint, PlanStatus};
pub use route::Route;
