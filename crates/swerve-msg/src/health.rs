use serde::{Deserialize, Serialize};
use swerve_core::{Digest, Time};

/// What a watcher of a camera or lidar says of one image or point cloud.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct SensorHealth {
    /// Of the image or cloud.
    pub stamp: Time,
    /// How many numbers or points it has.
    pub numbers: u64,
    /// How many of them cannot be: not finite, or not as many as there should be.
    pub invalid: u64,
    /// How much of it is one and the same byte, 0 to 1: nearly all of a blank image.
    pub commonest_share: f32,
    /// It is the same as the one before, byte for byte.
    pub frozen: bool,
    /// Its fingerprint.
    pub checksum: Digest,
}
