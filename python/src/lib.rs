//! The extension module of the Python package `swerve`: what Python calls, and how its values come and go.
//!
//! | file | what |
//! |---|---|
//! | `convert.rs` | plain values of Python to TOML and CBOR and back |
//! | `numbers.rs` | arrays of ours as NumPy sees them, where they lie |
//! | `streams.rs` | the messages of a stream, as columns and one by one |
//! | `background.rs` | long work on a thread, while Python looks for Ctrl-C |
//! | `run.rs`, `study.rs`, `log.rs`, `command.rs` | one function each |
//! | `gym/` | drives that an agent steps |
//! | `worker.rs` | operators written in Python, in processes of their own |
//!
//! What a user sees is in the Python files; this module is theirs alone.

mod background;
mod command;
mod convert;
mod gym;
mod log;
mod numbers;
mod run;
mod streams;
mod study;
mod worker;

use pyo3::prelude::*;

/// The extension module.
#[pymodule]
fn _swerve(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<streams::StreamData>()?;
    module.add_class::<numbers::Numbers>()?;
    module.add_class::<gym::Drives>()?;
    module.add_function(wrap_pyfunction!(command::host, module)?)?;
    module.add_function(wrap_pyfunction!(command::main, module)?)?;
    module.add_function(wrap_pyfunction!(command::scenarios, module)?)?;
    module.add_function(wrap_pyfunction!(run::run, module)?)?;
    module.add_function(wrap_pyfunction!(study::study, module)?)?;
    module.add_function(wrap_pyfunction!(log::read_log, module)?)?;
    module.add_function(wrap_pyfunction!(convert::from_cbor, module)?)?;
    module.add_function(wrap_pyfunction!(convert::to_cbor, module)?)?;
    module.add_function(wrap_pyfunction!(worker::work, module)?)
}
