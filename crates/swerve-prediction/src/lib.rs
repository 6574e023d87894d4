//! Prediction of the motion of road users from their tracks.
//!
//! [`History`] stores the past sightings of each obstacle and provides tracks; [`linear`] extrapolates tracks to
//! time-indexed predictions, which [`road`] bends along the road; [`predict`] has further predictors, with several
//! modes, on open ground, a road or a lane map; [`recorded`] reads recorded tracks for evaluation. All poses are in the map frame and refer to the centre of a footprint. Excluded: engine,
//! simulator, files, clocks; time is given by stamps only.

mod filter;
mod history;
mod lane_following;
pub mod learned;
pub mod linear;
mod net;
mod past;
mod predictor;
pub mod recorded;
pub mod road;
mod wander;

pub use history::{History, HistoryParams};
pub use lane_following::LaneFollowing;
pub use predictor::{
    Ground, Horizon, Predictor, PredictorName, Telling, Told, foretold, predict, predict_by, shipped,
};
