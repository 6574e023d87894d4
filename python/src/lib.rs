//! Extension module of the Python package `swerve`: functions called from Python, and conversion of values.
//!
//! | file | what |
//! |---|---|
//! | `convert.rs` | conversion of plain Python values to TOML and CBOR and back |
//! | `numbers.rs` | zero-copy arrays for NumPy |
//! | `streams.rs` | the messages of a stream, as columns and individually |
//! | `background.rs` | long work on a thread, while Python checks for Ctrl-C |
//! | `run.rs`, `study.rs`, `log.rs`, `command.rs` | one function each |
//! | `gym/` | drives stepped by an agent |
//! | `guest.rs` | the stack in a foreign world, stepped from Python |
//! | `map.rs` | the lanes of a road or map |
//! | `worker.rs` | operators written in Python, in separate processes |
//! | `start.rs` | facts of a drive for classes in Python |
//! | `world.rs` | worlds written in Python |
//! | `algorithms.rs` | algorithms written in Python, called by operators of the stack |
//!
//! The public interface is in the Python files; this module is internal to them.

mod algorithms;
mod background;
mod command;
mod convert;
mod guest;
mod gym;
mod log;
mod map;
mod numbers;
mod run;
mod start;
mod streams;
mod study;
mod worker;
mod world;

use pyo3::prelude::*;

/// The extension module.
#[pymodule]
fn _swerve(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<streams::StreamData>()?;
    module.add_class::<numbers::Numbers>()?;
    module.add_class::<gym::Drives>()?;
    module.add_class::<gym::Egos>()?;
    module.add_class::<guest::Guest>()?;
    module.add_class::<map::Lanes>()?;
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
