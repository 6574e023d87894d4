//! Wall clock: the same sweep, at instants given by the real clock, the sources and the workers.

use core::marker::PhantomData;
use core::time::Duration;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use swerve_core::{Span, Time};
use thiserror::Error;

use crate::decision::Decision;
use crate::engine::Engine;
use crate::graph::Graph;
use crate::observer::Observer;
use crate::options::RunOptions;
use crate::payload::{Payload, Sent};
use crate::report::{EndReason, RunError, RunReport};

/// Maximum number of reports that wait for the engine; more are refused, so that a stuck engine does not exhaust
/// memory.
const REPORTS_MAX: usize = 4096;

/// Queue through which sources and workers report to the engine.
#[derive(Default)]
pub(crate) struct Inbox {
    state: Mutex<Reports>,
    bell: Condvar,
    /// True if the run has to end.
    stop: AtomicBool,
}

#[derive(Default)]
struct Reports {
    arrivals: VecDeque<Arrival>,
    /// True if a worker has finished a step.
    rung: bool,
    closed: bool,
}

/// Report of a source.
pub(crate) struct Arrival {
    /// Index of the source among the operators, in the order in which they were added.
    pub(crate) operator: usize,
    pub(crate) report: Report,
}

pub(crate) enum Report {
    /// A message; without a stamp, its stamp is the instant at which the engine receives it.
    Message(Option<Time>, Sent),
    Watermark(Time),
}

/// Reason why a source's report was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SendError {
    /// The run has ended.
    #[error("the run is over")]
    Over,
    /// Too many reports wait because the engine does not keep up.
    #[error("{REPORTS_MAX} reports wait for the engine, which does not keep up")]
    Full,
}

impl Inbox {
    /// True if the run has to end.
    pub(crate) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn lock(&self) -> MutexGuard<'_, Reports> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn push(&self, arrival: Arrival) -> Result<(), SendError> {
        let mut state = self.lock();
        if state.closed {
            return Err(SendError::Over);
        }
        if state.arrivals.len() >= REPORTS_MAX {
            return Err(SendError::Full);
        }
        state.arrivals.push_back(arrival);
        drop(state);
        self.bell.notify_one();
        Ok(())
    }

    /// Removes and returns the waiting reports.
    pub(crate) fn take(&self) -> VecDeque<Arrival> {
        core::mem::take(&mut self.lock().arrivals)
    }

    /// Accepts no more reports.
    pub(crate) fn close(&self) {
        let mut state = self.lock();
        state.closed = true;
        state.arrivals.clear();
    }

    fn ring(&self) {
        self.lock().rung = true;
        self.bell.notify_one();
    }
}

/// Feeds a source of a graph, from any thread. Dropping the last clone closes the stream.
pub struct SourceHandle<T> {
    source: Arc<OpenSource>,
    payload: PhantomData<fn(T)>,
}

impl<T> Clone for SourceHandle<T> {
    fn clone(&self) -> Self {
        Self { source: self.source.clone(), payload: PhantomData }
    }
}

struct OpenSource {
    inbox: Arc<Inbox>,
    operator: usize,
}

impl Drop for OpenSource {
    fn drop(&mut self) {
        // Pushed even if the run is over or too many reports wait: there is no caller to return an error to.
        let mut state = self.inbox.lock();
        state.arrivals.push_back(Arrival { operator: self.operator, report: Report::Watermark(Time::MAX) });
        drop(state);
        self.inbox.bell.notify_one();
    }
}

impl<T: Payload> SourceHandle<T> {
    pub(crate) fn new(inbox: Arc<Inbox>, operator: usize) -> Self {
        Self { source: Arc::new(OpenSource { inbox, operator }), payload: PhantomData }
    }

    fn report(&self, report: Report) -> Result<(), SendError> {
        self.source.inbox.push(Arrival { operator: self.source.operator, report })
    }

    /// Reports a message that describes the instant `stamp`. Stamps have to increase: a message at or below the
    /// stream's watermark is counted as too late.
    ///
    /// # Errors
    /// If the run has ended, or the engine does not keep up.
    pub fn send(&self, stamp: Time, value: T) -> Result<(), SendError> {
        self.report(Report::Message(Some(stamp), Sent::new(Arc::new(value))))
    }

    /// Reports a message that describes the instant at which the engine receives it.
    ///
    /// # Errors
    /// As for [`send`](Self::send).
    pub fn send_now(&self, value: T) -> Result<(), SendError> {
        self.report(Report::Message(None, Sent::new(Arc::new(value))))
    }

    /// Reports that no message with a stamp at or below `watermark` will come.
    ///
    /// # Errors
    /// As for [`send`](Self::send).
    pub fn advance(&self, watermark: Time) -> Result<(), SendError> {
        self.report(Report::Watermark(watermark))
    }
}

/// Ends a run from any thread, at an instant that depends on the time of the call.
#[derive(Clone)]
pub struct StopHandle(pub(crate) Arc<Inbox>);

impl StopHandle {
    /// Ends the run after the current sweep.
    pub fn stop(&self) {
        {
            // A thread about to sleep has checked the flag already, or checks it once this lock is free.
            let _state = self.0.lock();
            self.0.stop.store(true, Ordering::Relaxed);
        }
        self.0.bell.notify_one();
    }
}

/// The real clock of one run.
#[derive(Clone, Copy)]
pub(crate) struct Pace {
    begin: Instant,
}

impl Pace {
    pub(crate) fn now(self) -> Time {
        Time::from_ns(i64::try_from(crate::host::ns_since(self.begin)).unwrap_or(i64::MAX))
    }

    /// Creates an alarm for a step's deadline.
    pub(crate) fn alarm(self, deadline: Time) -> Alarm {
        Alarm { pace: self, deadline }
    }
}

/// Checks whether the real clock has passed a step's deadline.
pub(crate) struct Alarm {
    pace: Pace,
    deadline: Time,
}

impl Alarm {
    /// Creates an alarm that goes off after `left` from now.
    pub(crate) fn after(left: Span) -> Self {
        Pace { begin: crate::host::now() }.alarm(Time::ZERO + left)
    }

    pub(crate) fn is_out(&self) -> bool {
        self.pace.now() >= self.deadline
    }

    /// Time left until the deadline; zero once it has passed.
    pub(crate) fn left(&self) -> Span {
        (self.deadline - self.pace.now()).max(Span::ZERO)
    }
}

/// Reason why the engine woke up.
enum Wake {
    /// An instant is due.
    Due,
    /// Sources or workers reported, at this time of the real clock.
    Reports(VecDeque<Arrival>, Time),
    Stop,
}

/// Runs a graph against the real clock. Its sources are fed through their handles; steps of heavy operators run on
/// worker threads, all others on this one.
///
/// A step takes its actual duration, and at least the run time of its model; a step without run time that is not heavy
/// takes zero time. Observers receive everything that the inputs do not determine as [`Decision`]s, with which
/// [`run_replay`](crate::run_replay) repeats the run.
///
/// # Errors
/// As for [`run_virtual`](crate::run_virtual), and if the system cannot start a worker thread.
pub fn run_wall(
    graph: Graph,
    options: &RunOptions,
    observers: Vec<&mut dyn Observer>,
) -> Result<RunReport, RunError> {
    let inbox = graph.inbox.clone();
    let bell = inbox.clone();
    let pace = Pace { begin: crate::host::now() };
    let doorbell = Arc::new(move || bell.ring());
    let mut engine = Engine::new(graph, options, None, observers, Some((pace, doorbell as _)))?;
    engine.decide(|| Decision::Begin { wall_clock: true });
    let end = pursue(&mut engine, options.until.unwrap_or(Time::MAX), pace, &inbox);
    inbox.close();
    let at = engine.now();
    engine.decide(|| Decision::End { at });
    engine.finish(end)
}

fn pursue(engine: &mut Engine<'_>, until: Time, pace: Pace, inbox: &Inbox) -> EndReason {
    engine.wake_all();
    engine.sweep(Time::ZERO);
    while !engine.is_over() {
        let due = engine.next_due();
        if due == Time::MAX && engine.is_idle() {
            return EndReason::Idle;
        }
        // The run lasts until its end has passed on the real clock as well.
        let limit = due.min(until.saturating_add(Span::from_ns(1)));
        match wait(inbox, pace, limit) {
            Wake::Stop => return EndReason::Interrupted,
            Wake::Due if due > until => return EndReason::Until,
            Wake::Due => engine.sweep(due),
            Wake::Reports(arrivals, at) => {
                // Two sweeps never share an instant, so that a replay settles each in one sweep.
                let now = at.max(engine.now().saturating_add(Span::from_ns(1)));
                engine.take_reports(arrivals, now);
                engine.sweep(now);
            }
        }
    }
    EndReason::Until
}

/// Sleeps until `due` on the real clock, or until a report arrives.
fn wait(inbox: &Inbox, pace: Pace, due: Time) -> Wake {
    let mut state = inbox.lock();
    loop {
        if inbox.is_stopped() {
            return Wake::Stop;
        }
        let now = pace.now();
        // Due instants come before later reports.
        if due <= now {
            return Wake::Due;
        }
        if state.rung || !state.arrivals.is_empty() {
            state.rung = false;
            return Wake::Reports(core::mem::take(&mut state.arrivals), now);
        }
        state = if due == Time::MAX {
            inbox.bell.wait(state).unwrap_or_else(PoisonError::into_inner)
        } else {
            let left = Duration::from_nanos((due - now).ns().unsigned_abs());
            inbox.bell.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0
        };
    }
}
