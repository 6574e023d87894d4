//! Payloads that other threads of a run are making, and the notification of those that wait for them.

use core::time::Duration;
use std::sync::{Arc, Condvar, Mutex, OnceLock, PoisonError};

use rayon::Yield;

use crate::cddl::cddl;
use crate::payload::{Made, Payload, PayloadType};

/// A payload that is being made.
pub(crate) struct Pending {
    /// Operator that published it.
    pub(crate) operator: Arc<str>,
    pub(crate) payload: PayloadType,
    pub(crate) cddl: fn() -> String,
    /// The payload, or the reason why it was not made.
    made: OnceLock<Result<Made, Box<str>>>,
    bell: Bell,
}

impl Pending {
    pub(crate) fn of<T: Payload>(operator: Arc<str>) -> Self {
        let payload = PayloadType::of::<T>();
        Self { operator, payload, cddl: cddl::<T>, made: OnceLock::new(), bell: Bell::default() }
    }

    /// Provides the payload, or the reason why there will be none; only the first call counts.
    pub(crate) fn settle(&self, made: Result<Made, Box<str>>) {
        if self.made.set(made).is_ok() {
            self.bell.ring();
        }
    }

    /// True if waiting for it would return at once.
    pub(crate) fn is_settled(&self) -> bool {
        self.made.get().is_some()
    }

    /// Waits until it is made; an error has the reason why it was not.
    pub(crate) fn wait(&self) -> Result<&Made, &str> {
        loop {
            if let Some(made) = self.made.get() {
                return made.as_ref().map_err(|why| &**why);
            }
            self.bell.wait_unless(|| self.is_settled());
        }
    }
}

/// Notification of threads that wait for other threads of the run.
#[derive(Default)]
pub(crate) struct Bell {
    lock: Mutex<()>,
    rung: Condvar,
}

/// Time after which an idle thread of the pool checks again.
const LOOK_AGAIN: Duration = Duration::from_micros(50);

impl Bell {
    /// Wakes all waiting threads; their condition is true by now.
    pub(crate) fn ring(&self) {
        drop(self.lock.lock().unwrap_or_else(PoisonError::into_inner));
        self.rung.notify_all();
    }

    /// Waits for a notification, unless `done`; a thread of the run's pool executes other work instead. May return
    /// early.
    pub(crate) fn wait_unless(&self, done: impl Fn() -> bool) {
        let idle = rayon::yield_now();
        if idle == Some(Yield::Executed) {
            return;
        }
        let guard = self.lock.lock().unwrap_or_else(PoisonError::into_inner);
        if done() {
            return;
        }
        // In either case the caller checks again.
        if idle.is_some() {
            drop(self.rung.wait_timeout(guard, LOOK_AGAIN));
        } else {
            drop(self.rung.wait(guard));
        }
    }
}
