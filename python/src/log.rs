//! `swerve.read_log`: reads the log of a run.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use swerve_log::{Log, Record};

use crate::convert::error;
use crate::streams::{Streams, bytes_of};

/// Reads a log, damaged or not; returns its content as a dictionary.
#[pyfunction]
pub(crate) fn read_log(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let (log, damage) = py.detach(|| Log::salvage(&path)).map_err(|e| error(e.into()))?;
    let mut streams = Streams::default();
    log.all_publications().for_each(|publication| streams.take(publication));
    let result = PyDict::new(py);
    result.set_item("version", &log.start.version)?;
    result.set_item("seed", log.start.seed)?;
    result.set_item("config", &log.start.config)?;
    result.set_item("extra", &log.start.extra)?;
    result.set_item("digest", log.end.as_ref().map(|end| end.digest.to_string()))?;
    result.set_item("end_ns", log.end.as_ref().map(|end| end.at.ns()))?;
    result.set_item("report", log.end.as_ref().map(|end| &end.report))?;
    result.set_item("damage", damage.map(|damage| damage.to_string()))?;
    result.set_item("streams", streams.into_dict(py)?)?;
    result.set_item("steps", steps(py, &log)?)?;
    result.set_item("misses", misses(py, &log)?)?;
    result.set_item("drops", drops(py, &log)?)?;
    Ok(result)
}

fn steps<'py>(py: Python<'py>, log: &Log) -> PyResult<Bound<'py, PyDict>> {
    let columns = PyDict::new(py);
    let steps: Vec<_> = log.steps().collect();
    let integers = |of: &dyn Fn(&swerve_log::StepRecord) -> i64| {
        ("<i8", bytes_of(py, &steps, |step| of(step).to_le_bytes()))
    };
    columns
        .set_item("operator", ("O", steps.iter().map(|step| step.operator.as_str()).collect::<Vec<_>>()))?;
    columns.set_item("stamp", integers(&|step| step.stamp.ns()))?;
    columns.set_item("start", integers(&|step| step.start.ns()))?;
    columns.set_item("end", integers(&|step| step.end.ns()))?;
    columns.set_item("units", integers(&|step| step.units.cast_signed()))?;
    columns.set_item("host_ns", integers(&|step| step.host_ns.cast_signed()))?;
    columns.set_item("late", ("?", bytes_of(py, &steps, |step| [u8::from(step.late)])))?;
    Ok(columns)
}

fn misses<'py>(py: Python<'py>, log: &Log) -> PyResult<Bound<'py, PyDict>> {
    let misses: Vec<_> = log
        .records
        .iter()
        .filter_map(|record| if let Record::Miss(miss) = record { Some(miss) } else { None })
        .collect();
    let columns = PyDict::new(py);
    let texts =
        |of: fn(&swerve_log::MissRecord) -> &str| ("O", misses.iter().map(|m| of(m)).collect::<Vec<_>>());
    columns.set_item("operator", texts(|miss| &miss.operator))?;
    columns.set_item("stamp", ("<i8", bytes_of(py, &misses, |miss| miss.stamp.ns().to_le_bytes())))?;
    columns.set_item("deadline", ("<i8", bytes_of(py, &misses, |miss| miss.deadline.ns().to_le_bytes())))?;
    columns.set_item("at", ("<i8", bytes_of(py, &misses, |miss| miss.at.ns().to_le_bytes())))?;
    columns.set_item("reaction", texts(|miss| &miss.reaction))?;
    columns.set_item("started", ("?", bytes_of(py, &misses, |miss| [u8::from(miss.started)])))?;
    Ok(columns)
}

fn drops<'py>(py: Python<'py>, log: &Log) -> PyResult<Bound<'py, PyDict>> {
    let drops: Vec<_> = log
        .records
        .iter()
        .filter_map(|record| if let Record::Drop(drop) = record { Some(drop) } else { None })
        .collect();
    let columns = PyDict::new(py);
    let texts =
        |of: fn(&swerve_log::DropRecord) -> &str| ("O", drops.iter().map(|d| of(d)).collect::<Vec<_>>());
    columns.set_item("operator", texts(|drop| &drop.operator))?;
    columns.set_item("stamp", ("<i8", bytes_of(py, &drops, |drop| drop.stamp.ns().to_le_bytes())))?;
    columns.set_item("at", ("<i8", bytes_of(py, &drops, |drop| drop.at.ns().to_le_bytes())))?;
    columns.set_item("reason", texts(|drop| &drop.reason))?;
    Ok(columns)
}
