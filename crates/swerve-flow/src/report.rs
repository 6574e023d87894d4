//! What a run comes to.

use serde::{Deserialize, Serialize};
use swerve_core::{Digest, Span, Time};
use thiserror::Error;

use crate::graph::GraphError;

/// What a run came to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunReport {
    /// One number that two equal runs share: over (stream, stamp, visible_at, payload) in commit order.
    pub digest: Digest,
    /// Why it ended.
    pub end: EndReason,
    /// The last instant that was swept.
    pub at: Time,
    /// The seed.
    pub seed: u64,
    /// How many instants were swept.
    pub instants: u64,
    /// Per operator, in the order of their ranks.
    pub operators: Vec<OperatorReport>,
    /// How many steps ran on worker threads while another one did. Depends on the host; not part of the digest.
    pub overlapped_steps: u64,
}

/// Why a run ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EndReason {
    /// The requested span is over.
    Until,
    /// An operator ended the run.
    Stopped(String),
    /// Nothing is left to be done, ever.
    Idle,
    /// It was ended from outside.
    Interrupted,
    /// It failed.
    Failed(String),
}

/// What one operator did in a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct OperatorReport {
    /// Its name.
    pub name: String,
    /// Steps started.
    pub steps: u64,
    /// Messages published, repeats included.
    pub messages: u64,
    /// Messages that repeated an older result.
    pub repeats: u64,
    /// Watermarks published without a message.
    pub bare: u64,
    /// Deadlines missed.
    pub misses: u64,
    /// Frames and results dropped.
    pub drops: Drops,
    /// Run times drawn for want of a record.
    pub unrecorded: u64,
    /// The sum of its steps' run times, of those that came to their end.
    pub busy: Span,
    /// How many steps came to their modelled end.
    pub ended: u64,
    /// Units of work that its steps counted.
    pub units: u64,
}

/// Frames and results dropped, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Drops {
    /// A newer frame was started, or waits, instead.
    pub skipped: u64,
    /// The queue was full.
    pub queue_full: u64,
    /// A newer stamp was published before this one, which was waiting.
    pub given_up: u64,
    /// A newer stamp was published before this one's result.
    pub overtaken: u64,
    /// Messages for stamps that were answered already.
    pub too_late: u64,
}

impl Drops {
    /// All frames and results dropped, for whatever reason; messages that opened no frame are not among them.
    pub fn total(&self) -> u64 {
        self.skipped + self.queue_full + self.given_up + self.overtaken
    }
}

impl RunReport {
    /// What the operator of this name did.
    pub fn operator(&self, name: &str) -> Option<&OperatorReport> {
        self.operators.iter().find(|operator| operator.name == name)
    }
}

/// Why a run could not be brought to its end. Observers have been told all that happened before.
#[derive(Debug, Error)]
pub enum RunError {
    /// The graph has a fault; no step ran.
    #[error(transparent)]
    Graph(#[from] GraphError),
    /// An operator panicked.
    #[error("operator `{operator}` panicked: {message}")]
    Panic {
        /// Which.
        operator: String,
        /// What it said.
        message: String,
    },
    /// A step that was taken elsewhere did not come to its end.
    #[error("operator `{operator}`: {why}")]
    Lost {
        /// Whose step.
        operator: String,
        /// What happened.
        why: String,
    },
    /// A queue was full whose policy forbids it.
    #[error("the queue of operator `{operator}` is full at stamp {stamp}")]
    QueueFull {
        /// Whose queue.
        operator: String,
        /// The stamp that found no room.
        stamp: Time,
    },
    /// The system gave no worker thread.
    #[error("no worker thread: {0}")]
    Thread(#[from] std::io::Error),
}
