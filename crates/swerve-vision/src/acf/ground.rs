//! What a flat road tells of where objects can be.

use core::ops::Range;

/// A camera above flat ground: an object that stands there is as high in the image as its foot is below the horizon,
/// times its height over the camera's.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Ground {
    /// Row of the horizon.
    pub horizon_px: f64,
    /// Pixels of a radian at the horizon: the focal length.
    pub focal_px: f64,
    /// Of the camera above the ground.
    pub height_m: f64,
}

impl Ground {
    /// Rows where the foot can be of a box this high, if what is in it is between two heights and the horizon may be
    /// off by an angle, either way.
    pub fn foot_rows(&self, box_px: f64, heights_m: [f64; 2], tolerance_rad: f64) -> Range<f64> {
        let off_px = tolerance_rad * self.focal_px;
        let below = heights_m.map(|height_m| box_px * self.height_m / height_m);
        self.horizon_px + below[1] - off_px..self.horizon_px + below[0] + off_px
    }
}
