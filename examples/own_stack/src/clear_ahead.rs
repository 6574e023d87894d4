//! A message that Swerve does not know.

use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_foxglove::Foxglove;

/// Clear distance ahead.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ClearAhead {
    /// The frame that it was found in.
    pub stamp: Time,
    /// From the ego's rear axle, m; the detector's range where nothing is in the way.
    pub distance_m: f64,
}

/// Shows it in Foxglove, under `/view/clear_ahead`: a number to be plotted.
pub fn show(foxglove: Foxglove) -> Foxglove {
    const SCHEMA: &str = r#"{"type": "object", "properties": {"distance_m": {"type": "number"}}}"#;
    foxglove.with_json::<ClearAhead>("clear_ahead", SCHEMA)
}
