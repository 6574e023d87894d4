//! A message that Swerve does not know.

use serde::{Deserialize, Serialize};
use swerve::core::Time;

/// How far the lane ahead is clear.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ClearAhead {
    /// The frame that it was found in.
    pub stamp: Time,
    /// Along the lane from the ego's rear axle, m; that of the sensor where nothing is seen.
    pub distance_m: f64,
}
