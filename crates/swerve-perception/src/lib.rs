//! Perception: an emulated detector, objects from lidar, and trackers.
//!
//! [`detector`] takes what a sensor could see (truth) and makes of it what a detector of a given accuracy would have
//! reported: boxes in the ego frame and in the image, some missed, some wrong, some of nothing. Without neural networks
//! [`camera`] makes boxes of the images of a camera, [`lidar`] of the points of a lidar, and [`fusion`] makes one list of
//! those of several sensors. [`tracker`] and [`ab3dmot`] make tracks of boxes on the ground, [`image_plane`] in the image.
//!
//! Absences: no engine, no simulator, no file, no clock; how long a detector takes is for the caller.

pub mod ab3dmot;
pub mod assignment;
mod axis;
mod bound;
pub mod camera;
pub mod detector;
pub mod fusion;
mod ground_tracker;
pub mod image_box;
pub mod image_plane;
pub mod lidar;
mod road;
pub mod tracker;
pub mod traffic_lights;

pub use ab3dmot::Ab3dMot;
pub use camera::CameraObjects;
pub use detector::Detector;
pub use ground_tracker::{Algorithm, GroundParams, GroundTracker};
pub use lidar::LidarObjects;
pub use tracker::Tracker;
pub use traffic_lights::LightWatch;
