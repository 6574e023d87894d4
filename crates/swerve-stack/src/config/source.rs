//! A recorded drive as input, `[source]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A recorded drive in place of a vehicle.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SourceConfig {
    /// A rosbag2 log in MCAP form, or its folder, as a path from the folder of the configuration.
    pub rosbag: String,
}
