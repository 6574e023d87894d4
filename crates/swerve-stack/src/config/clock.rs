//! Clock of a run, `[clock]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;

/// Clock of a run.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct ClockConfig {
    /// Clock.
    pub source: Clock,
    /// Processors of the run under wall clock: the first for the engine's thread, the others for all other threads.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(inner(range(min = 0, max = 65_535)))]
    pub pin: Vec<usize>,
    /// Real-time priority of the engine's thread under wall clock, 1 to 99.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 99))]
    pub priority: Option<u8>,
}

/// Clock of a run.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Clock {
    /// Jumps from one instant at which something is due to the next: the result is a function of configuration,
    /// scenario and seed.
    #[default]
    Virtual,
    /// Real time: steps take as long as they take on this host.
    Wall,
}

impl Clock {
    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Virtual => "virtual",
            Self::Wall => "wall",
        }
    }
}
