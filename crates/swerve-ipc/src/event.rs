//! Changes in the states of worker processes.

use std::sync::Arc;

/// Time after which a restarted worker that is not ready is reported, seconds.
pub const LATE_S: i64 = 1;

/// Change in the state of a worker.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WorkerEvent {
    /// The worker has ended, or could not be restarted.
    Gone {
        /// Name of the worker process.
        process: String,
        /// Exit status, or the reason why it was killed or not restarted.
        why: String,
    },
    /// The worker was restarted and is not ready after [`LATE_S`] seconds.
    Late {
        /// Name of the worker process.
        process: String,
    },
    /// The worker was restarted and is ready.
    Restarted {
        /// Name of the worker process.
        process: String,
    },
}

/// Callback for worker events.
pub type OnWorkerEvent = Arc<dyn Fn(WorkerEvent) + Send + Sync>;
