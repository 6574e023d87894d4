//! Detections of one sensor.

use swerve_geom::{Map, Pose2};
use swerve_msg::{Detections, Image};

use crate::image_box::ImageCamera;

/// Detections of one instant, and the ego's pose then.
#[derive(Clone, Copy, Debug)]
pub struct Sighted<'a> {
    /// Boxes in the ego frame.
    pub found: &'a Detections,
    /// Ego pose at their stamp.
    pub ego: Pose2<Map>,
    /// True if no earlier list contained them.
    pub is_new: bool,
}

/// Detections of a camera, and its calibration.
#[derive(Clone, Copy, Debug)]
pub struct CameraSight<'a> {
    /// Boxes with their image boxes.
    pub boxes: Sighted<'a>,
    /// Camera of the image boxes.
    pub camera: ImageCamera,
    /// Depth image (distance along the optical axis) at the same stamp, for example from stereo.
    pub depth: Option<&'a Image>,
}
