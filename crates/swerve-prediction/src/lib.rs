//! From what was seen to what will happen.
//!
//! [`History`] keeps the past sightings of each obstacle and hands out tracks; [`linear`] turns tracks into
//! time-indexed predictions, which [`road`] bends as the road does; [`forecast`] has more predictors, whose forecasts have
//! modes and spreads; [`lanes`] is what vehicles keep to; [`recorded`] reads recorded tracks to judge them by. All poses
//! are in the map frame and describe the centre of a footprint.
//! Absences: no engine, no simulator, no files, no clock: time is what the stamps say.

mod filter;
mod history;
mod idm;
pub mod lanes;
pub mod learned;
pub mod linear;
mod net;
mod past;
mod predictor;
pub mod recorded;
pub mod road;

pub use history::{History, HistoryParams};
pub use predictor::{
    Ground, Horizon, PredictorName, Telling, Told, forecast, forecast_by, foretold, shipped,
};
