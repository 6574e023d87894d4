//! Worker processes of a run: started, watched, restarted or given up, ended.

use core::time::Duration;
use std::io::Write as _;
use std::os::fd::OwnedFd;
use std::process::{Command, ExitStatus, Stdio};
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

use crate::event::{LATE_S, OnWorkerEvent, WorkerEvent};
use crate::folder::RunFolder;
use crate::interrupt::Interrupt;
use crate::lend::{Lender, Live, StreamMemory};
use crate::link::{Counts, Endpoint, LOOK_AROUND, Link, Patience, Waits, Watched, now};
use crate::service::Hub;
use crate::tail::Tail;
use crate::waker::Waker;
use crate::{IpcError, Traffic, WorkerSetup};

/// Reaction to the death of a worker process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnLoss {
    /// The worker is not restarted.
    #[default]
    Stop,
    /// The worker is restarted, with its operators in their initial state.
    Restart,
}

/// Specification of a worker to be started.
pub struct WorkerSpec {
    /// Name of the worker process.
    pub process: String,
    /// Operators whose steps the worker executes.
    pub operators: Vec<String>,
    /// Data from which the worker builds the graph of these operators.
    pub payload: Vec<u8>,
    /// Streams whose large payloads the worker reads in place, where the sensor writes them.
    pub streams: Vec<String>,
    /// Reaction to the death of the worker.
    pub on_loss: OnLoss,
    /// Time to spin before sleeping: the coordinator waiting for an answer, the worker waiting for a call.
    pub spin: Duration,
    /// A worker that has not answered a call after this time is killed.
    pub reply_within: Duration,
    /// Command that ends in [`work`](crate::work); it receives its [`WorkerSetup`] through standard input.
    pub command: Box<dyn Fn() -> Command + Send>,
}

/// Worker processes of a run, and all files of the run on the machine. Ended and removed on drop.
pub struct WorkerPool {
    workers: Vec<WorkerHandle>,
    memories: Vec<(StreamMemory, Arc<Live>)>,
    counts: Arc<Counts>,
    hub: Arc<Hub>,
    folder: RunFolder,
    interrupt: Interrupt,
}

/// The coordinator's handle of a worker.
struct WorkerHandle {
    process: String,
    link: Arc<Mutex<Link>>,
    shared: Arc<Shared>,
    ended: Channel<()>,
    watch: Option<JoinHandle<()>>,
}

/// State shared by the pool and the thread that watches a worker.
struct Shared {
    watched: Arc<Watched>,
    ending: AtomicBool,
}

impl Shared {
    /// Signals to the worker that its run is over.
    fn close(&self) {
        if let Some(waker) = &self.watched.life().waker {
            waker.close();
        }
    }
}

impl WorkerPool {
    /// Creates a pool without workers and removes the files of dead runs.
    ///
    /// # Errors
    /// If the run's files cannot be created, or shared memory is unavailable.
    pub fn new() -> Result<Self, IpcError> {
        Self::in_folder(RunFolder::create()?)
    }

    /// As [`new`](Self::new), in shared memory of this name, which other processes may join. A name consists of
    /// letters, digits and underscores and starts with a letter.
    ///
    /// # Errors
    /// As for [`new`](Self::new), and if another run has this name.
    pub fn named(name: &str) -> Result<Self, IpcError> {
        Self::in_folder(RunFolder::named(name)?)
    }

    fn in_folder(folder: RunFolder) -> Result<Self, IpcError> {
        let hub = Arc::new(Hub::join(&folder.address)?);
        let (workers, memories) = (Vec::new(), Vec::new());
        Ok(Self { workers, memories, counts: Arc::default(), hub, folder, interrupt: Interrupt::default() })
    }

    /// Lets this handle kill the workers that are started from now on.
    pub fn ended_by(&mut self, interrupt: &Interrupt) {
        self.interrupt = interrupt.clone();
    }

    /// Lends shared memory to a stream whose messages consist of `blocks` blocks. To be called before the workers that
    /// read the stream are started.
    ///
    /// # Errors
    /// If shared memory is unavailable.
    pub fn lend(&mut self, stream: &str, blocks: usize) -> Result<Box<dyn Memory>, IpcError> {
        let memory = u32::try_from(self.memories.len()).unwrap_or(u32::MAX);
        let of = StreamMemory { memory, stream: stream.to_owned(), blocks };
        let live = Arc::<Live>::default();
        let lender = Lender::new(self.hub.clone(), of.clone(), live.clone())?;
        self.memories.push((of, live));
        Ok(Box::new(lender))
    }

    /// Starts a worker without waiting until it is ready.
    ///
    /// # Errors
    /// If shared memory is unavailable, or the process cannot be started.
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
        let mut watch = Watch { spec, memories, address, shared, on_event, tail: None };
        let life = watch.start().map_err(|error| IpcError::Worker {
            process: process.clone(),
            why: format!("could not be started: {error}"),
        })?;
        let shared = watch.shared.clone();
        let thread = Builder::new().name(format!("swerve-watch-{process}")).spawn(move || {
            watch.watch(life);
            // The receiver may be gone if the pool was dropped while it was being set up.
            let _told = tell_end.send(());
        });
        let watch = Some(thread.map_err(IpcError::of("starting a thread"))?);
        self.interrupt.add(shared.watched.clone());
        self.workers.push(WorkerHandle { process, link: Arc::new(Mutex::new(link)), shared, ended, watch });
        Ok(())
    }

    /// Waits until all workers are ready.
    ///
    /// # Errors
    /// If a worker ends first, or is not ready in time.
    pub fn wait_ready(&self, within: Duration) -> Result<(), IpcError> {
        self.wait_ready_telling(within, within, &|_| {})
    }

    /// As [`wait_ready`](Self::wait_ready); after `told_after`, calls `tell` with the name of each worker that it still
    /// waits for.
    ///
    /// # Errors
    /// As for [`wait_ready`](Self::wait_ready).
    pub fn wait_ready_telling(
        &self,
        within: Duration,
        told_after: Duration,
        tell: &dyn Fn(&str),
    ) -> Result<(), IpcError> {
        let patience = Patience { until: now() + within, tell_at: now() + told_after, tell };
        self.workers.iter().try_for_each(|worker| lock(&worker.link).wait_ready(&patience))
    }

    /// Executor for the steps of one operator in a worker process; `None` if the pool has no such process.
    pub fn endpoint(&self, process: &str) -> Option<Box<dyn RemoteExecutor>> {
        let worker = self.workers.iter().find(|worker| worker.process == process)?;
        let start = worker.shared.watched.life().starts;
        Some(Box::new(Endpoint { link: worker.link.clone(), start }))
    }

    /// Traffic between the processes so far.
    pub fn traffic(&self) -> Traffic {
        self.counts.traffic()
    }

    /// Process IDs of the running workers, by name.
    pub fn processes(&self) -> Vec<(String, u32)> {
        let number = |worker: &WorkerHandle| worker.shared.watched.life().process_number();
        self.workers.iter().filter_map(|worker| Some((worker.process.clone(), number(worker)?))).collect()
    }

    /// Prefix of the names of this run's files in the shared-memory folder.
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

/// State of the thread that watches one worker.
struct Watch {
    spec: WorkerSpec,
    memories: Vec<StreamMemory>,
    address: crate::folder::Address,
    shared: Arc<Shared>,
    on_event: OnWorkerEvent,
    /// Standard error of the process.
    tail: Option<Tail>,
}

impl Watch {
    /// Starts the worker and sends it its setup. The returned descriptor becomes readable when the process ends.
    fn start(&mut self) -> std::io::Result<OwnedFd> {
        let start = self.shared.watched.life().starts + 1;
        let setup = WorkerSetup {
            address: self.address.clone(),
            process: self.spec.process.clone(),
            start,
            operators: self.spec.operators.clone(),
            payload: self.spec.payload.clone(),
            spin_us: u64::try_from(self.spec.spin.as_micros()).unwrap_or(u64::MAX),
            memories: self.memories.clone(),
        };
        let mut command = (self.spec.command)();
        // A separate process group: signals from the terminal reach only the coordinator.
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        // The coordinator's end closes however the coordinator ends, so a worker never outlives it.
        let (waker, there) = Waker::pair(LOOK_AROUND)?;
        // Standard output is the same socket: a program that forwards both, such as one that reaches another host,
        // passes on what the worker sends back.
        command.stdin(OwnedFd::from(there.try_clone()?)).stdout(OwnedFd::from(there));
        let child = command.stderr(Stdio::piped()).spawn();
        let program = command.get_program().to_string_lossy();
        let mut child =
            child.map_err(|error| std::io::Error::new(error.kind(), format!("`{program}`: {error}")))?;
        self.tail = child.stderr.take().map(Tail::of).transpose()?;
        // The command keeps the other end open for another child.
        drop(command);
        let end = pidfd_open(Pid::from_child(&child), PidfdFlags::empty())?;
        // A worker that ends before it has read the setup is detected by its end.
        let mut socket = waker.socket()?;
        // A worker that does not read the setup is detected because it never becomes ready.
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
            let said = self.tail.take().map_or_else(String::new, Tail::finish);
            if self.is_ending() {
                return;
            }
            let was_ready = {
                let mut life = self.shared.watched.life();
                (life.gone, life.ended, life.said) = (Some(why.clone()), why.clone(), said);
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

    /// Waits until the process ends for any reason; other threads may kill it meanwhile. Reports a restarted worker
    /// that is not ready in time.
    fn await_end(&self, life: &OwnedFd) {
        let mut late =
            Some(Timespec { tv_sec: LATE_S, tv_nsec: 0 }).filter(|_| self.shared.watched.life().starts > 1);
        loop {
            match poll(&mut [PollFd::new(life, PollFlags::IN)], late.as_ref()) {
                Err(Errno::INTR) => {}
                Ok(0) => {
                    late = None;
                    // A thread that finds it ready waits for this lock, so it reports `Restarted` after `Late`.
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

/// Maximum time for a worker to read its setup.
const SETUP_WITHIN: Duration = Duration::from_secs(10);

/// Number of times in a row that a worker may end before it is ready.
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
