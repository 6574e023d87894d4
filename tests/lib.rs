//! Data of tests outside the repository, and the count of tests that are skipped; the tests over several crates are in
//! `it/`.
//!
//! `docs/test_data.md` lists the data. Each skipped test prints one line that `cargo test` does not capture, and
//! `.ci/skipped` counts them. The crate depends on no other crate, so that the tests and benches of all crates can use
//! it.

use std::fmt::Display;
use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Folder of the data: `SWERVE_DATA`, else `shared/data` beside the checkout.
pub fn data_folder() -> PathBuf {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    std::env::var_os("SWERVE_DATA").map_or_else(beside, PathBuf::from)
}

/// File or folder of the data, if it exists.
pub fn data(path: &str) -> Option<PathBuf> {
    Some(data_folder().join(path)).filter(|path| path.exists())
}

/// File or folder of the data; counts the test as skipped if it is missing.
pub fn data_or_skip(path: &str) -> Option<PathBuf> {
    let found = data(path);
    if found.is_none() {
        skipped(&format!("no {path} among the test data, see docs/test_data.md"));
    }
    found
}

/// Value that a test needs from this machine, such as a graphics adapter; counts the test as skipped if it is missing.
///
/// # Panics
/// If it is missing and `SWERVE_CI` is set, which requires all tools of tests.
pub fn or_skip<T>(found: Result<T, impl Display>) -> Option<T> {
    found.map_err(|missing| skipped_without_tool(&missing.to_string())).ok()
}

/// Counts the calling test as skipped because a tool is missing.
///
/// # Panics
/// If `SWERVE_CI` is set, which requires all tools of tests.
pub fn skipped_without_tool(why: &str) {
    assert!(std::env::var_os("SWERVE_CI").is_none(), "SWERVE_CI is set, and a tool is missing: {why}");
    skipped(why);
}

/// Counts the calling test, or a part of it, as skipped: one line on standard output and in the file `SWERVE_SKIPPED`.
///
/// # Panics
/// If that file cannot be written.
pub fn skipped(why: &str) {
    let thread = std::thread::current();
    // A test has a thread with its name, unless tests run one by one.
    let test =
        thread.name().filter(|name| *name != "main").map_or_else(String::new, |name| format!("{name}: "));
    let why = why.split_whitespace().collect::<Vec<_>>().join(" ");
    let line = format!("skipped: {test}{why}\n");
    // Not by `print!`, whose output `cargo test` shows for failed tests only.
    let _closed = std::io::stdout().write_all(line.as_bytes());
    if let Some(file) = std::env::var_os("SWERVE_SKIPPED") {
        let file = OpenOptions::new().create(true).append(true).open(file);
        file.and_then(|mut file| file.write_all(line.as_bytes())).expect("SWERVE_SKIPPED is a writable file");
    }
}
