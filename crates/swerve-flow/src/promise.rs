//! Promises: messages that are published before their payload is made.
//!
//! In virtual time a step may pass its work to other threads of the run and publish the result in advance. Headers,
//! order and watermarks are those of a step that did all the work itself; only access to the payload waits. Images
//! rendered for one instant are thus rendered in parallel while the simulation goes on; the result of the run does not
//! depend on it.

use core::marker::PhantomData;
use core::panic::AssertUnwindSafe;
use core::time::Duration;
use std::panic::catch_unwind;
use std::sync::{Arc, Condvar, Mutex, OnceLock, PoisonError};

use rayon::{ThreadPool, Yield};

use crate::cddl::cddl;
use crate::output::Port;
use crate::payload::{Made, Payload, PayloadType};

/// Threads that continue the work of a step: see [`Context::workers`](crate::Context::workers).
#[derive(Clone)]
pub struct Workers {
    pub(crate) pool: Arc<ThreadPool>,
    pub(crate) operator: Arc<str>,
}

impl Workers {
    /// Publishes a message on `port` whose payload the promise will provide.
    pub fn promise<T: Payload>(&self, port: &mut Port<T>) -> Promise<T> {
        let pending = Arc::new(Pending::of::<T>(self.operator.clone()));
        port.promise(pending.clone());
        Promise { pending, payload: PhantomData }
    }

    /// Executes `work` on another thread of the run. It must wait for nothing but threads of rayon.
    pub fn spawn(&self, work: impl FnOnce() + Send + 'static) {
        // A panic leaves its promises unkept, which ends the run.
        self.pool.spawn(|| drop(catch_unwind(AssertUnwindSafe(work))));
    }
}

/// Promise of the payload of a published message. Dropping it unkept ends the run.
#[must_use]
pub struct Promise<T> {
    pending: Arc<Pending>,
    payload: PhantomData<fn(T)>,
}

impl<T: Payload> Promise<T> {
    /// Provides the payload of the message; computes its digest on this thread.
    pub fn keep(self, payload: Arc<T>) {
        self.pending.settle(Ok(Made::new(payload)));
    }

    /// States why there will be no payload, which ends the run.
    pub fn fail(self, why: impl Into<Box<str>>) {
        self.pending.settle(Err(why.into()));
    }
}

impl<T> Drop for Promise<T> {
    fn drop(&mut self) {
        self.pending.settle(Err("what a step had left to another thread panicked there".into()));
    }
}

/// A payload that is being made.
pub(crate) struct Pending {
    /// Operator that published it.
    pub(crate) operator: Arc<str>,
    pub(crate) payload: PayloadType,
    pub(crate) cddl: fn() -> String,
    /// The payload, or the reason why it was not made.
    made: OnceLock<Result<Made, Box<str>>>,
    told: Bell,
}

impl Pending {
    fn of<T: Payload>(operator: Arc<str>) -> Self {
        let payload = PayloadType::of::<T>();
        Self { operator, payload, cddl: cddl::<T>, made: OnceLock::new(), told: Bell::default() }
    }

    fn settle(&self, made: Result<Made, Box<str>>) {
        if self.made.set(made).is_ok() {
            self.told.ring();
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
            self.told.wait_unless(|| self.is_settled());
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
