//! Ends the workers of one run from another thread, also while they hang.

use std::sync::{Arc, Mutex, PoisonError};

use crate::link::Watched;

/// Handle that kills the workers of one run: [`WorkerPool::ended_by`](crate::WorkerPool::ended_by).
#[derive(Clone, Default)]
pub struct Interrupt(Arc<Mutex<State>>);

#[derive(Default)]
struct State {
    is_set: bool,
    workers: Vec<Arc<Watched>>,
}

impl Interrupt {
    /// Kills the workers at once, and those that are started later. The run ends with an error if it still needs one.
    pub fn kill(&self) {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        state.is_set = true;
        state.workers.iter().for_each(|worker| end(worker));
    }

    pub(crate) fn add(&self, worker: Arc<Watched>) {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if state.is_set {
            end(&worker);
        }
        state.workers.push(worker);
    }
}

fn end(worker: &Watched) {
    worker.life().kill_for("was interrupted");
}
