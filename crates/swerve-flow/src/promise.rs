//! Promises: messages that are published before what they carry is made.
//!
//! In virtual time a step may leave its work to the run's other threads and publish what will come of it. Headers,
//! order and watermarks are those of a step that did it all; only who looks at the payload waits. So what is drawn for
//! one instant is drawn at once, and the world goes on meanwhile; it shows in no result.

use core::marker::PhantomData;
use core::panic::AssertUnwindSafe;
use core::time::Duration;
use std::panic::catch_unwind;
use std::sync::{Arc, Condvar, Mutex, OnceLock, PoisonError};

use rayon::{ThreadPool, Yield};

use crate::cddl::cddl;
use crate::output::Port;
use crate::payload::{Made, Payload, PayloadType};

/// Threads that go on with what a step leaves to them: see [`Context::workers`](crate::Context::workers).
#[derive(Clone)]
pub struct Workers {
    pub(crate) pool: Arc<ThreadPool>,
    pub(crate) operator: Arc<str>,
}

impl Workers {
    /// Publishes on `port` what the promise will be kept with.
    pub fn promise<T: Payload>(&self, port: &mut Port<T>) -> Promise<T> {
        let pending = Arc::new(Pending::of::<T>(self.operator.clone()));
        port.promise(pending.clone());
        Promise { pending, payload: PhantomData }
    }

    /// Has another thread of the run do `work`. It must wait for nothing but threads of rayon's.
    pub fn spawn(&self, work: impl FnOnce() + Send + 'static) {
        // What panics leaves its promises unkept, and those end the run.
        self.pool.spawn(|| drop(catch_unwind(AssertUnwindSafe(work))));
    }
}

/// What a message that is published already will carry. One that is dropped unkept ends the run.
#[must_use]
pub struct Promise<T> {
    pending: Arc<Pending>,
    payload: PhantomData<fn(T)>,
}

impl<T: Payload> Promise<T> {
    /// Gives the message its payload; takes its fingerprint here.
    pub fn keep(self, payload: Arc<T>) {
        self.pending.settle(Ok(Made::new(payload)));
    }

    /// Says why there will be no payload, which ends the run.
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
    /// Whose it is.
    pub(crate) operator: Arc<str>,
    pub(crate) payload: PayloadType,
    pub(crate) cddl: fn() -> String,
    /// What it is, or why it was never made.
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

    /// Whether nobody would wait for it any more.
    pub(crate) fn is_settled(&self) -> bool {
        self.made.get().is_some()
    }

    /// Waits until it is made; why not, if that failed.
    pub(crate) fn wait(&self) -> Result<&Made, &str> {
        loop {
            if let Some(made) = self.made.get() {
                return made.as_ref().map_err(|why| &**why);
            }
            self.told.wait_unless(|| self.is_settled());
        }
    }
}

/// Wakes who waits for something that other threads of the run do.
#[derive(Default)]
pub(crate) struct Bell {
    lock: Mutex<()>,
    rung: Condvar,
}

/// After so long a thread of the pool that found nothing to do looks again.
const LOOK_AGAIN: Duration = Duration::from_micros(50);

impl Bell {
    /// Wakes all who wait; what they wait for is there by now.
    pub(crate) fn ring(&self) {
        drop(self.lock.lock().unwrap_or_else(PoisonError::into_inner));
        self.rung.notify_all();
    }

    /// Waits for a ring, unless `done`; a thread of the run's pool does work of others instead. May end early.
    pub(crate) fn wait_unless(&self, done: impl Fn() -> bool) {
        let idle = rayon::yield_now();
        if idle == Some(Yield::Executed) {
            return;
        }
        let guard = self.lock.lock().unwrap_or_else(PoisonError::into_inner);
        if done() {
            return;
        }
        // Either way the caller looks anew.
        if idle.is_some() {
            drop(self.rung.wait_timeout(guard, LOOK_AGAIN));
        } else {
            drop(self.rung.wait(guard));
        }
    }
}
