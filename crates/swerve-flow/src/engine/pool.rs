//! Worker threads for heavy steps. Which thread runs a step, and when, shows in no result.
//!
//! In virtual time the engine's own thread is one of them: while it waits for a step it runs one that is queued.
//! A worker more, which would be woken for it, has been seen to share a core with another one for milliseconds.

use std::collections::VecDeque;
use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};

use super::node::Ran;
use super::start::run;
use crate::input::Slot;
use crate::operator::{Body, Task};

/// A step on its way to a worker.
pub(crate) struct Job {
    pub(crate) rank: usize,
    pub(crate) name: Arc<str>,
    pub(crate) body: Box<dyn Body>,
    pub(crate) task: Task,
    pub(crate) slots: Vec<Slot>,
}

/// A step on its way back.
pub(crate) struct Done {
    pub(crate) ticket: u64,
    pub(crate) rank: usize,
    pub(crate) body: Box<dyn Body>,
    pub(crate) ran: Ran,
}

pub(crate) struct Pool {
    shared: Arc<Shared>,
    workers: Vec<JoinHandle<()>>,
    tickets: u64,
}

/// Told whenever a step is done, beside the pool's own record: the wall-clock engine sleeps elsewhere.
pub(crate) type Doorbell = Arc<dyn Fn() + Send + Sync>;

struct Shared {
    state: Mutex<State>,
    work: Condvar,
    done: Condvar,
    doorbell: Option<Doorbell>,
    running: AtomicU64,
    overlapped: AtomicU64,
}

#[derive(Default)]
struct State {
    jobs: VecDeque<(u64, Job)>,
    done: Vec<Done>,
    closed: bool,
}

impl Pool {
    /// A pool of `threads`: all of them workers where a doorbell is rung for one that waits elsewhere, else one
    /// of them is the thread that waits.
    pub(crate) fn new(threads: usize, doorbell: Option<Doorbell>) -> io::Result<Self> {
        let workers = if doorbell.is_some() { threads } else { threads - 1 };
        let shared = Arc::new(Shared {
            state: Mutex::default(),
            work: Condvar::new(),
            done: Condvar::new(),
            doorbell,
            running: AtomicU64::new(0),
            overlapped: AtomicU64::new(0),
        });
        let mut pool = Self { shared, workers: Vec::new(), tickets: 0 };
        for i in 0..workers {
            let shared = pool.shared.clone();
            pool.workers
                .push(Builder::new().name(format!("swerve-worker-{i}")).spawn(move || shared.work())?);
        }
        Ok(pool)
    }

    pub(crate) fn submit(&mut self, job: Job) -> u64 {
        self.tickets += 1;
        self.shared.lock().jobs.push_back((self.tickets, job));
        self.shared.work.notify_one();
        self.tickets
    }

    /// Waits for one step.
    pub(crate) fn wait(&mut self, ticket: u64) -> Done {
        let mut state = self.shared.lock();
        loop {
            if let Some(index) = state.done.iter().position(|done| done.ticket == ticket) {
                return state.done.swap_remove(index);
            }
            if self.shared.doorbell.is_none()
                && let Some((ticket, job)) = state.take(ticket)
            {
                drop(state);
                let done = self.shared.run(ticket, job);
                state = self.shared.lock();
                state.done.push(done);
                continue;
            }
            state = self.shared.done.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// The steps that are done, by ticket and rank, without waiting.
    pub(crate) fn finished(&self) -> Vec<(u64, usize)> {
        self.shared.lock().done.iter().map(|done| (done.ticket, done.rank)).collect()
    }

    /// How many steps began while another one ran.
    pub(crate) fn overlapped(&self) -> u64 {
        self.shared.overlapped.load(Ordering::Relaxed)
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        {
            let mut state = self.shared.lock();
            state.closed = true;
            state.jobs.clear();
        }
        self.shared.work.notify_all();
        for thread in self.workers.drain(..) {
            // A worker catches what operators panic with, so this one has nothing to say.
            let _ = thread.join();
        }
    }
}

impl State {
    /// Takes the queued step under this ticket, else the oldest one.
    fn take(&mut self, ticket: u64) -> Option<(u64, Job)> {
        let index = self.jobs.iter().position(|(queued, _)| *queued == ticket).unwrap_or(0);
        self.jobs.remove(index)
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn work(&self) {
        loop {
            let mut state = self.lock();
            let (ticket, job) = loop {
                if state.closed {
                    return;
                }
                if let Some(job) = state.jobs.pop_front() {
                    break job;
                }
                state = self.work.wait(state).unwrap_or_else(PoisonError::into_inner);
            };
            drop(state);
            let done = self.run(ticket, job);
            self.lock().done.push(done);
            self.done.notify_all();
            if let Some(ring) = &self.doorbell {
                ring();
            }
        }
    }

    /// Runs a step on the present thread.
    fn run(&self, ticket: u64, job: Job) -> Done {
        if self.running.fetch_add(1, Ordering::Relaxed) > 0 {
            self.overlapped.fetch_add(1, Ordering::Relaxed);
        }
        let Job { rank, name, mut body, mut task, mut slots } = job;
        let mut ran = Ran::default();
        run(&mut *body, &name, &mut task, &mut slots, Some(crate::host::now()), &mut ran);
        self.running.fetch_sub(1, Ordering::Relaxed);
        Done { ticket, rank, body, ran }
    }
}
