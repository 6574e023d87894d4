//! The workers of a run: started, watched, started again or given up, ended.

use core::time::Duration;
use std::io::Write as _;
use std::os::fd::OwnedFd;
use std::process::{Command, ExitStatus};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver as Channel, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::process::{Pid, PidfdFlags, pidfd_open};
use serde::{Deserialize, Serialize};
use swerve_flow::RemoteExecutor;
use swerve_msg::block::Memory;

use crate::folder::RunFolder;
use crate::lend::{Lender, Live, StreamMemory};
use crate::link::{Counts, Endpoint, LOOK_AROUND, Link, Patience, Waits, Watched, now};
use crate::service::Hub;
use crate::waker::Waker;
use crate::{IpcError, Setup, Traffic};

/// What becomes of a worker that died.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnLoss {
    /// It is not started again.
    #[default]
    Stop,
    /// It is started again, with operators in their first state.
    Restart,
}

/// A worker to be started.
pub struct WorkerSpec {
    /// Its name.
    pub process: String,
    /// The operators whose steps it takes.
    pub operators: Vec<String>,
    /// What it needs to build the graph of which they are.
    pub payload: Vec<u8>,
    /// The streams of which it reads big payloads where the sensor writes them.
    pub streams: Vec<String>,
    /// What becomes of it when it dies.
    pub on_loss: OnLoss,
    /// For so long its answers are waited for, and its calls by itself, without sleeping.
    pub spin: Duration,
    /// A worker that has not answered a call after so long is killed.
    pub reply_within: Duration,
    /// The command that ends in [`work`](crate::work); gets its [`Setup`] through standard input.
    pub command: Box<dyn Fn() -> Command + Send>,
}

/// Something that befell a worker.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WorkerEvent {
    /// It is gone.
    Gone {
        /// Which.
        process: String,
        /// How it ended.
        why: String,
    },
    /// It was started again, and is not ready after [`LATE_S`] seconds.
    Late {
        /// Which.
        process: String,
    },
    /// It was started again, and is ready.
    Restarted {
        /// Which.
        process: String,
    },
}

/// The callback that worker events go to.
pub type OnWorkerEvent = Arc<dyn Fn(WorkerEvent) + Send + Sync>;

/// The workers of a run, and all that a run has on the machine. Ends and removes them when it is dropped.
pub struct WorkerPool {
    workers: Vec<WorkerHandle>,
    memories: Vec<(StreamMemory, Arc<Live>)>,
    counts: Arc<Counts>,
    hub: Arc<Hub>,
    folder: RunFolder,
}

/// A worker as the coordinator has it.
struct WorkerHandle {
    process: String,
    link: Arc<Mutex<Link>>,
    shared: Arc<Shared>,
    ended: Channel<()>,
    watch: Option<JoinHandle<()>>,
}

/// What the thread that watches a worker shares with the pool.
struct Shared {
    watched: Arc<Watched>,
    ending: AtomicBool,
}

impl Shared {
    /// Tells the worker that its run is over.
    fn close(&self) {
        if let Some(waker) = &self.watched.life().waker {
            waker.close();
        }
    }
}

impl WorkerPool {
    /// Nobody yet. What dead runs left is removed.
    ///
    /// # Errors
    /// When there is no place for the run's files, or no shared memory.
    pub fn new() -> Result<Self, IpcError> {
        Self::in_folder(RunFolder::create()?)
    }

    /// As [`new`](Self::new), in shared memory of this name, which others may join: letters, digits and underscores,
    /// a letter first.
    ///
    /// # Errors
    /// As there, and when another run has this name.
    pub fn named(name: &str) -> Result<Self, IpcError> {
        Self::in_folder(RunFolder::named(name)?)
    }

    fn in_folder(folder: RunFolder) -> Result<Self, IpcError> {
        let hub = Arc::new(Hub::join(&folder.address)?);
        Ok(Self { workers: Vec::new(), memories: Vec::new(), counts: Arc::default(), hub, folder })
    }

    /// Shared memory for a stream whose messages consist of so many blocks. To be lent before workers start
    /// that read it.
    ///
    /// # Errors
    /// When there is no shared memory.
    pub fn lend(&mut self, stream: &str, blocks: usize) -> Result<Box<dyn Memory>, IpcError> {
        let memory = u32::try_from(self.memories.len()).unwrap_or(u32::MAX);
        let of = StreamMemory { memory, stream: stream.to_owned(), blocks };
        let live = Arc::<Live>::default();
        let lender = Lender::new(self.hub.clone(), of.clone(), live.clone())?;
        self.memories.push((of, live));
        Ok(Box::new(lender))
    }

    /// Starts a worker, without waiting until it is ready.
    ///
    /// # Errors
    /// When there is no shared memory, or the process cannot be started.
    pub fn start(&mut self, spec: WorkerSpec, on_event: OnWorkerEvent) -> Result<(), IpcError> {
        let process = spec.process.clone();
        let watched = Arc::new(Watched::default());
        let reads = |(of, _): &&(StreamMemory, _)| spec.streams.contains(&of.stream);
        let (memories, lives) = self.memories.iter().filter(reads).cloned().unzip();
        let counts = self.counts.clone();
        let waits = Waits { spin: spec.spin, reply_within: spec.reply_within };
        let link = Link::new(&self.hub, &process, waits, lives, watched.clone(), counts, on_event.clone())?;
        let shared = Arc::new(Shared { watched, ending: AtomicBool::new(false) });
        let (tell_end, ended) = sync_channel(1);
        let address = self.folder.address.clone();
        let mut watch = Watch { spec, memories, address, shared, on_event };
        let life = watch.start().map_err(|error| IpcError::Worker {
            process: process.clone(),
            why: format!("could not be started: {error}"),
        })?;
        let shared = watch.shared.clone();
        let thread = Builder::new().name(format!("swerve-watch-{process}")).spawn(move || {
            watch.watch(life);
            // Nobody waits for it where the pool was not ended but dropped half made.
            let _told = tell_end.send(());
        });
        let watch = Some(thread.map_err(IpcError::of("starting a thread"))?);
        self.workers.push(WorkerHandle { process, link: Arc::new(Mutex::new(link)), shared, ended, watch });
        Ok(())
    }

    /// Waits until all are ready.
    ///
    /// # Errors
    /// When one of them ended, or takes longer.
    pub fn wait_ready(&self, within: Duration) -> Result<(), IpcError> {
        self.wait_ready_telling(within, within, &|_| {})
    }

    /// The same; `tell` is told the names of those that are still waited for after a time.
    ///
    /// # Errors
    /// As [`wait_ready`](Self::wait_ready).
    pub fn wait_ready_telling(
        &self,
        within: Duration,
        told_after: Duration,
        tell: &dyn Fn(&str),
    ) -> Result<(), IpcError> {
        let patience = Patience { until: now() + within, tell_at: now() + told_after, tell };
        self.workers.iter().try_for_each(|worker| lock(&worker.link).wait_ready(&patience))
    }

    /// What takes the steps of one operator; none if there is no such process.
    pub fn endpoint(&self, process: &str) -> Option<Box<dyn RemoteExecutor>> {
        let worker = self.workers.iter().find(|worker| worker.process == process)?;
        let start = worker.shared.watched.life().starts;
        Some(Box::new(Endpoint { link: worker.link.clone(), start }))
    }

    /// What went between the processes so far.
    pub fn traffic(&self) -> Traffic {
        self.counts.traffic()
    }

    /// The process numbers of those that run, by name.
    pub fn processes(&self) -> Vec<(String, u32)> {
        let number = |worker: &WorkerHandle| worker.shared.watched.life().process_number();
        self.workers.iter().filter_map(|worker| Some((worker.process.clone(), number(worker)?))).collect()
    }

    /// What the names of this run's files in the shared-memory folder start with.
    pub fn prefix(&self) -> &str {
        &self.folder.address.prefix
    }
}

impl Drop for WorkerPool {
    fn drop(&mut self) {
        const GRACE: Duration = Duration::from_millis(500);
        for worker in &self.workers {
            worker.shared.ending.store(true, Ordering::SeqCst);
            worker.shared.close();
        }
        for worker in &mut self.workers {
            if worker.ended.recv_timeout(GRACE) == Err(RecvTimeoutError::Timeout) {
                worker.shared.watched.life().kill();
            }
            if let Some(watch) = worker.watch.take() {
                let _done = watch.join();
            }
        }
    }
}

/// The thread that watches one worker.
struct Watch {
    spec: WorkerSpec,
    memories: Vec<StreamMemory>,
    address: crate::folder::Address,
    shared: Arc<Shared>,
    on_event: OnWorkerEvent,
}

impl Watch {
    /// Starts the worker and hands it its setup. What is returned becomes readable when the process ends.
    fn start(&mut self) -> std::io::Result<OwnedFd> {
        let start = self.shared.watched.life().starts + 1;
        let setup = Setup {
            address: self.address.clone(),
            process: self.spec.process.clone(),
            start,
            operators: self.spec.operators.clone(),
            payload: self.spec.payload.clone(),
            spin_us: u64::try_from(self.spec.spin.as_micros()).unwrap_or(u64::MAX),
            memories: self.memories.clone(),
        };
        let mut command = (self.spec.command)();
        // A group of its own: what the terminal sends to the coordinator is the coordinator's business.
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        // Our end closes with the coordinator, whatever ends that: a worker never outlives it.
        let (waker, there) = Waker::pair(LOOK_AROUND)?;
        // Standard output is the same: a program that hands both on, such as one that reaches another host, passes
        // through what the worker answers.
        let child = command.stdin(OwnedFd::from(there.try_clone()?)).stdout(OwnedFd::from(there)).spawn();
        let program = command.get_program().to_string_lossy();
        let child =
            child.map_err(|error| std::io::Error::new(error.kind(), format!("`{program}`: {error}")))?;
        // The command keeps the other end for another child.
        drop(command);
        let end = pidfd_open(Pid::from_child(&child), PidfdFlags::empty())?;
        // A worker that does not live long enough to read it is found out by its end.
        let mut socket = waker.socket()?;
        // One that does not read is found out by not being ready.
        socket.set_write_timeout(Some(SETUP_WITHIN))?;
        let _read = socket.write_all(&setup.framed());
        let mut life = self.shared.watched.life();
        (life.starts, life.gone, life.waker) = (start, None, Some(Arc::new(waker)));
        life.begin(child);
        Ok(end)
    }

    fn watch(mut self, mut life: OwnedFd) {
        let mut futile = 0;
        loop {
            self.await_end(&life);
            let (child, hung) = self.shared.watched.life().end();
            let status = child.map(|mut child| child.wait());
            let why = hung.unwrap_or_else(|| ended(status));
            if self.is_ending() {
                return;
            }
            let was_ready = {
                let mut life = self.shared.watched.life();
                (life.gone, life.ended) = (Some(why.clone()), why.clone());
                life.ready == life.starts
            };
            self.shared.watched.tell_end();
            let process = self.spec.process.clone();
            (self.on_event)(WorkerEvent::Gone { process: process.clone(), why });
            futile = if was_ready { 0 } else { futile + 1 };
            if self.spec.on_loss == OnLoss::Stop || futile > FUTILE_MAX {
                return;
            }
            match self.start() {
                Ok(next) => life = next,
                Err(error) => {
                    let why = format!("cannot be started again: {error}");
                    self.shared.watched.life().gone = Some(why.clone());
                    (self.on_event)(WorkerEvent::Gone { process, why });
                    return;
                }
            }
            if self.is_ending() {
                self.shared.close();
            }
        }
    }

    /// Waits until a process ends, however that is; meanwhile others may kill it. Says where one that was started again
    /// does not come to be ready.
    fn await_end(&self, life: &OwnedFd) {
        let mut late =
            Some(Timespec { tv_sec: LATE_S, tv_nsec: 0 }).filter(|_| self.shared.watched.life().starts > 1);
        loop {
            match poll(&mut [PollFd::new(life, PollFlags::IN)], late.as_ref()) {
                Err(Errno::INTR) => {}
                Ok(0) => {
                    late = None;
                    // Whoever finds it ready waits for this lock: that is said after this.
                    let life = self.shared.watched.life();
                    if life.ready != life.starts {
                        (self.on_event)(WorkerEvent::Late { process: self.spec.process.clone() });
                    }
                }
                _ => return,
            }
        }
    }

    fn is_ending(&self) -> bool {
        self.shared.ending.load(Ordering::SeqCst)
    }
}

/// A worker that was started again and is not ready after so many seconds is told.
pub const LATE_S: i64 = 1;

/// Longest time for a worker to read its setup.
const SETUP_WITHIN: Duration = Duration::from_secs(10);

/// So many times in turn a worker may end before it is ready.
const FUTILE_MAX: u32 = 3;

fn ended(status: Option<std::io::Result<ExitStatus>>) -> String {
    match status {
        Some(Ok(status)) => format!("ended ({status})"),
        _ => "ended".to_owned(),
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
