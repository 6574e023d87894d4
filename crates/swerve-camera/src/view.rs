//! Views: a camera with a pose.

use swerve_geom::{Map, Transform};
use swerve_scene::Motion;

use crate::Camera;

/// Camera with a pose.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Camera of the view.
    pub camera: &'a Camera,
    /// Pose of the camera's optical axes: see [`crate::mount`].
    pub map_from_camera: Transform<Map, swerve_geom::Camera>,
    /// Motion of the camera, for blur and rolling shutter.
    pub motion: Motion,
    /// Frame number: key of the sensor noise and of the rain.
    pub frame: u64,
    /// Instance id invisible to this camera (its shadow remains): the vehicle that carries it.
    pub hidden_instance: Option<u32>,
}

impl<'a> View<'a> {
    /// View at rest without a hidden instance.
    pub fn new(camera: &'a Camera, map_from_camera: Transform<Map, swerve_geom::Camera>) -> Self {
        Self { camera, map_from_camera, motion: Motion::default(), frame: 0, hidden_instance: None }
    }
}
