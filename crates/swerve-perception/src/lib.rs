//! Perception: an emulated detector, objects from lidar, and a tracker.
//!
//! [`detector`] takes what a sensor could see (truth) and makes of it what a detector of a given accuracy would have
//! reported: boxes in the ego frame and in the image, some missed, some wrong, some of nothing. [`tracker`] makes
//! tracks of such boxes on the ground, [`image_plane`] in the image. Without neural networks [`camera`] makes boxes of
//! the images of a camera, [`lidar`] of the points of a lidar.
//!
//! Absences: no engine, no simulator, no file, no clock; how long a detector takes is for the caller.

pub mod assignment;
pub mod camera;
pub mod detector;
pub mod image_box;
pub mod image_plane;
pub mod lidar;
mod road;
pub mod tracker;
mod validate;

pub use camera::CameraObjects;
pub use detector::Detector;
pub use lidar::LidarObjects;
pub use tracker::Tracker;
