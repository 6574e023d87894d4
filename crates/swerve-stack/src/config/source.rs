//! A recorded drive as input, `[source]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Config;

/// A recorded drive in place of a vehicle.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SourceConfig {
    /// A rosbag2 log in MCAP form, or its folder, as a path from the folder of the configuration.
    pub rosbag: String,
}

impl Config {
    pub(super) fn check_source(&self, told: &mut Vec<(String, String)>) {
        let Some(source) = &self.source else { return };
        if source.rosbag.is_empty() {
            told.push(("source.rosbag".into(), "expected the file or the folder of a rosbag2 log".into()));
        }
        if self.live.is_none() {
            let message = "a recorded drive replaces a vehicle of `swerve live`: expected `[live]` as well";
            told.push(("source".into(), message.into()));
        }
    }
}
