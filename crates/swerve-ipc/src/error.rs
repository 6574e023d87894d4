use core::fmt::Debug;

use thiserror::Error;

use crate::NOT_BUILT;

/// Error of the machine or of another process.
#[derive(Debug, Error)]
pub enum IpcError {
    /// Shared memory or its files could not be used.
    #[error("{doing}: {error}")]
    Shared {
        /// Attempted action.
        doing: String,
        /// Resulting error.
        error: String,
    },
    /// A worker process did not become ready.
    #[error("process `{process}` {why}")]
    Worker {
        /// Name of the process.
        process: String,
        /// Reason, as a predicate of the process.
        why: String,
    },
    /// The program was built without the feature `processes`.
    #[error("{NOT_BUILT}")]
    NotBuilt,
}

impl IpcError {
    /// Wraps an error of iceoryx2 or of the file system with the attempted action.
    pub(crate) fn of<E: Debug>(doing: impl Into<String>) -> impl FnOnce(E) -> Self {
        let doing = doing.into();
        move |error| {
            let hint = if has_few_descriptors() { "; file descriptors are scarce (`ulimit -n`)" } else { "" };
            Self::Shared { doing, error: format!("{error:?}{hint}") }
        }
    }
}

/// True if this process can open hardly any more files; iceoryx2 does not report why the system refuses one.
fn has_few_descriptors() -> bool {
    const FEW: u64 = 16;
    let most = rustix::process::getrlimit(rustix::process::Resource::Nofile).current;
    // If no descriptor is left, the list cannot be read either.
    let open = std::fs::read_dir("/proc/self/fd").map_or(u64::MAX - FEW, |all| all.count() as u64);
    most.is_some_and(|most| open + FEW > most)
}
