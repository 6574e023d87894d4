//! Supervision of a run's processes.

use serde::{Deserialize, Serialize};

/// Processes of a run that are currently gone. Published on every change.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Supervision {
    /// Processes that are gone; while there are any, the ego is brought to a stop.
    pub gone: Vec<GoneProcess>,
}

/// A process that is gone.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct GoneProcess {
    /// Name in the configuration.
    pub process: String,
    /// Cause of its end.
    pub why: String,
}
