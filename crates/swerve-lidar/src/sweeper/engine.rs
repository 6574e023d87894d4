//! Engines that cast the rays of a lidar.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Engine that casts the rays of a lidar.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LidarEngine {
    /// The trees in this crate: always there; the same bytes on every x86-64 machine and thread count.
    #[default]
    Cpu,
    /// A compute shader over the same trees: the same points up to rounding, see [`crate::Sweeper`].
    Gpu,
}

impl LidarEngine {
    /// Name in configurations and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
        }
    }

    /// Whether the same scene gives the same bytes on any machine.
    pub fn is_portable(self) -> bool {
        self == Self::Cpu
    }
}
