//! Properties of a run that its views need.

use std::sync::Arc;

use swerve_core::Span;
use swerve_geom::{Ego, Transform};
use swerve_map::{Border, Map};
use swerve_msg::{ActorNames, Route};
use swerve_vehicle::Shape;

use crate::cloud::Sensor;

/// Properties that are constant during a run.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Route of the ego.
    pub route: Route,
    /// Lines of the road within the drivable ground: metres to the left of the route at each arc length.
    pub lines_m: Vec<Border>,
    /// Map that the road is part of; `None` if the lines above are all there are.
    pub map: Option<Arc<Map>>,
    /// Shape of the ego.
    pub shape: Shape,
    /// Time from a command to its effect.
    pub dead_time: Span,
    /// Sensors with a mounting pose.
    pub mounts: Vec<Mount>,
    /// Encoding of colour images; `None` omits images and point clouds.
    pub images: Option<ImageForm>,
    /// True to publish depth and class images too, uncompressed.
    pub raw_images: bool,
    /// Detectors of boxes in images, and their cameras.
    pub detectors: Vec<(String, String)>,
    /// Names of the actors, as far as they are known.
    pub actors: Arc<ActorNames>,
    /// Names of the road users by the identity of their tracks, as far as they are known.
    pub tracks: Arc<ActorNames>,
    /// True to take the ego's pose from localization, for runs without ground truth.
    pub ego_from_pose: bool,
}

/// Mounting pose of a sensor.
#[derive(Clone, Debug)]
pub struct Mount {
    pub(crate) name: String,
    pub(crate) ego_from_sensor: Transform<Ego, Sensor>,
}

impl Mount {
    /// Mounting pose of a sensor, given by its operator's name; its messages are in its own axes.
    pub fn new<F>(name: &str, ego_from_sensor: Transform<Ego, F>) -> Self {
        let ego_from_sensor = Transform::new(ego_from_sensor.origin(), ego_from_sensor.rotation());
        Self { name: name.into(), ego_from_sensor }
    }
}

/// Encoding of colour images.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ImageForm {
    /// JPEG with this quality, 1 to 100.
    Jpeg(u8),
    /// PNG, lossless.
    Png,
}
