//! Parameters of the fusion.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require_all_within};

/// Parameters of the fusion.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Least overlap in the image of a camera's box and the picture of a lidar's box of the same thing.
    pub iou_min: f64,
    /// Standard deviation of the edges of a camera's box, pixels.
    pub edge_noise_px: f64,
    /// Standard deviation of the camera's pitch against the ground, radians: braking cars nod, roads bend.
    pub pitch_noise_rad: f64,
    /// Standard deviation of a depth over its square, 1/m: that of a disparity over focal length and base.
    pub depth_noise_1pm: f64,
    /// Standard deviation of the place of a lidar's box, metres.
    pub lidar_noise_m: f64,
    /// The same of its distance as a share of that, and of its bearing in radians, on top.
    pub lidar_noise_share: f64,
    /// Within this distance a lidar finds people where nothing hides them, metres: a person alone in the camera's image is
    /// doubted there. 0: nowhere.
    pub lidar_sure_m: f64,
    /// Share of people whom it misses there.
    pub lidar_miss: f64,
    /// Standard deviation of a radar's distance, metres: echoes come from anywhere on a thing.
    pub radar_noise_m: f64,
    /// An echo is an object's if it is within this of its distance, beside the object's own size and errors, metres.
    pub radar_range_m: f64,
    /// The same of its bearing, radians.
    pub radar_bearing_rad: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            iou_min: 0.3,
            edge_noise_px: 2.0,
            pitch_noise_rad: 0.003,
            // A quarter of a pixel at a focal length of 571 pixels and a base of half a metre.
            depth_noise_1pm: 9e-4,
            lidar_noise_m: 0.15,
            lidar_noise_share: 0.005,
            lidar_sure_m: 20.0,
            lidar_miss: 0.1,
            radar_noise_m: 0.5,
            radar_range_m: 2.0,
            radar_bearing_rad: 0.087,
        }
    }
}

impl Params {
    /// The first parameter outside its range.
    ///
    /// # Errors
    /// There is one.
    pub fn validate(&self) -> Result<(), ParamError> {
        require_all_within(&[
            ("iou_min", self.iou_min, [0.01, 1.0]),
            // Above zero, or a covariance could be none.
            ("edge_noise_px", self.edge_noise_px, [0.01, 100.0]),
            ("pitch_noise_rad", self.pitch_noise_rad, [0.0, 0.5]),
            ("depth_noise_1pm", self.depth_noise_1pm, [1e-6, 0.1]),
            ("lidar_noise_m", self.lidar_noise_m, [1e-3, 10.0]),
            ("lidar_noise_share", self.lidar_noise_share, [0.0, 1.0]),
            ("lidar_sure_m", self.lidar_sure_m, [0.0, 1000.0]),
            // Above zero, or a person near by could never be seen by the camera alone.
            ("lidar_miss", self.lidar_miss, [1e-3, 1.0]),
            ("radar_noise_m", self.radar_noise_m, [1e-3, 10.0]),
            ("radar_range_m", self.radar_range_m, [0.0, 50.0]),
            ("radar_bearing_rad", self.radar_bearing_rad, [0.0, 1.0]),
        ])
    }
}
