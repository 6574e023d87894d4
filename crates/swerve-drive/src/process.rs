//! The processes of a run, from the coordinator's side; and what such a process does.
//!
//! Both sides build the same pipeline from the same texts. The coordinator drives it, and has the steps of the
//! operators that `[process.NAME]` names taken by the process of that name.

use core::time::Duration;
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::Context as _;
use serde::{Deserialize, Serialize};
use swerve_flow::{Graph, SourceHandle};
use swerve_ipc::{OnWorkerEvent, Setup, Traffic, WorkerEvent, WorkerPool, WorkerSpec, work};
use swerve_msg::{GoneProcess, Supervision};
use swerve_scenario::Scenario;
use swerve_stack::Registry;
use swerve_stack::config::Config;
use swerve_stack::pipeline::Pipeline;
use swerve_text::Document;

use crate::problems_error;
use crate::program::Program;

/// A process that takes longer to build its pipeline is given up.
const READY_WITHIN: Duration = Duration::from_secs(60);

/// Passes on what becomes of processes, so that the controller reads it and the log has it.
fn on_event(supervisor: Option<SourceHandle<Supervision>>) -> OnWorkerEvent {
    let gone: Mutex<Vec<GoneProcess>> = Mutex::default();
    Arc::new(move |event| {
        let mut gone = gone.lock().unwrap_or_else(PoisonError::into_inner);
        match event {
            WorkerEvent::Gone { process, why } => {
                gone.retain(|one| one.process != process);
                gone.push(GoneProcess { process, why });
            }
            WorkerEvent::Restarted { process } => gone.retain(|one| one.process != process),
        }
        if let Some(supervisor) = &supervisor {
            // A run that is over has nobody to be told.
            let _over = supervisor.send_now(Supervision { gone: gone.clone() });
        }
    })
}

/// Which process reads which streams.
fn streams_read(config: &Config, pipeline: &Pipeline) -> anyhow::Result<Vec<(String, String)>> {
    let mut read = Vec::new();
    for operator in pipeline.graph.describe()?.operators {
        let Some(process) = config.process_of(&operator.name) else { continue };
        let streams = operator.inputs.into_iter().filter_map(|input| input.stream);
        read.extend(streams.map(|stream| (process.to_owned(), stream)));
    }
    Ok(read)
}

/// What a process builds its pipeline from.
#[derive(Serialize, Deserialize)]
struct Texts {
    config: String,
    scenario: String,
}

/// The processes of one run. They end with this.
pub struct Processes {
    workers: WorkerPool,
}

impl Processes {
    /// Starts the processes of a configuration, and has the steps of their operators taken there. `program` is
    /// this program; `scenario` the text of the pipeline's.
    ///
    /// # Errors
    /// When there is no shared memory, or a process does not come up.
    pub fn start(
        program: &Program,
        config: &Config,
        scenario: &str,
        pipeline: &mut Pipeline,
    ) -> anyhow::Result<Self> {
        let texts = Texts { config: config.to_text(), scenario: scenario.to_owned() };
        let payload = serde_json::to_vec(&texts)?;
        let mut workers = match &config.shared_memory.name {
            Some(name) => WorkerPool::named(name)?,
            None => WorkerPool::new()?,
        };
        let read = streams_read(config, pipeline)?;
        for (stream, memory) in &pipeline.memory {
            if read.iter().any(|(_, read)| read == stream) {
                memory.share(workers.lend(stream, memory.arrays)?);
            }
        }
        let on_event = on_event(pipeline.take_source_of());
        for (name, process) in &config.process {
            let start = match process.start.split_first() {
                Some((path, arguments)) => {
                    Program { path: path.into(), arguments: arguments.to_vec(), ..program.clone() }
                }
                None => {
                    let worker = ["worker".to_owned()];
                    let arguments = program.arguments.iter().cloned().chain(worker).collect();
                    Program { arguments, ..program.clone() }
                }
            };
            let spec = WorkerSpec {
                process: name.clone(),
                operators: process.operators.clone(),
                payload: payload.clone(),
                streams: read.iter().filter(|(by, _)| by == name).map(|(_, stream)| stream.clone()).collect(),
                on_loss: process.on_loss,
                spin: process.spin(),
                command: Box::new(move || start.command()),
            };
            workers.start(spec, on_event.clone())?;
        }
        workers.wait_ready(READY_WITHIN)?;
        for (name, process) in &config.process {
            for operator in &process.operators {
                let endpoint = workers.endpoint(name).context("the process was just started")?;
                let _remote = pipeline.graph.operator(operator)?.remote(endpoint);
            }
        }
        Ok(Self { workers })
    }

    /// What went between the processes so far.
    pub fn traffic(&self) -> Traffic {
        self.workers.traffic()
    }

    /// The processes and who they are.
    pub fn workers(&self) -> &WorkerPool {
        &self.workers
    }
}

/// What a process of a run does: it takes the steps that it is called for.
pub fn run_worker(registry: &Registry) -> anyhow::Result<()> {
    run_worker_with(registry, |_, graph| Ok(graph))
}

/// The same, after `prepare` has had a hand in the graph whose operators' steps it takes.
///
/// # Errors
/// When it was not started by a run, or the run's shared memory is not there; or as `prepare`.
pub fn run_worker_with(
    registry: &Registry,
    prepare: impl FnOnce(&Setup, Graph) -> anyhow::Result<Graph>,
) -> anyhow::Result<()> {
    let setup = Setup::read(std::io::stdin().lock())
        .context("reading from standard input what to do: `swerve worker` is started by `swerve run`")?;
    let texts: Texts = serde_json::from_slice(&setup.payload)?;
    let document = Document::parse("configuration of the run", texts.config)?;
    let config =
        Config::from_document_with(registry, &document, &[]).map_err(|problems| problems_error(&problems))?;
    let scenario = Scenario::parse("scenario of the run", &texts.scenario)
        .map_err(|problems| problems_error(&problems))?;
    // Neither cameras nor lidars are stepped here.
    let pipeline = Pipeline::build_without_stage(&config, &scenario)?;
    let worker = prepare(&setup, pipeline.graph)?.into_worker(&setup.operators)?;
    Ok(work(&setup, worker)?)
}
