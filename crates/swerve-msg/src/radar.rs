use serde::{Deserialize, Serialize};
use swerve_core::Time;

/// All echoes of one scan of a radar.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct RadarScan {
    /// Instant of the scan.
    pub stamp: Time,
    /// Nearest first.
    pub detections: Vec<RadarDetection>,
}

/// One echo above the threshold, about the sensor's own axes.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct RadarDetection {
    /// Distance, metres.
    pub range_m: f64,
    /// How fast the distance grows, m/s: **positive for what goes away, negative for what comes nearer**. It is
    /// relative to the sensor, so a tree ahead of a moving car has a negative one.
    pub range_rate_mps: f64,
    /// Angle from the sensor's axis, radians; positive to the left.
    pub azimuth_rad: f64,
    /// Angle above the sensor's level, radians; `None` from a sensor that does not measure it.
    pub elevation_rad: Option<f64>,
    /// Radar cross-section as measured in this scan, decibels over a square metre.
    pub rcs_dbsm: f64,
    /// Signal over noise, decibels.
    pub snr_db: f64,
}
