//! A drive of several egos, each driven by an agent, as required by PettingZoo's environments.

use std::sync::{Mutex, MutexGuard, PoisonError};

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use swerve_drive::trust::CodeArgs;

use super::drive::{Drive, Task};
use super::{Stepped, bytes};
use crate::convert::error;
use crate::numbers::Numbers;
use crate::run::{FileOr, Inputs};

/// A drive of one scenario with an agent for each ego.
#[pyclass(frozen, module = "swerve._swerve")]
pub(crate) struct Egos {
    task: Task,
    /// On the heap, because Python's memory is aligned for small types only.
    drive: Mutex<Option<Box<Drive>>>,
}

#[pymethods]
impl Egos {
    #[new]
    #[pyo3(signature = (scenario, level, observe, *, config=None, set=None, rows=8, allow_code=false))]
    fn new(
        scenario: FileOr<'_>,
        level: &str,
        observe: Vec<String>,
        config: Option<FileOr<'_>>,
        set: Option<Bound<'_, PyDict>>,
        rows: usize,
        allow_code: bool,
    ) -> PyResult<Self> {
        let code = CodeArgs { allow_code };
        let inputs = Inputs::load(&scenario, config.as_ref(), set.as_ref(), None, code)?;
        Ok(Self { task: Task::read(inputs, level, &observe, rows)?, drive: Mutex::new(None) })
    }

    /// Names of the egos, in the order of observations, actions and facts.
    fn names(&self) -> Vec<String> {
        self.task.egos()
    }

    /// Observations of one ego in order: stream name, shape, data type, and names of the numbers.
    fn observations(&self) -> Vec<(String, Vec<usize>, &'static str, Vec<String>)> {
        self.task.observations()
    }

    /// Minimum, maximum and name of each number of an action of one ego.
    fn actions(&self) -> Vec<(f64, f64, String)> {
        self.task.actions()
    }

    /// Time between decisions, seconds.
    fn period_s(&self) -> f64 {
        self.task.period_s()
    }

    /// Starts a drive under a seed.
    fn reset<'py>(&self, py: Python<'py>, seed: i64) -> PyResult<Stepped<'py>> {
        py.detach(|| {
            let mut drive = self.drive();
            *drive = None; // its worker processes end before others start
            *drive = Some(Box::new(Drive::begin(&self.task, seed)?));
            Ok(())
        })
        .map_err(error)?;
        self.state(py)
    }

    /// Continues to the next decision under actions (float64 of all egos, concatenated).
    fn step<'py>(&self, py: Python<'py>, actions: Vec<f64>) -> PyResult<Stepped<'py>> {
        py.detach(|| {
            let mut drive = self.drive();
            let drive = drive.as_mut().ok_or_else(|| anyhow::anyhow!("reset() comes before step()"))?;
            let expected = self.task.actions_len() * self.task.egos().len();
            anyhow::ensure!(
                actions.len() == expected,
                "{} numbers of actions, expected {expected} of all egos",
                actions.len()
            );
            drive.step(&self.task, &actions)
        })
        .map_err(error)?;
        self.state(py)
    }

    /// Newest image of an observed stream of the ego at `index`; `None` before the first.
    fn image(&self, index: usize, stream: &str) -> Option<Numbers> {
        self.drive().as_ref()?.image(&self.task, index, stream)
    }

    /// True surroundings of the ego at `index`, for a picture: bodies and points of the route.
    fn scene(&self, index: usize) -> (Vec<[f64; 6]>, Vec<[f64; 5]>) {
        self.drive().as_ref().map(|drive| drive.scene(index)).unwrap_or_default()
    }
}

impl Egos {
    fn drive(&self) -> MutexGuard<'_, Option<Box<Drive>>> {
        self.drive.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn state<'py>(&self, py: Python<'py>) -> PyResult<Stepped<'py>> {
        let drive = self.drive();
        let drive = drive.as_ref().ok_or_else(|| PyValueError::new_err("reset() comes before step()"))?;
        let (mut numbers, mut facts): (Vec<f32>, Vec<f64>) = (Vec::new(), Vec::new());
        drive.observe(&self.task, &mut numbers);
        drive.facts(&mut facts);
        Ok((bytes(py, &numbers, |x| x.to_le_bytes()), bytes(py, &facts, |x| x.to_le_bytes())))
    }
}
