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
        move |error| {
            let hint = if has_few_descriptors() { "; file descriptors are scarce (`ulimit -n`)" } else { "" };
            Self::Shared { doing, error: format!("{error:?}{hint}") }
        }
    }
}

/// True if this process may open hardly any more files: iceoryx2 does not pass on why the system refuses one.
fn has_few_descriptors() -> bool {
    const FEW: u64 = 16;
    let most = rustix::process::getrlimit(rustix::process::Resource::Nofile).current;
    // Where no descriptor is left, the list is not to be had either.
    let open = std::fs::read_dir("/proc/self/fd").map_or(u64::MAX - FEW, |all| all.count() as u64);
    most.is_some_and(|most| open + FEW > most)
}
