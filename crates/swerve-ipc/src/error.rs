use core::fmt::Debug;

use thiserror::Error;

/// What the machine refused, or another process.
#[derive(Debug, Error)]
pub enum IpcError {
    /// Shared memory, or what belongs to it.
    #[error("{doing}: {error}")]
    Shared {
        /// What was tried.
        doing: String,
        /// What came of it.
        error: String,
    },
    /// A worker process did not come up.
    #[error("process `{process}` {why}")]
    Worker {
        /// Which.
        process: String,
        /// What happened.
        why: String,
    },
}

impl IpcError {
    /// An error of iceoryx2 or of the file system, with what was tried.
    pub(crate) fn of<E: Debug>(doing: impl Into<String>) -> impl FnOnce(E) -> Self {
        let doing = doing.into();
        move |error| Self::Shared { doing, error: format!("{error:?}") }
    }
}
