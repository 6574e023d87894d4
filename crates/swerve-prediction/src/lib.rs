//! From what was seen to what will happen.
//!
//! [`History`] keeps the past sightings of each obstacle and hands out tracks; [`linear`] turns tracks into
//! time-indexed predictions, which [`road`] bends as the road does. All poses are in the map frame and describe the centre of a footprint.
//! Absences: no engine, no simulator, no files, no clock: time is what the stamps say.

mod history;
pub mod linear;
pub mod road;

pub use history::{History, HistoryParams};
