//! Simulated time that another program publishes, such as a simulator on a topic.

use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use swerve_core::Time;

use crate::inbox::Inbox;

/// Simulated time of a run, advanced from outside. Clones share it.
///
/// A run that it paces ([`run_paced`](crate::run_paced)) sleeps while it stands still, and executes every instant that
/// it reaches or passes.
#[derive(Clone, Default)]
pub struct SimulatedTime(Arc<State>);

#[derive(Default)]
struct State {
    now_ns: AtomicI64,
    /// Queue of the run, to wake its thread.
    inbox: Mutex<Option<Arc<Inbox>>>,
}

impl SimulatedTime {
    /// Creates a clock that stands at zero.
    pub fn new() -> Self {
        Self::default()
    }

    /// The present simulated time; zero is the start of the run.
    pub fn now(&self) -> Time {
        Time::from_ns(self.0.now_ns.load(Ordering::Acquire))
    }

    /// Advances the clock to `now`; an earlier time does not change it.
    pub fn advance(&self, now: Time) {
        if self.0.now_ns.fetch_max(now.ns(), Ordering::AcqRel) < now.ns()
            && let Some(inbox) = &*self.0.inbox.lock().unwrap_or_else(PoisonError::into_inner)
        {
            inbox.nudge();
        }
    }

    /// Wakes the run of this queue at each advance.
    pub(crate) fn wakes(&self, inbox: Arc<Inbox>) {
        *self.0.inbox.lock().unwrap_or_else(PoisonError::into_inner) = Some(inbox);
    }
}
