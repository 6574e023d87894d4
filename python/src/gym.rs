//! Drives stepped by an external agent: one or many at once, as required by Gymnasium's environments.

mod action;
mod drive;
mod egos;
mod observe;

use std::sync::{Mutex, MutexGuard, PoisonError};

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyDict};
use rayon::prelude::*;
use swerve_core::Rng;
use swerve_drive::trust::CodeArgs;

use crate::convert::error;
use crate::numbers::Numbers;
use crate::run::{FileOr, Inputs};
use drive::{Drive, FACTS, Task};
pub(crate) use egos::Egos;

/// Several drives of one scenario, each with a separate agent.
#[pyclass(frozen, module = "swerve._swerve")]
pub(crate) struct Drives {
    task: Task,
    drives: Mutex<Vec<Lane>>,
    pool: Option<rayon::ThreadPool>,
}

/// One drive, and the seed of its next one.
struct Lane {
    drive: Option<Drive>,
    seed: i64,
    /// Number of drives so far under that seed.
    count: i64,
    over: bool,
}

impl Lane {
    fn reset(&mut self, task: &Task) -> anyhow::Result<()> {
        let seed = match self.count {
            0 => self.seed,
            count => Rng::keyed(self.seed.cast_unsigned(), "drive", &[count]).bits().cast_signed() & i64::MAX,
        };
        self.count += 1;
        self.over = false;
        self.drive = Some(Drive::begin(task, seed)?);
        Ok(())
    }

    /// Continues to the next decision, or starts the next drive if this one is over.
    fn step(&mut self, task: &Task, action: &[f64]) -> anyhow::Result<()> {
        match &mut self.drive {
            Some(drive) if !self.over => {
                drive.step(task, action)?;
                self.over = drive.is_over();
                Ok(())
            }
            _ => self.reset(task),
        }
    }
}

/// Result of a step: observations (float32 of all drives), facts (float64 of all drives).
type Stepped<'py> = (Bound<'py, PyByteArray>, Bound<'py, PyByteArray>);

#[pymethods]
impl Drives {
    #[new]
    #[pyo3(signature = (scenario, level, observe, *, config=None, set=None, count=1, threads=1, rows=8, allow_code=false))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn new(
        scenario: FileOr<'_>,
        level: &str,
        observe: Vec<String>,
        config: Option<FileOr<'_>>,
        set: Option<Bound<'_, PyDict>>,
        count: usize,
        threads: usize,
        rows: usize,
        allow_code: bool,
    ) -> PyResult<Self> {
        let code = CodeArgs { allow_code };
        let inputs = Inputs::load(&scenario, config.as_ref(), set.as_ref(), None, code)?;
        let egos = inputs.scenario.egos().len();
        if egos > 1 {
            let message = format!(
                "the scenario has {egos} egos, expected one: swerve.pettingzoo has an agent for each"
            );
            return Err(PyValueError::new_err(message));
        }
        let task = Task::read(inputs, level, &observe, rows)?;
        let lane = |_| Lane { drive: None, seed: 0, count: 0, over: true };
        let pool = (threads > 1).then(|| rayon::ThreadPoolBuilder::new().num_threads(threads).build());
        let pool = pool.transpose().map_err(|e| error(e.into()))?;
        Ok(Self { task, drives: Mutex::new((0..count).map(lane).collect()), pool })
    }

    /// Observations in order: stream name, shape, data type, and names of the numbers.
    fn observations(&self) -> Vec<(String, Vec<usize>, &'static str, Vec<String>)> {
        self.task.observations()
    }

    /// Minimum, maximum and name of each number of an action.
    fn actions(&self) -> Vec<(f64, f64, String)> {
        self.task.actions()
    }

    /// Names of the facts.
    #[staticmethod]
    fn facts() -> Vec<&'static str> {
        FACTS.to_vec()
    }

    /// Time between decisions, seconds.
    fn period_s(&self) -> f64 {
        self.task.period_s()
    }

    /// Restarts the drive at `index` under a seed; without an index, all drives, each under a separate seed drawn from
    /// it.
    #[pyo3(signature = (seed, index=None))]
    fn reset<'py>(&self, py: Python<'py>, seed: i64, index: Option<usize>) -> PyResult<Stepped<'py>> {
        py.detach(|| {
            let mut lanes = self.lanes();
            let several = lanes.len() > 1;
            for (i, lane) in lanes.iter_mut().enumerate().filter(|(i, _)| index.is_none_or(|one| one == *i)) {
                lane.seed = match several && index.is_none() {
                    true => {
                        Rng::keyed(seed.cast_unsigned(), "lane", &[i as i64]).bits().cast_signed() & i64::MAX
                    }
                    false => seed,
                };
                lane.count = 0;
            }
            self.each(&mut lanes, |i, lane| match index.is_none_or(|one| one == i) {
                true => lane.reset(&self.task),
                false => Ok(()),
            })?;
            Ok(())
        })
        .map_err(error)?;
        self.state(py)
    }

    /// Continues to the next decision under actions (float64 of all drives, concatenated). A drive that is over
    /// restarts instead.
    fn step<'py>(&self, py: Python<'py>, actions: Vec<f64>) -> PyResult<Stepped<'py>> {
        let size = self.task.actions_len();
        py.detach(|| {
            let mut lanes = self.lanes();
            anyhow::ensure!(
                actions.len() == size * lanes.len(),
                "{} numbers of actions, expected {size} for each of {} drives",
                actions.len(),
                lanes.len()
            );
            self.each(&mut lanes, |i, lane| lane.step(&self.task, &actions[i * size..(i + 1) * size]))
        })
        .map_err(error)?;
        self.state(py)
    }

    /// Newest image of an observed stream, of the drive at `index`; `None` before the first.
    fn image(&self, index: usize, stream: &str) -> Option<Numbers> {
        self.lanes().get(index)?.drive.as_ref()?.image(&self.task, 0, stream)
    }

    /// True surroundings of the ego of the drive at `index`, for a picture: bodies and points of the route.
    fn scene(&self, index: usize) -> (Vec<[f64; 6]>, Vec<[f64; 5]>) {
        let lanes = self.lanes();
        lanes.get(index).and_then(|lane| lane.drive.as_ref()).map(|drive| drive.scene(0)).unwrap_or_default()
    }

    /// Reason for the end of the drive at `index`, if it ended: `goal`, `stopped`, `collision`, `timeout`.
    fn ended(&self, index: usize) -> Option<&'static str> {
        self.lanes().get(index)?.drive.as_ref()?.ended(0)
    }
}

impl Drives {
    fn lanes(&self) -> MutexGuard<'_, Vec<Lane>> {
        self.drives.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Applies a function to each drive, on several threads if available.
    fn each(
        &self,
        lanes: &mut [Lane],
        with: impl Fn(usize, &mut Lane) -> anyhow::Result<()> + Sync,
    ) -> anyhow::Result<()> {
        match &self.pool {
            Some(pool) if lanes.len() > 1 => {
                pool.install(|| lanes.par_iter_mut().enumerate().try_for_each(|(i, lane)| with(i, lane)))
            }
            _ => lanes.iter_mut().enumerate().try_for_each(|(i, lane)| with(i, lane)),
        }
    }

    fn state<'py>(&self, py: Python<'py>) -> PyResult<Stepped<'py>> {
        let lanes = self.lanes();
        let mut numbers: Vec<f32> = Vec::with_capacity(lanes.len() * self.task.numbers());
        let mut facts: Vec<f64> = Vec::with_capacity(lanes.len() * FACTS.len());
        for lane in lanes.iter() {
            let drive = lane.drive.as_ref();
            let drive = drive.ok_or_else(|| PyValueError::new_err("reset() comes before step()"))?;
            drive.observe(&self.task, &mut numbers);
            drive.facts(&mut facts);
        }
        Ok((bytes(py, &numbers, |x| x.to_le_bytes()), bytes(py, &facts, |x| x.to_le_bytes())))
    }
}

/// Numbers as bytes that NumPy may write to.
fn bytes<'py, T: Copy, const N: usize>(
    py: Python<'py>,
    numbers: &[T],
    bytes: impl Fn(T) -> [u8; N],
) -> Bound<'py, PyByteArray> {
    let all: Vec<u8> = numbers.iter().flat_map(|number| bytes(*number)).collect();
    PyByteArray::new(py, &all)
}
