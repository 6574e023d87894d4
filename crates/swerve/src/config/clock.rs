//! What moves a run, `[clock]`.

use serde::{Deserialize, Serialize};

/// What moves a run.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ClockConfig {
    /// Which clock.
    pub source: Clock,
}

/// A clock.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Clock {
    /// Jumps from one instant at which something is due to the next: the result is a function of configuration,
    /// scenario and seed.
    #[default]
    Virtual,
    /// The real one: steps take as long as they take on this host.
    Wall,
}

impl Clock {
    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Virtual => "virtual",
            Self::Wall => "wall",
        }
    }
}
