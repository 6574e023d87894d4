//! Helpers for tests that need an adapter, in the crates that render or cast rays on one.

use crate::NoAdapter;

/// The requested device; `None` after printing the reason, so that the test can be skipped.
///
/// # Panics
/// If there is no device and `SWERVE_CI` is set, which requires all tests to run.
pub fn adapter_or_skip<T>(asked: Result<T, NoAdapter>) -> Option<T> {
    match asked {
        Ok(gpu) => Some(gpu),
        Err(none) => {
            assert!(std::env::var_os("SWERVE_CI").is_none(), "{none}");
            eprintln!("skipped: {none}");
            None
        }
    }
}
