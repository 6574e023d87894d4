//! State shared between threads.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Locks shared state and ignores poisoning: its updates leave it consistent even after a panic.
pub(crate) fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}
