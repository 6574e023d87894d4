//! `swerve.run`: runs one drive.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicI64, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::Context as _;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use swerve::Summary;
use swerve_drive::process::Processes;
use swerve_drive::program::Program;
use swerve_drive::shipped::Kind;
use swerve_drive::trust::CodeArgs;
use swerve_drive::{drive_pipeline, problems_error, read_scenario, run_start, set_up, story};
use swerve_flow::{EndReason, Event, Observer, StopHandle};
use swerve_ipc::Interrupt;
use swerve_log::{Reader, Recorder, RunStart};
use swerve_report::story::draw;
use swerve_scenario::Scenario;
use swerve_stack::pipeline::Pipeline;
use swerve_stack::{Registry, Setup};
use swerve_text::Document;
use swerve_why::of_run;

use crate::background::{LOOKS_OF_GRACE, do_in_background};
use crate::convert::{error, sets, toml_table};
use crate::streams::{Capture, Streams};

/// A path, or the content of such a file as a dictionary.
#[derive(FromPyObject)]
pub(crate) enum FileOr<'py> {
    Content(Bound<'py, PyDict>),
    File(PathBuf),
}

/// Inputs of a drive.
pub(crate) struct Inputs {
    pub(crate) config: Setup,
    pub(crate) scenario: Scenario,
    scenario_text: String,
    scenario_file: String,
}

/// Reads and checks a configuration.
pub(crate) fn load_config(
    config: Option<&FileOr<'_>>,
    set: Option<&Bound<'_, PyDict>>,
    seed: Option<i64>,
    code: CodeArgs,
) -> PyResult<Setup> {
    let mut sets = sets(set)?;
    sets.extend(seed.map(|seed| ("seed".to_owned(), seed.into())));
    let loaded = match config {
        None => Setup::load(None, &sets),
        Some(FileOr::File(path)) => {
            Kind::Config.config(&Registry::standard(), std::slice::from_ref(path), &sets)
        }
        Some(FileOr::Content(dict)) => Document::parse("config", text(dict)?)
            .map_err(swerve_text::Problems::from)
            .and_then(|document| Setup::from_document(&document, &sets)),
    };
    let is_file = matches!(config, Some(FileOr::File(_)));
    let mut loaded = loaded.map_err(|problems| error(problems_error(&problems)))?;
    // A dictionary comes from the calling program itself and is trusted.
    CodeArgs { allow_code: code.allow_code || !is_file }.apply(&mut loaded);
    Ok(loaded)
}

impl Inputs {
    /// Reads and checks the inputs.
    pub(crate) fn load(
        scenario: &FileOr<'_>,
        config: Option<&FileOr<'_>>,
        set: Option<&Bound<'_, PyDict>>,
        seed: Option<i64>,
        code: CodeArgs,
    ) -> PyResult<Self> {
        let config = load_config(config, set, seed, code)?;
        let (scenario, scenario_text, scenario_file) = load_scenario(scenario)?;
        Ok(Self { config, scenario, scenario_text, scenario_file })
    }
}

/// Reads and checks a scenario; also gives its text, and the name of its file.
pub(crate) fn load_scenario(scenario: &FileOr<'_>) -> PyResult<(Scenario, String, String)> {
    match scenario {
        FileOr::File(path) => {
            let scenario = read_scenario(path).map_err(error)?;
            let text = Kind::Scenario.text(path).map_err(|problem| error(problem.into()))?;
            Ok((scenario, text.into_owned(), path.display().to_string()))
        }
        FileOr::Content(dict) => {
            let text = text(dict)?;
            let scenario =
                Scenario::parse("scenario", &text).map_err(|problems| error(problems_error(&problems)))?;
            Ok((scenario, text, "scenario".into()))
        }
    }
}

fn text(dict: &Bound<'_, PyDict>) -> PyResult<String> {
    Ok(toml_table(dict)?.to_string())
}

/// Options of a run.
struct Wanted {
    threads: usize,
    streams: Option<Vec<String>>,
    log: Option<PathBuf>,
}

/// Reports the progress of a run, and ends it.
#[derive(Clone, Default)]
struct Reins {
    reached_ns: Arc<AtomicI64>,
    stop: Arc<Mutex<Option<StopHandle>>>,
    processes: Interrupt,
    /// Number of requests to stop so far.
    asked: Arc<AtomicU32>,
}

impl Observer for Reins {
    fn event(&mut self, event: &Event<'_>) {
        if let Event::Publication(publication) = event {
            self.reached_ns.store(publication.visible_at.ns(), Ordering::Relaxed);
        }
    }
}

impl Reins {
    fn stop(&self) {
        if let Some(stop) = &*self.stop.lock().unwrap_or_else(PoisonError::into_inner) {
            stop.stop();
        }
        // A step that goes on ends with its process.
        if self.asked.fetch_add(1, Ordering::Relaxed) >= LOOKS_OF_GRACE {
            self.processes.kill();
        }
    }
}

/// Result of a run.
struct Driven {
    metrics: String,
    story: String,
    streams: Streams,
    config: String,
    scenario: String,
}

fn drive(inputs: &Inputs, wanted: Wanted, reins: &Reins) -> anyhow::Result<Driven> {
    let Inputs { config, scenario, scenario_text, scenario_file } = inputs;
    let mut pipeline = Pipeline::build(config, scenario)?;
    *reins.stop.lock().unwrap_or_else(PoisonError::into_inner) = Some(pipeline.graph.stop_handle());
    let mut capture = Capture::new(wanted.streams);
    let described = pipeline.graph.describe()?;
    let streams = described.operators.iter().flat_map(|operator| &operator.outputs);
    capture.check(&streams.filter_map(|(name, _)| pipeline.names.own(name)).collect::<Vec<_>>())?;
    let mut told = reins.clone();
    let mut story = story(config, scenario, &pipeline);
    let mut recorder = match &wanted.log {
        Some(path) => {
            let start = run_start(config, scenario, Path::new(scenario_file));
            Some(recorder(path, &start, config, &pipeline)?)
        }
        None => None,
    };
    let processes = match config.process.is_empty() {
        true => None,
        false => Some(Processes::start_unless(&reins.processes, &Program::this()?, config, &mut pipeline)?),
    };
    let mut observers: Vec<&mut dyn Observer> = vec![&mut capture, &mut told, &mut story];
    observers.extend(recorder.as_mut().map(|recorder| recorder as &mut dyn Observer));
    let outcome = drive_pipeline(pipeline, config.seed, wanted.threads, &mut observers);
    drop(processes);
    let recorded = recorder.map_or(Ok(()), |recorder| recorder.finish().map(drop));
    let outcome = outcome?;
    recorded.context("writing the log")?;
    anyhow::ensure!(
        outcome.report.end != EndReason::Interrupted,
        "interrupted at {:.2} s",
        outcome.report.at.as_secs()
    );
    let log = wanted.log.as_deref();
    let why = log.and_then(|log| of_run(log, &config.registry, &outcome.metrics));
    story.conclude(&outcome.metrics, why.as_ref());
    Ok(Driven {
        metrics: serde_json::to_string(&Summary::of(config, scenario, &outcome, why))?,
        story: draw(&story).svg(),
        streams: capture.streams,
        config: config.to_text(),
        scenario: scenario_text.clone(),
    })
}

/// Creates a log; replaces an earlier log, but no other file.
fn recorder(path: &Path, start: &RunStart, config: &Setup, pipeline: &Pipeline) -> anyhow::Result<Recorder> {
    remove_log(path)?;
    let mut recorder = Recorder::create(path, start)?;
    set_up(&mut recorder, config, pipeline);
    Ok(recorder)
}

/// Removes an earlier log, but no other file.
pub(crate) fn remove_log(path: &Path) -> anyhow::Result<()> {
    if path.symlink_metadata().is_ok_and(|there| there.is_file()) && Reader::open(path).is_ok() {
        std::fs::remove_file(path).with_context(|| format!("removing {}", path.display()))?;
    }
    Ok(())
}

/// Runs a scenario; returns the result as a dictionary.
#[pyfunction]
#[pyo3(signature = (scenario, config=None, set=None, seed=None, *, threads=1, streams=None, log=None, progress=None, allow_code=false))]
#[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
pub(crate) fn run<'py>(
    py: Python<'py>,
    scenario: FileOr<'py>,
    config: Option<FileOr<'py>>,
    set: Option<Bound<'py, PyDict>>,
    seed: Option<i64>,
    threads: usize,
    streams: Option<Vec<String>>,
    log: Option<PathBuf>,
    progress: Option<Bound<'py, PyAny>>,
    allow_code: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let code = CodeArgs { allow_code };
    let inputs = Inputs::load(&scenario, config.as_ref(), set.as_ref(), seed, code)?;
    let until_s = inputs.scenario.end.timeout_s;
    let reins = Reins::default();
    let (told, stopper) = (reins.clone(), reins.clone());
    let wanted = Wanted { threads: threads.max(1), streams, log };
    let look = |_: Python<'_>| match &progress {
        Some(call) => {
            let now_s = told.reached_ns.load(Ordering::Relaxed) as f64 * 1e-9;
            call.call1((now_s, until_s)).map(drop)
        }
        None => Ok(()),
    };
    let driven = do_in_background(py, move || drive(&inputs, wanted, &reins), look, move || stopper.stop())?;
    let result = PyDict::new(py);
    result.set_item("metrics", driven.metrics)?;
    result.set_item("story", driven.story)?;
    result.set_item("config", driven.config)?;
    result.set_item("scenario", driven.scenario)?;
    result.set_item("streams", driven.streams.into_dict(py)?)?;
    Ok(result)
}
