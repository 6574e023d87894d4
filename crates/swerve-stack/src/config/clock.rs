//! Clock of a run, `[clock]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Config;

/// Clock of a run.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ClockConfig {
    /// Clock.
    pub source: Clock,
    /// Processors of the run under wall clock: the first for the engine's thread, the others for all other threads.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pin: Vec<usize>,
    /// Real-time priority of the engine's thread under wall clock, 1 to 99.
    #[serde(skip_serializing_if = "Option::is_none")]
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

/// Highest number of a processor.
const CPU_MAX: usize = 65_535;

impl Config {
    pub(super) fn check_clock(&self, told: &mut Vec<(String, String)>) {
        let ClockConfig { pin, priority, .. } = &self.clock;
        for (k, cpu) in pin.iter().enumerate() {
            if *cpu > CPU_MAX {
                told.push((format!("clock.pin[{k}]"), format!("expected 0 to {CPU_MAX}, found {cpu}")));
            }
            if pin[..k].contains(cpu) {
                told.push((format!("clock.pin[{k}]"), format!("processor {cpu} is there twice")));
            }
        }
        if let Some(priority) = priority.filter(|priority| !(1..=99).contains(priority)) {
            told.push(("clock.priority".into(), format!("expected 1 to 99, found {priority}")));
        }
    }
}
