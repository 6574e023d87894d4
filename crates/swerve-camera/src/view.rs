//! Views: one camera at one place.

use swerve_geom::{Map, Transform};
use swerve_scene::Motion;

use crate::Camera;

/// A camera at a place.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Through which camera.
    pub camera: &'a Camera,
    /// From where: optical axes, see [`crate::mount`].
    pub map_from_camera: Transform<Map, swerve_geom::Camera>,
    /// How the camera moves, for blur and rolling shutter.
    pub motion: Motion,
    /// Number of the frame: keys the noise of the sensor and the rain.
    pub frame: u64,
    /// The instance id that this camera does not see (its shadow stays): the vehicle that carries it.
    pub hidden_instance: Option<u32>,
}

impl<'a> View<'a> {
    /// A view at rest that hides nothing.
    pub fn new(camera: &'a Camera, map_from_camera: Transform<Map, swerve_geom::Camera>) -> Self {
        Self { camera, map_from_camera, motion: Motion::default(), frame: 0, hidden_instance: None }
    }
}
