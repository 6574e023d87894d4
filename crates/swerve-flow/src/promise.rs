//! Promises: messages that are published before their payload is made.
//!
//! In virtual time a step may pass its work to other threads of the run and publish the result in advance. Headers,
//! order and watermarks are those of a step that did all the work itself; only access to the payload waits. Images
//! rendered for one instant are thus rendered in parallel while the simulation goes on; the result of the run does not
//! depend on it.

use core::marker::PhantomData;
use core::panic::AssertUnwindSafe;
use std::panic::catch_unwind;
use std::sync::Arc;

use rayon::ThreadPool;

use crate::output::Port;
use crate::payload::{Made, Payload};
use crate::pending::Pending;

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
