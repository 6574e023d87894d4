//! Constraint of a flat road on object positions in the image.

use core::ops::Range;

/// Camera above flat ground: the ratio of an object's image height to the distance of its foot below the horizon equals
/// the ratio of its height to the camera's.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Ground {
    /// Image row of the horizon, pixels.
    pub horizon_px: f64,
    /// Focal length, pixels.
    pub focal_px: f64,
    /// Height of the camera above the ground, metres.
    pub height_m: f64,
}

impl Ground {
    /// Range of image rows for the foot of an object whose box is this high, for object heights between two bounds and
    /// a horizon uncertain by `tolerance_rad` in either direction.
    pub fn foot_rows(&self, box_px: f64, heights_m: [f64; 2], tolerance_rad: f64) -> Range<f64> {
        let off_px = tolerance_rad * self.focal_px;
        let below = heights_m.map(|height_m| box_px * self.height_m / height_m);
        self.horizon_px + below[1] - off_px..self.horizon_px + below[0] + off_px
    }
}
