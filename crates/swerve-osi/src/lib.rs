//! Converts the states of the world to `osi3.GroundTruth` messages of the ASAM Open Simulation Interface (OSI)
//! 3.8.0 (<https://opensimulationinterface.github.io/osi-antora-generator/>), to be stored in the log of the run.
//!
//! [`GroundTruthViews`] observes a run. For each state of the world it logs one message on the topic
//! `/osi/ground_truth`: moving and stationary objects and traffic lights; the first message also has the lanes and
//! their boundaries. Channel and file have the metadata of OSI's multi-channel trace files, so that programs for these
//! read the log. Positions and angles are those of the map: metres and radians, x, y and z right-handed, z up. The
//! position of an object is the centre of its box.
//!
//! Contains the messages and fields of OSI that Swerve can fill, written for this crate: no file, no clock, no reader
//! of OSI, no sensor messages (`SensorView`, `SensorData`), no road marks, no traffic signs, no occupants.

mod lane;
mod message;
mod schema;
mod truth;
mod views;

pub use views::{GroundTruthViews, Light, Setup};
