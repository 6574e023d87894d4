//! Parameters of the sensor fusion.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;

/// Parameters of the sensor fusion.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Smallest image overlap (IoU) of a camera box and the projection of a lidar box of the same object, 0 to 1.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub iou_min: f64,
    /// Standard deviation of the edges of a camera box, pixels.
    // Above zero, so that covariances stay positive definite.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub edge_noise_px: f64,
    /// Standard deviation of the camera's pitch relative to the ground, radians, due to braking and road grade.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub pitch_noise_rad: f64,
    /// Standard deviation of a depth divided by its square, 1/m: that of a disparity divided by focal length and
    /// baseline.
    #[schemars(range(min = 1e-6, max = 0.1))]
    pub depth_noise_1pm: f64,
    /// Constant standard deviation of the position of a lidar box, metres.
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub lidar_noise_m: f64,
    /// Additional standard deviation of a lidar box: of its distance as a share of it, and of its bearing in radians.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub lidar_noise_share: f64,
    /// Distance within which a lidar detects unoccluded people, metres: people detected only by the camera get a lower
    /// score there. 0 disables this.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub lidar_sure_m: f64,
    /// Probability that the lidar misses a person within `lidar_sure_m`, 0 to 1.
    // Above zero, else a nearby person could never be detected by the camera alone.
    #[schemars(range(min = 1e-3, max = 1.0))]
    pub lidar_miss: f64,
    /// Standard deviation of a radar distance, metres; echoes come from any part of an object.
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub radar_noise_m: f64,
    /// Distance gate for assigning a radar echo to an object, in addition to the object's size and errors, metres.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub radar_range_m: f64,
    /// Bearing gate for assigning a radar echo to an object, in addition to the object's size, radians.
    #[schemars(range(min = 0.0, max = 1.0))]
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
