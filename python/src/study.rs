//! `swerve.study`: runs many drives.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use swerve_drive::trust::CodeArgs;
use swerve_study::cells::{CellStore, Runner};
use swerve_study::result::CellResult;
use swerve_study::{Bench, heatmap, table};

use crate::background::{LOOKS_OF_GRACE, do_in_background};
use crate::convert::error;

/// Result of a study.
struct Studied {
    name: String,
    axes: Vec<String>,
    cells: String,
    csv: String,
    heatmap: String,
}

fn run(bench: &Bench, out: &std::path::Path, threads: usize, reins: &Reins) -> anyhow::Result<Studied> {
    let store = CellStore::open(out)?;
    let runner = Runner { store: &store, threads, shard: None, reports: false, stop: &reins.stop };
    let one = |cell: &_, _| {
        let result = bench.run_cell(cell, None);
        reins.done.fetch_add(1, Ordering::Relaxed);
        result
    };
    let study = &bench.study;
    let results = runner.run(study, |cell| bench.fingerprint(cell), one)?;
    let title = if study.description.is_empty() { &study.name } else { &study.description };
    let finished: Vec<&CellResult> = results.iter().flatten().collect();
    Ok(Studied {
        name: study.name.clone(),
        axes: study.axes.clone(),
        cells: serde_json::to_string(&finished)?,
        csv: table::csv(study, &results),
        heatmap: heatmap::draw(&table::Grid::of(study, &results), title).svg(),
    })
}

/// Reports the progress of a study, and ends it.
#[derive(Clone, Default)]
struct Reins {
    done: Arc<AtomicUsize>,
    stop: Arc<AtomicBool>,
}

/// Runs a study; returns the result as a dictionary. Finished cells are kept in `out`.
#[pyfunction]
#[pyo3(signature = (file, out, set=Vec::new(), threads=1, progress=None, allow_code=false))]
pub(crate) fn study<'py>(
    py: Python<'py>,
    file: PathBuf,
    out: PathBuf,
    set: Vec<String>,
    threads: usize,
    progress: Option<Bound<'py, PyAny>>,
    allow_code: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let open = || -> anyhow::Result<Bench> {
        let bench = Bench::open(&swerve::Registry::standard(), &file, &set)?;
        let bench = bench.with_code(CodeArgs { allow_code });
        bench.refuse_programs()?;
        Ok(bench)
    };
    let bench = py.detach(open).map_err(error)?;
    let count = bench.study.cells.len();
    let reins = Reins::default();
    let (told, stopper) = (reins.clone(), reins.clone());
    let look = |_: Python<'_>| match &progress {
        Some(call) => call.call1((told.done.load(Ordering::Relaxed), count)).map(drop),
        None => Ok(()),
    };
    let work = move || run(&bench, &out, threads.max(1), &reins);
    let mut asked = 0;
    let stop = move || {
        stopper.stop.store(true, Ordering::SeqCst);
        asked += 1;
        if asked > LOOKS_OF_GRACE {
            // A step that goes on ends with its process.
            swerve_ipc::kill_workers();
        }
    };
    let studied = do_in_background(py, work, look, stop)?;
    let result = PyDict::new(py);
    result.set_item("name", studied.name)?;
    result.set_item("axes", studied.axes)?;
    result.set_item("cells", studied.cells)?;
    result.set_item("csv", studied.csv)?;
    result.set_item("heatmap", studied.heatmap)?;
    Ok(result)
}
