//! Tests that need an adapter: for those of the crates that draw and cast rays on one.

use crate::NoAdapter;

/// The device that was asked for; `None` with a word on why not, so that the test can be skipped.
///
/// # Panics
/// If there is none although `SWERVE_CI` is set: there every test has to run.
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
