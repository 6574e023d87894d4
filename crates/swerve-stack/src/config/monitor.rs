//! Monitors of single cameras and lidars, `[monitor.NAME]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::camera::Output;

/// Monitor of a camera or lidar: checks every byte of its output for frozen, blank or broken data.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MonitorConfig {
    /// Camera or lidar to monitor; the monitor makes it run.
    pub sensor: String,
    /// Output of the camera to monitor.
    pub output: Output,
}

impl Default for MonitorConfig {
    fn default() -> Self {
        Self { sensor: String::new(), output: Output::Rgb }
    }
}
