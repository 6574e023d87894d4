//! The command line from Python.

use std::path::PathBuf;

use pyo3::prelude::*;
use swerve_drive::program::Program;
use swerve_drive::shipped::Kind;

/// Registers the host program of this module, and the file that contains it.
#[pyfunction]
pub(crate) fn host(path: PathBuf, arguments: Vec<String>, code: PathBuf) {
    Program { path, arguments, code }.is_part_of();
}

/// Built-in scenarios: names and texts.
#[pyfunction]
pub(crate) fn scenarios() -> Vec<(&'static str, &'static str)> {
    Kind::Scenario.all().map(|(name, file)| (name, file.text)).collect()
}

/// Runs a command line, program name first; returns the exit code.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, words: Vec<String>) -> i32 {
    py.detach(|| {
        let cli = match swerve::cli::parse(words) {
            Ok(cli) => cli,
            Err(error) => {
                // If standard error is closed, the exit code still reports the failure.
                let _unread = error.print();
                return error.exit_code();
            }
        };
        match swerve::cli::main(&cli, &swerve::Registry::standard()) {
            Ok(()) => 0,
            Err(error) => {
                eprintln!("error: {}", swerve_report::output::message(&error));
                1
            }
        }
    })
}
