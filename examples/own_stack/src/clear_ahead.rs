//! A message that Swerve does not know.

use serde::{Deserialize, Serialize};
use swerve_core::Time;

/// How far the way ahead is clear.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ClearAhead {
    /// The frame that it was found in.
    pub stamp: Time,
    /// From the ego's rear axle, m; the detector's range where nothing is in the way.
    pub distance_m: f64,
}
