//! Health of camera and lidar data.

use serde::{Deserialize, Serialize};
use swerve_core::{Digest, Time};

/// Result of monitoring one image or point cloud.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct SensorHealth {
    /// Stamp of the image or cloud.
    pub stamp: Time,
    /// Number of pixel values or points.
    pub numbers: u64,
    /// Number of invalid values: non-finite points, plus one if an array has the wrong length.
    pub invalid: u64,
    /// Share of the most frequent byte value, 0 to 1; close to 1 for a blank image.
    pub commonest_share: f32,
    /// True if identical to the previous one, byte for byte.
    pub frozen: bool,
    /// Digest of the data.
    pub checksum: Digest,
}
