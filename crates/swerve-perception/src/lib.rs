//! Perception: an emulated detector, object detection from camera and lidar, sensor fusion, and trackers.
//!
//! [`detector`] converts ground truth visible to a sensor into the output of a detector of a given accuracy: boxes in
//! the ego frame and in the image, with misses, errors and false positives. Without neural networks, [`camera`] detects
//! objects in camera images and [`lidar`] in lidar point clouds, and [`fusion`] merges the boxes of several sensors.
//! [`tracker`] and [`ab3dmot`] track boxes on the ground, [`image_plane`] in the image.
//!
//! Does not depend on the engine, the simulator, files or clocks; the run time of a detector is modelled by the caller.

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
pub use ground_tracker::GroundTracker;
pub use lidar::LidarObjects;
pub use tracker::Tracker;
pub use traffic_lights::LightWatch;
