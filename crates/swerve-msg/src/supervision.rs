use serde::{Deserialize, Serialize};

/// The processes of a run that are gone at the moment. Said whenever one goes or comes back.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Supervision {
    /// Those that are gone; while there is one, the ego is brought to a stop.
    pub gone: Vec<GoneProcess>,
}

/// A process that is gone.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct GoneProcess {
    /// Its name in the configuration.
    pub process: String,
    /// How it ended.
    pub why: String,
}
