//! A call to a worker and its answer.
//!
//! A call is preceded by eight bytes for each memory that the worker reads: the number of the oldest block that calls
//! may name. Calls and answers are in loaned slices of shared memory; a [`Waker`] wakes the process that waits for
//! them.

use core::time::Duration;
use std::process::Child;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use rustix::process::{Pid, Signal, kill_process_group};
use serde::Serialize;
use swerve_flow::{Answered, Call, Lost, RemoteExecutor};
use swerve_msg::block::writing;

use crate::IpcError;
use crate::event::{OnWorkerEvent, WorkerEvent};
use crate::lend::Live;
use crate::message::{Head, Kind, TALK};
use crate::service::{Hub, Receiver, Sender};
use crate::waker::{Listener, Signal as Heard, Timeout, Waker};

/// Maximum sleep of a process that waits for the other end; every event wakes it earlier.
pub(crate) const LOOK_AROUND: Duration = Duration::from_millis(20);

/// Time without an answer after which a call is repeated: between two hosts it may have been lost.
const CALL_AGAIN: Duration = Duration::from_millis(500);

/// Names of the services between the coordinator and one worker.
pub(crate) struct Names {
    pub(crate) calls: String,
    pub(crate) answers: String,
}

impl Names {
    pub(crate) fn of(process: &str) -> Self {
        let name = |what: &str| format!("{what}/{process}");
        Self { calls: name("calls"), answers: name("answers") }
    }
}

/// Traffic between the processes of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Traffic {
    /// Steps executed in workers.
    pub calls: u64,
    /// Bytes of calls and answers.
    pub bytes: u64,
    /// Copied bytes among these: image and point cloud arrays, and answers, longer than [`BIG`](Traffic::BIG).
    pub copied: u64,
    /// Number of such arrays read in place instead.
    pub in_place: u64,
}

impl Traffic {
    /// Size from which copying dominates the cost, bytes.
    pub const BIG: usize = 64 * 1024;
}

#[derive(Default)]
pub(crate) struct Counts {
    calls: AtomicU64,
    bytes: AtomicU64,
    copied: AtomicU64,
    in_place: AtomicU64,
}

impl Counts {
    pub(crate) fn traffic(&self) -> Traffic {
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Traffic {
            calls: read(&self.calls),
            bytes: read(&self.bytes),
            copied: read(&self.copied),
            in_place: read(&self.in_place),
        }
    }

    fn add(counter: &AtomicU64, n: usize) {
        counter.fetch_add(n as u64, Ordering::Relaxed);
    }
}

/// State of a worker process, and the notification of its end.
#[derive(Default)]
pub(crate) struct Watched {
    life: Mutex<Life>,
    ended: Condvar,
}

#[derive(Default)]
pub(crate) struct Life {
    /// Number of starts.
    pub(crate) starts: u64,
    /// Last start that became ready.
    pub(crate) ready: u64,
    /// Reason why the worker is gone; `None` while it is alive.
    pub(crate) gone: Option<String>,
    /// Reason for its last end.
    pub(crate) ended: String,
    /// Last lines of its standard error, after a heading; empty if there are none.
    pub(crate) said: String,
    /// Wake-up channel between the worker and the coordinator.
    pub(crate) waker: Option<Arc<Waker>>,
    /// Process, from its start to its end.
    child: Option<Child>,
    /// Reason why it was killed, if it hung or its run was interrupted.
    hung: Option<String>,
}

/// Process groups of all workers of this program.
static GROUPS: Mutex<Vec<Pid>> = Mutex::new(Vec::new());

/// Kills all workers of this program at once, including stopped and hung ones.
pub fn kill_workers() {
    let groups = GROUPS.lock().unwrap_or_else(PoisonError::into_inner);
    for group in &*groups {
        // Fails for a group that has just ended.
        let _gone = kill_process_group(*group, Signal::KILL);
    }
}

impl Life {
    /// Records a process that was just started, in a separate process group.
    pub(crate) fn begin(&mut self, child: Child) {
        GROUPS.lock().unwrap_or_else(PoisonError::into_inner).push(Pid::from_child(&child));
        (self.child, self.hung) = (Some(child), None);
    }

    /// Returns the ended process, to be reaped, and the reason why it was killed if it hung.
    pub(crate) fn end(&mut self) -> (Option<Child>, Option<String>) {
        let child = self.child.take();
        if let Some(child) = &child {
            let ended = Pid::from_child(child);
            GROUPS.lock().unwrap_or_else(PoisonError::into_inner).retain(|group| *group != ended);
        }
        (child, self.hung.take())
    }

    /// Process ID, while the process exists.
    pub(crate) fn process_number(&self) -> Option<u32> {
        self.child.as_ref().map(Child::id)
    }

    /// Kills the process and its children, once, for a reason that its end then has.
    pub(crate) fn kill_for(&mut self, why: impl Into<String>) {
        if self.child.is_some() && self.hung.is_none() {
            self.hung = Some(why.into());
            self.kill();
        }
    }

    /// Kills the process and its children.
    pub(crate) fn kill(&self) {
        if let Some(child) = &self.child {
            // Not reaped yet, so the process ID is still valid. Fails for a process that has just ended.
            let _gone = kill_process_group(Pid::from_child(child), Signal::KILL);
        }
    }
}

impl Watched {
    pub(crate) fn life(&self) -> MutexGuard<'_, Life> {
        self.life.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notifies waiting threads that the end of the worker is recorded.
    pub(crate) fn tell_end(&self) {
        self.ended.notify_all();
    }

    /// Waits at most [`LOOK_AROUND`] until the end of start `start` is recorded.
    fn wait_end(&self, start: u64) {
        let life = self.life();
        if life.gone.is_none() && life.starts == start {
            let _soon = self.ended.wait_timeout(life, LOOK_AROUND);
        }
    }
}

/// Timing of the wait for a worker's answers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Waits {
    /// Time to spin before sleeping.
    pub(crate) spin: Duration,
    /// A worker that takes longer is killed.
    pub(crate) reply_within: Duration,
}

/// Limits of the wait for a worker to become ready.
pub(crate) struct Patience<'a> {
    /// Time at which the worker is given up.
    pub(crate) until: Instant,
    /// Time at which `tell` is called.
    pub(crate) tell_at: Instant,
    /// Callback with the name of a worker that is still waited for.
    pub(crate) tell: &'a dyn Fn(&str),
}

/// The coordinator's end of the connection to one worker.
pub(crate) struct Link {
    process: String,
    calls: Sender,
    answers: Receiver,
    /// Listener of the worker's last start.
    listener: Option<Listener>,
    waits: Waits,
    /// Memories that the worker reads.
    lives: Vec<Arc<Live>>,
    watched: Arc<Watched>,
    counts: Arc<Counts>,
    on_event: OnWorkerEvent,
    /// Start of the worker that the last call went to.
    start: u64,
    /// Last start that reported that it is ready.
    ready: u64,
    seq: u64,
    call: Vec<u8>,
}

impl Link {
    pub(crate) fn new(
        hub: &Hub,
        process: &str,
        waits: Waits,
        lives: Vec<Arc<Live>>,
        watched: Arc<Watched>,
        counts: Arc<Counts>,
        on_event: OnWorkerEvent,
    ) -> Result<Self, IpcError> {
        const CALL_BYTES: usize = 16 * 1024;
        let names = Names::of(process);
        Ok(Self {
            process: process.to_owned(),
            calls: hub.sender(&names.calls, TALK, CALL_BYTES)?,
            answers: hub.receiver(&names.answers, TALK)?,
            listener: None,
            waits,
            lives,
            watched,
            counts,
            on_event,
            start: 0,
            ready: 0,
            seq: 0,
            call: Vec::new(),
        })
    }

    /// Waits until the worker reports that it is ready.
    pub(crate) fn wait_ready(&mut self, patience: &Patience<'_>) -> Result<(), IpcError> {
        let mut told = false;
        let error = |process: &str, why: String| IpcError::Worker { process: process.to_owned(), why };
        while self.connect().is_err() {
            let life = self.watched.life();
            if let Some(why) = &life.gone {
                return Err(error(&self.process, format!("{why} before it was ready{}", life.said)));
            }
            drop(life);
            if now() >= patience.until {
                return Err(error(&self.process, "did not say in time that it is ready".into()));
            }
            if !told && now() >= patience.tell_at {
                told = true;
                (patience.tell)(&self.process);
            }
            self.receive_ready(Timeout::Set);
        }
        Ok(())
    }

    /// Receives one signal from the worker; records the start if it reports that it is ready.
    fn receive_ready(&mut self, timeout: Timeout) {
        match self.listener.as_mut().map_or(Heard::Closed, |listener| listener.listen(timeout)) {
            Heard::Ready(start) => self.ready = start,
            Heard::Closed if timeout == Timeout::Set => self.watched.wait_end(self.start),
            Heard::Wake | Heard::TimedOut | Heard::Closed => {}
        }
    }

    /// Ensures that the worker takes calls; returns the number of its start.
    fn connect(&mut self) -> Result<u64, Lost> {
        let (starts, ready) = {
            let life = self.watched.life();
            if let Some(why) = &life.gone {
                return Err(self.lost(why));
            }
            if life.starts != self.start {
                (self.start, self.listener) = (life.starts, life.waker.clone().map(Listener::at));
            }
            (life.starts, life.ready)
        };
        if ready < starts {
            self.receive_ready(Timeout::Zero);
            if self.ready != starts {
                let ended = self.watched.life().ended.clone();
                return Err(self.lost(&format!("{ended} and is not ready yet")));
            }
            self.watched.life().ready = starts;
            if starts > 1 {
                (self.on_event)(WorkerEvent::Restarted { process: self.process.clone() });
            }
        }
        Ok(starts)
    }

    fn lost(&self, why: &str) -> Lost {
        Lost(format!("process `{}` {why}", self.process))
    }

    /// Executes one step in the worker; returns the number of its start.
    fn step(&mut self, call: &Call<'_>, answer: &mut Vec<u8>) -> Result<u64, Lost> {
        let start = self.connect()?;
        Counts::add(&self.counts.calls, 1);
        let mut kind = self.send_and_wait(call, true, answer)?;
        if kind == Kind::Missing {
            kind = self.send_and_wait(call, false, answer)?;
        }
        if kind != Kind::Answer {
            return Err(self.lost(&format!("refuses the call: {}", String::from_utf8_lossy(answer))));
        }
        Ok(start)
    }

    /// Sends a call and waits for the answer. Data of images and point clouds is sent as places in shared memory if
    /// `places` is true, else as a copy.
    fn send_and_wait(&mut self, call: &Call<'_>, places: bool, answer: &mut Vec<u8>) -> Result<Kind, Lost> {
        self.seq += 1;
        self.call.clear();
        for live in &self.lives {
            self.call.extend_from_slice(&live.oldest().to_le_bytes());
        }
        let ((), written) = writing(places, Traffic::BIG, || call.encode(&mut self.call));
        self.hand_over()?;
        let kind = self.wait(call.operator(), answer)?;
        Counts::add(&self.counts.bytes, self.call.len() + answer.len());
        Counts::add(&self.counts.in_place, written.in_place);
        let answered = if answer.len() > Traffic::BIG { answer.len() } else { 0 };
        Counts::add(&self.counts.copied, written.copied + answered);
        Ok(kind)
    }

    /// Sends the call.
    fn hand_over(&mut self) -> Result<(), Lost> {
        let listener = self
            .listener
            .as_ref()
            .ok_or_else(|| Lost("there is no wake-up channel to a worker that is ready".into()))?;
        let sent = self.calls.send(self.seq, Kind::Call, &self.call);
        sent.map_err(|error| self.lost(&format!("cannot be called: {error}")))?;
        listener.waker.wake();
        Ok(())
    }

    /// Waits for the answer to the last call, a step of `operator`.
    fn wait(&mut self, operator: &str, answer: &mut Vec<u8>) -> Result<Kind, Lost> {
        let Waits { spin, reply_within } = self.waits;
        let spin_until = (spin > Duration::ZERO).then(|| now() + spin);
        let mut again = None;
        let (mut waited, mut looked) = (Duration::ZERO, now());
        loop {
            if spin_until.is_some_and(|until| now() < until) {
                if let Some(kind) = self.receive(answer)? {
                    return Ok(kind);
                }
                core::hint::spin_loop();
                continue;
            }
            // If this process itself was stopped for a while, only a moment of that counts.
            let before = core::mem::replace(&mut looked, now());
            waited += (looked - before).min(10 * LOOK_AROUND);
            if waited > reply_within {
                self.kill_hung(operator);
            }
            let signal =
                self.listener.as_mut().map_or(Heard::Closed, |listener| listener.listen(Timeout::Set));
            match signal {
                Heard::Wake | Heard::Ready(_) | Heard::TimedOut => {
                    if let Some(kind) = self.receive(answer)? {
                        return Ok(kind);
                    }
                    self.check_life()?;
                    if now() >= *again.get_or_insert_with(|| now() + CALL_AGAIN) {
                        self.hand_over()?;
                        again = None;
                    }
                }
                Heard::Closed => {
                    self.watched.wait_end(self.start);
                    self.check_life()?;
                }
            }
        }
    }

    /// Kills a worker that does not answer. It then counts as ended.
    fn kill_hung(&self, operator: &str) {
        let mut life = self.watched.life();
        if life.starts == self.start {
            let Self { process, waits, .. } = self;
            let seconds = waits.reply_within.as_secs_f64();
            life.kill_for(format!(
                "did not answer operator `{operator}` within {seconds} s (process.{process}.reply_within_s) and was killed"
            ));
        }
    }

    /// Copies the answer to the last call from its loaned slice, if it has arrived.
    fn receive(&self, answer: &mut Vec<u8>) -> Result<Option<Kind>, Lost> {
        let failed = |error| self.lost(&format!("cannot be heard: {error:?}"));
        while let Some(message) = self.answers.receive().map_err(failed)? {
            if let Some(kind) = answers(message.user_header(), self.seq) {
                answer.clear();
                answer.extend_from_slice(message.payload());
                return Ok(Some(kind));
            }
        }
        Ok(None)
    }

    /// Checks that the worker that was called last is still alive.
    fn check_life(&self) -> Result<(), Lost> {
        let life = self.watched.life();
        if let Some(why) = &life.gone {
            return Err(self.lost(why));
        }
        if life.starts != self.start {
            return Err(self.lost(&life.ended));
        }
        Ok(())
    }
}

/// Kind of a message if it answers call `seq`.
fn answers(head: &Head, seq: u64) -> Option<Kind> {
    Kind::of(head).filter(|_| head.seq == seq)
}

/// Executor for the steps of one operator in a worker.
pub(crate) struct Endpoint {
    pub(crate) link: Arc<Mutex<Link>>,
    /// Start of the worker that took the last step.
    pub(crate) start: u64,
}

impl RemoteExecutor for Endpoint {
    fn step(&mut self, call: &Call<'_>, answer: &mut Vec<u8>) -> Result<Answered, Lost> {
        let mut link = self.link.lock().unwrap_or_else(PoisonError::into_inner);
        let start = link.step(call, answer)?;
        let before = core::mem::replace(&mut self.start, start);
        Ok(if before == start { Answered::InTurn } else { Answered::Restarted })
    }
}

/// Current time of the real (monotonic) clock.
#[expect(
    clippy::disallowed_methods,
    reason = "how long to wait for another process; no result depends on it"
)]
pub(crate) fn now() -> Instant {
    Instant::now()
}
