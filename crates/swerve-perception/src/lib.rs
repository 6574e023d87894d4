//! Perception: an emulated detector, objects from lidar, and trackers.
//!
//! [`detector`] takes what a sensor could see (truth) and makes of it what a detector of a given accuracy would have
//! reported: boxes in the ego frame and in the image, some missed, some wrong, some of nothing. [`tracker`] and
//! [`ab3dmot`] make tracks of such boxes on the ground, [`image_plane`] in the image. [`lidar`] makes boxes of the points of a lidar, without
//! neural networks, and [`fusion`] makes one list of those of several sensors.
//!
//! Absences: no engine, no simulator, no file, no clock; how long a detector takes is for the caller.

pub mod ab3dmot;
pub mod assignment;
mod axis;
mod bound;
pub mod detector;
pub mod fusion;
mod ground_tracker;
pub mod image_box;
pub mod image_plane;
pub mod lidar;
pub mod tracker;
mod validate;

pub use ab3dmot::Ab3dMot;
pub use detector::Detector;
pub use ground_tracker::{Algorithm, GroundParams, GroundTracker};
pub use lidar::LidarObjects;
pub use tracker::Tracker;
