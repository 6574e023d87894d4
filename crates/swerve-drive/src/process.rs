//! Processes of a run: the coordinator's side and the worker's side.
//!
//! Both sides build the same pipeline from the same texts. The coordinator drives it; each process named by
//! `[process.NAME]` takes the steps of its operators.

use core::time::Duration;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::Context as _;
use serde::{Deserialize, Serialize};
use swerve_flow::{Graph, SourceHandle};
use swerve_ipc::{
    Interrupt, IpcError, LATE_S, OnWorkerEvent, Traffic, WorkerEvent, WorkerPool, WorkerSetup, WorkerSpec,
    work,
};
use swerve_msg::{GoneProcess, Supervision};
use swerve_scenario::{MapText, Scenario};
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_stack::config::Config;
use swerve_stack::config::clock::Clock;
use swerve_stack::config::process::{ProcessConfig, SharedMemoryConfig};
use swerve_stack::pipeline::Pipeline;
use swerve_text::Document;

use crate::problems_error;
use crate::program::Program;
use crate::trust;

/// Time limit for a process to build its pipeline.
const READY_WITHIN: Duration = Duration::from_secs(60);

/// Delay after which a waiting message is printed.
const TOLD_AFTER: Duration = Duration::from_secs(2);

/// Start command of a process as in the configuration; `None` if it is this program.
fn started_by(config: &Config, process: &str) -> Option<String> {
    let start = &config.process.get(process)?.start;
    (!start.is_empty()).then(|| format!("process.{process}.start = {start:?}"))
}

fn waiting(config: &Config, process: &str) -> String {
    let by = started_by(config, process).map_or_else(String::new, |start| format!(" ({start})"));
    let seconds = READY_WITHIN.as_secs();
    format!("waiting for process `{process}` to say that it is ready{by}; it is given up after {seconds} s")
}

/// Error for a process that did not start, with its start command.
fn unready(program: &Program, config: &Config, error: IpcError) -> anyhow::Error {
    let IpcError::Worker { process, .. } = &error else { return error.into() };
    if let Some(own) = config.process.get(process).filter(|own| own.python.is_some()) {
        let python = program.python(own.interpreter.as_deref()).and_then(|python| python.check());
        return match python {
            Ok(()) => error.into(),
            Err(why) => why.context(format!("process.{process}.python")),
        };
    }
    match started_by(config, process) {
        Some(start) => {
            let error = error.to_string();
            // The end of its standard error comes last.
            let (error, said) = error.split_at(error.find(';').unwrap_or(error.len()));
            anyhow::anyhow!(
                "{error}: {start}: expected what ends in `swerve worker` and hands on standard input and output{said}"
            )
        }
        None => error.into(),
    }
}

#[expect(clippy::print_stderr, reason = "said beside the drive, which may never begin")]
fn tell(what: &str) {
    eprintln!("{what}");
}

/// Publishes lost and restarted processes, for the controller and the log.
fn on_event(supervisor: Option<SourceHandle<Supervision>>) -> OnWorkerEvent {
    let gone: Mutex<Vec<GoneProcess>> = Mutex::default();
    Arc::new(move |event| {
        let mut gone = gone.lock().unwrap_or_else(PoisonError::into_inner);
        match event {
            WorkerEvent::Gone { process, why } => {
                gone.retain(|one| one.process != process);
                gone.push(GoneProcess { process, why });
            }
            WorkerEvent::Late { process } => {
                let why = format!("was started again, and is not ready after {LATE_S} s");
                tell(&format!("process `{process}` {why}: it is waited for, and the ego is stopped"));
                gone.retain(|one| one.process != process);
                gone.push(GoneProcess { process, why });
            }
            WorkerEvent::Restarted { process } => gone.retain(|one| one.process != process),
        }
        if let Some(supervisor) = &supervisor {
            // After the end of the run there is no receiver.
            let _over = supervisor.send_now(Supervision { gone: gone.clone() });
        }
    })
}

/// Streams read by each process.
fn streams_read(config: &Config, pipeline: &Pipeline) -> anyhow::Result<Vec<(String, String)>> {
    let mut read = Vec::new();
    for operator in pipeline.graph.describe()?.operators {
        let Some(process) = config.process_of(&operator.name) else { continue };
        let streams = operator.inputs.into_iter().filter_map(|input| input.stream);
        read.extend(streams.map(|stream| (process.to_owned(), stream)));
    }
    Ok(read)
}

/// Program that starts a process: the configured command, else this program, or the Python interpreter with the
/// operator's class.
fn starting(program: &Program, name: &str, process: &ProcessConfig) -> anyhow::Result<Program> {
    if let Some((path, arguments)) = process.start.split_first() {
        return Ok(Program { path: path.into(), arguments: arguments.to_vec(), ..program.clone() });
    }
    let Some(class) = &process.python else { return Ok(program.with(&["worker"])) };
    let python = program.python(process.interpreter.as_deref());
    Ok(python.with_context(|| format!("process.{name}.python"))?.with(&["worker", class]))
}

/// Texts from which a process builds its pipeline.
#[derive(Serialize, Deserialize)]
struct Texts {
    config: String,
    scenario: String,
    map: Option<String>,
}

/// Processes of one run. They end when this is dropped.
pub struct Processes {
    workers: WorkerPool,
}

impl Processes {
    /// Starts the processes that a replay cannot do without: those that take steps in Python. Operators of the others
    /// are stepped in this process with the same results, and played-back operators need no process.
    ///
    /// # Errors
    /// Same as [`start`](Self::start).
    pub fn start_needed(config: &Setup, pipeline: &mut Pipeline) -> anyhow::Result<Option<Self>> {
        let mut needed: BTreeMap<String, ProcessConfig> = config
            .processes_elsewhere(&pipeline.assembly)
            .map(|(name, process)| (name.clone(), process.clone()))
            .collect();
        if needed.is_empty() {
            return Ok(None);
        }
        let described = pipeline.graph.describe()?;
        let is_stepped = |name: &String| described.operators.iter().any(|own| own.name == *name && !own.feed);
        for process in needed.values_mut() {
            process.operators.retain(is_stepped);
        }
        needed.retain(|_, process| !process.operators.is_empty());
        let mut setup = config.clone();
        (setup.process, setup.shared_memory) = (needed, SharedMemoryConfig::default());
        // Each process builds the whole pipeline, also of operators that are played back here.
        Self::start_of(&Interrupt::default(), &Program::this()?, (config, &setup), pipeline).map(Some)
    }

    /// Starts the processes of a configuration with this program, if it has any.
    ///
    /// # Errors
    /// Same as [`start`](Self::start).
    pub fn start_all(config: &Setup, pipeline: &mut Pipeline) -> anyhow::Result<Option<Self>> {
        let start = || Self::start(&Program::this()?, config, pipeline);
        (!config.process.is_empty()).then(start).transpose()
    }

    /// Starts the processes of a configuration and moves the steps of their operators there. `program` is this program.
    ///
    /// # Errors
    /// If the user has not consented to a program named in the configuration, if there is no shared memory, or if a
    /// process does not start.
    pub fn start(program: &Program, config: &Setup, pipeline: &mut Pipeline) -> anyhow::Result<Self> {
        Self::start_unless(&Interrupt::default(), program, config, pipeline)
    }

    /// Same as [`start`](Self::start); `interrupt` ends the processes, also one that hangs in its first import.
    ///
    /// # Errors
    /// Same as [`start`](Self::start).
    pub fn start_unless(
        interrupt: &Interrupt,
        program: &Program,
        config: &Setup,
        pipeline: &mut Pipeline,
    ) -> anyhow::Result<Self> {
        Self::start_of(interrupt, program, (config, config), pipeline)
    }

    /// Starts the processes of `config`, which build the pipeline of `whole`.
    fn start_of(
        interrupt: &Interrupt,
        program: &Program,
        (whole, config): (&Setup, &Setup),
        pipeline: &mut Pipeline,
    ) -> anyhow::Result<Self> {
        trust::check(config, config.process.keys())?;
        let texts = Texts {
            config: whole.to_text(),
            scenario: pipeline.scenario.text.to_string(),
            map: pipeline.scenario.road.map_text().map(|text| text.to_string()),
        };
        let payload = serde_json::to_vec(&texts)?;
        let mut workers = match &config.shared_memory.name {
            Some(name) => WorkerPool::named(name)?,
            None => WorkerPool::new()?,
        };
        workers.ended_by(interrupt);
        let read = streams_read(config, pipeline)?;
        for (stream, memory) in &pipeline.memory {
            if read.iter().any(|(_, read)| read == stream) {
                memory.share(workers.lend(stream, memory.arrays)?);
            }
        }
        let on_event = on_event(pipeline.take_source_of());
        for (name, process) in &config.process {
            let start = starting(program, name, process)?;
            let spec = WorkerSpec {
                process: name.clone(),
                operators: process.operators.clone(),
                payload: payload.clone(),
                streams: read.iter().filter(|(by, _)| by == name).map(|(_, stream)| stream.clone()).collect(),
                on_loss: process.on_loss,
                spin: process.spin(),
                reply_within: process.reply_within(),
                command: Box::new(move || start.command()),
            };
            workers.start(spec, on_event.clone())?;
        }
        workers
            .wait_ready_telling(READY_WITHIN, TOLD_AFTER, &|process| tell(&waiting(config, process)))
            .map_err(|error| unready(program, config, error))?;
        for (name, process) in &config.process {
            for operator in &process.operators {
                let endpoint = workers.endpoint(name).context("the process was just started")?;
                let _remote = pipeline.graph.operator(operator)?.remote(endpoint);
            }
        }
        Ok(Self { workers })
    }

    /// Traffic between the processes so far.
    pub fn traffic(&self) -> Traffic {
        self.workers.traffic()
    }

    /// Pool of the worker processes.
    pub fn workers(&self) -> &WorkerPool {
        &self.workers
    }
}

/// Main function of a worker process: takes the steps requested by the coordinator.
pub fn run_worker(registry: &Registry) -> anyhow::Result<()> {
    run_worker_with(registry, |_, _, pipeline| Ok(pipeline.graph))
}

/// Same as [`run_worker`], after `prepare` has modified the pipeline of this configuration.
///
/// # Errors
/// If it was not started by a run, if the run's shared memory is missing, or any error of `prepare`.
pub fn run_worker_with(
    registry: &Registry,
    prepare: impl FnOnce(&WorkerSetup, &Setup, Pipeline) -> anyhow::Result<Graph>,
) -> anyhow::Result<()> {
    let setup = WorkerSetup::read(std::io::stdin().lock())
        .context("reading from standard input what to do: `swerve worker` is started by `swerve run`")?;
    let texts: Texts = serde_json::from_slice(&setup.payload)?;
    let document = Document::parse("configuration of the run", texts.config)?;
    let config =
        Setup::from_document_with(registry, &document, &[]).map_err(|problems| problems_error(&problems))?;
    let map = texts.map.map(MapText::from);
    let scenario = Scenario::parse_on("scenario of the run", &texts.scenario, map.as_ref(), &[])
        .map_err(|problems| problems_error(&problems))?;
    // Cameras and lidars are not stepped here.
    let pipeline = Pipeline::build_without_stage(&config, &scenario)?;
    let worker = prepare(&setup, &config, pipeline)?.into_worker(&setup.operators)?;
    Ok(work(&setup, worker)?)
}

/// Number of threads of a run. Under wall clock each process needs one that waits for it, in addition to the requested
/// ones.
pub fn threads(asked: usize, config: &Config) -> usize {
    match config.clock.source {
        Clock::Virtual => asked,
        Clock::Wall => asked + config.process.len(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waiting_and_giving_up_name_the_missing_process() {
        let text = "[process.far]\noperators = [\"planner\"]\nstart = [\"sleep\", \"100\"]\n\
                    [process.near]\noperators = [\"tracker\"]\n";
        let config = Setup::from_document(&Document::parse("c.toml", text).unwrap(), &[]).unwrap();
        let start = "process.far.start = [\"sleep\", \"100\"]";
        assert_eq!(
            waiting(&config, "far"),
            format!("waiting for process `far` to say that it is ready ({start}); it is given up after 60 s")
        );
        assert!(waiting(&config, "near").contains("ready; it is"));
        let program = Program::this().unwrap();
        let late = |process: &str| IpcError::Worker { process: process.into(), why: "is late".into() };
        let said = unready(&program, &config, late("far")).to_string();
        assert!(
            said.starts_with(&format!("process `far` is late: {start}: expected what ends in `swerve")),
            "{said}"
        );
        assert_eq!(unready(&program, &config, late("near")).to_string(), "process `near` is late");
    }
}
