//! Viewpoints: the camera at the instant of a sub-frame.

use core::ops::Range;

use swerve_geom::{Map, Transform};

use super::pinhole::{Frustum, Pinhole};
use super::pose::pose_after;
use super::sub_frame::SubFrame;
use crate::View;

/// Camera at the instant of a sub-frame.
pub(crate) struct Viewpoint {
    pub(crate) map_from_camera: Transform<Map, swerve_geom::Camera>,
    pub(crate) camera_from_map: Transform<swerve_geom::Camera, Map>,
    pub(crate) image: Pinhole,
    /// Rows of the image that are rendered.
    pub(crate) rows: Range<usize>,
    pub(crate) frustum: Frustum,
}

impl Viewpoint {
    /// Viewpoint of a sub-frame; `lens` is the pinhole image behind the camera's lens, if any, which is rendered
    /// completely.
    pub(crate) fn new(view: &View<'_>, sub_frame: &SubFrame, lens: Option<Pinhole>) -> Self {
        let image = lens.unwrap_or_else(|| Pinhole::new(view.camera)).shifted(sub_frame.offset());
        let rows = if lens.is_some() { 0..image.height } else { sub_frame.rows.clone() };
        let map_from_camera = pose_after(&view.map_from_camera, &view.motion, sub_frame.at_s);
        let frustum = Frustum::new(&image, &rows);
        Self { map_from_camera, camera_from_map: map_from_camera.inverse(), image, rows, frustum }
    }
}
