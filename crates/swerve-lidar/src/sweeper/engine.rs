//! Ray casting engines of a lidar.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Ray casting engine of a lidar.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LidarEngine {
    /// CPU: always available; the same bytes on every x86-64 machine and thread count.
    #[default]
    Cpu,
    /// GPU compute shader: the same points up to rounding.
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

    /// Returns true if the same scene gives the same bytes on any machine.
    pub fn is_portable(self) -> bool {
        self == Self::Cpu
    }
}
