//! Radar scans.

use serde::{Deserialize, Serialize};
use swerve_core::Time;

/// All detections of one radar scan.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct RadarScan {
    /// Instant of the scan.
    pub stamp: Time,
    /// Nearest first.
    pub detections: Vec<RadarDetection>,
}

/// One detection above the threshold, in the axes of the sensor.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct RadarDetection {
    /// Distance, metres.
    pub range_m: f64,
    /// Range rate, m/s: **positive if receding, negative if approaching**. Relative to the sensor, so a tree ahead
    /// of a moving car has a negative range rate.
    pub range_rate_mps: f64,
    /// Azimuth from the sensor's axis, radians; positive to the left.
    pub azimuth_rad: f64,
    /// Elevation above the sensor's horizontal plane, radians; `None` if the sensor does not measure it.
    pub elevation_rad: Option<f64>,
    /// Radar cross-section measured in this scan, dBsm.
    pub rcs_dbsm: f64,
    /// Signal-to-noise ratio, dB.
    pub snr_db: f64,
}
