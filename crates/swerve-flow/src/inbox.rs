//! Queue of external reports: of sources, which are fed through handles, and of workers; and the handle that ends a run.

use core::marker::PhantomData;
use core::time::Duration;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use swerve_core::Time;
use thiserror::Error;

use crate::alarm::Pace;
use crate::payload::Payload;
use crate::sent::Sent;

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

    /// Wakes the engine: a worker has finished a step.
    pub(crate) fn ring(&self) {
        self.lock().rung = true;
        self.bell.notify_one();
    }

    /// Wakes the engine, which reads its clock again.
    pub(crate) fn nudge(&self) {
        // A thread about to sleep has read the clock already, or reads it once this lock is free.
        drop(self.lock());
        self.bell.notify_one();
    }

    /// Sleeps until `due` on the clock, or until a report arrives.
    pub(crate) fn wait(&self, pace: &Pace, due: Time) -> Wake {
        let mut state = self.lock();
        loop {
            if self.is_stopped() {
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
            state = if due == Time::MAX || !pace.runs_by_itself() {
                self.bell.wait(state).unwrap_or_else(PoisonError::into_inner)
            } else {
                let left = Duration::from_nanos((due - now).ns().unsigned_abs());
                self.bell.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0
            };
        }
    }
}

/// Reason why the engine woke up.
pub(crate) enum Wake {
    /// An instant is due.
    Due,
    /// Sources or workers reported, at this time of the clock.
    Reports(VecDeque<Arrival>, Time),
    /// The run has to end.
    Stop,
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
