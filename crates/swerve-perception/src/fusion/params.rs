//! Parameters of the sensor fusion.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require_all_within};

/// Parameters of the sensor fusion.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Smallest image overlap (IoU) of a camera box and the projection of a lidar box of the same object, 0 to 1.
    pub iou_min: f64,
    /// Standard deviation of the edges of a camera box, pixels.
    pub edge_noise_px: f64,
    /// Standard deviation of the camera's pitch relative to the ground, radians, due to braking and road grade.
    pub pitch_noise_rad: f64,
    /// Standard deviation of a depth divided by its square, 1/m: that of a disparity divided by focal length and
    /// baseline.
    pub depth_noise_1pm: f64,
    /// Constant standard deviation of the position of a lidar box, metres.
    pub lidar_noise_m: f64,
    /// Additional standard deviation of a lidar box: of its distance as a share of it, and of its bearing in radians.
    pub lidar_noise_share: f64,
    /// Distance within which a lidar detects unoccluded people, metres: people detected only by the camera get a lower
    /// score there. 0 disables this.
    pub lidar_sure_m: f64,
    /// Probability that the lidar misses a person within `lidar_sure_m`, 0 to 1.
    pub lidar_miss: f64,
    /// Standard deviation of a radar distance, metres; echoes come from any part of an object.
    pub radar_noise_m: f64,
    /// Distance gate for assigning a radar echo to an object, in addition to the object's size and errors, metres.
    pub radar_range_m: f64,
    /// Bearing gate for assigning a radar echo to an object, in addition to the object's size, radians.
    pub radar_bearing_rad: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            iou_min: 0.3,
            edge_noise_px: 2.0,
            pitch_noise_rad: 0.003,
            // A quarter of a pixel, focal length 571 pixels, baseline 0.5 m.
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
    /// Checks that all parameters are in range.
    ///
    /// # Errors
    /// The first parameter outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        require_all_within(&[
            ("iou_min", self.iou_min, [0.01, 1.0]),
            // Above zero, so that covariances stay positive definite.
            ("edge_noise_px", self.edge_noise_px, [0.01, 100.0]),
            ("pitch_noise_rad", self.pitch_noise_rad, [0.0, 0.5]),
            ("depth_noise_1pm", self.depth_noise_1pm, [1e-6, 0.1]),
            ("lidar_noise_m", self.lidar_noise_m, [1e-3, 10.0]),
            ("lidar_noise_share", self.lidar_noise_share, [0.0, 1.0]),
            ("lidar_sure_m", self.lidar_sure_m, [0.0, 1000.0]),
            // Above zero, else a nearby person could never be detected by the camera alone.
            ("lidar_miss", self.lidar_miss, [1e-3, 1.0]),
            ("radar_noise_m", self.radar_noise_m, [1e-3, 10.0]),
            ("radar_range_m", self.radar_range_m, [0.0, 50.0]),
            ("radar_bearing_rad", self.radar_bearing_rad, [0.0, 1.0]),
        ])
    }
}
