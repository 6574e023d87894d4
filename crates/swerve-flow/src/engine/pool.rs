//! Threads for heavy steps. The result of a run does not depend on the thread that executes a step, nor on when.
//!
//! In virtual time, all work of a run is done by one rayon pool, and the engine's own thread is part of it: while it
//! waits, it executes queued work. Work in the pool waits only for parts of itself, so a waiting thread can execute
//! other work meanwhile. Under wall clock the engine has to keep time, and late steps must not wait for others: each
//! worker is a separate thread.

use std::collections::VecDeque;
use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};

use super::node::{Ran, run};
use crate::input::Slot;
use crate::operator::{Body, Task};
use crate::pending::Bell;

/// A step to be executed by a worker.
pub(crate) struct Job {
    pub(crate) rank: usize,
    pub(crate) name: Arc<str>,
    pub(crate) body: Box<dyn Body>,
    pub(crate) task: Task,
    pub(crate) slots: Vec<Slot>,
}

/// A step that a worker has executed.
pub(crate) struct Done {
    pub(crate) ticket: u64,
    pub(crate) rank: usize,
    pub(crate) body: Box<dyn Body>,
    pub(crate) ran: Ran,
}

pub(crate) struct Pool {
    shared: Arc<Shared>,
    crew: Crew,
    tickets: u64,
}

/// Threads that execute steps.
enum Crew {
    /// The threads of a run in virtual time.
    Pool(Arc<rayon::ThreadPool>),
    /// Workers besides the thread that keeps time.
    Workers(Vec<JoinHandle<()>>),
}

/// Stack of a thread, bytes: steps of several operators may be nested on it.
const STACK: usize = 16 << 20;

/// Callback when a step is done, in addition to the pool's own notification: the wall-clock engine sleeps elsewhere.
pub(crate) type Doorbell = Arc<dyn Fn() + Send + Sync>;

struct Shared {
    state: Mutex<State>,
    work: Condvar,
    done: Bell,
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
    /// Creates a pool of `threads`: with a doorbell, separate workers; else a rayon pool that the engine's own thread
    /// has to join.
    pub(crate) fn new(threads: usize, doorbell: Option<Doorbell>) -> io::Result<Self> {
        let is_wall = doorbell.is_some();
        let shared = Arc::new(Shared {
            state: Mutex::default(),
            work: Condvar::new(),
            done: Bell::default(),
            doorbell,
            running: AtomicU64::new(0),
            overlapped: AtomicU64::new(0),
        });
        let name = |i| format!("swerve-worker-{i}");
        if !is_wall {
            let pool =
                rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(name).stack_size(STACK);
            let pool = pool.build().map_err(io::Error::other)?;
            return Ok(Self { shared, crew: Crew::Pool(Arc::new(pool)), tickets: 0 });
        }
        // Created before its workers, so that the workers already started end if one fails to start.
        let mut pool = Self { shared, crew: Crew::Workers(Vec::new()), tickets: 0 };
        for i in 0..threads {
            let shared = pool.shared.clone();
            let worker = Builder::new().name(name(i)).spawn(move || shared.work())?;
            if let Crew::Workers(workers) = &mut pool.crew {
                workers.push(worker);
            }
        }
        Ok(pool)
    }

    /// Threads of a run in virtual time.
    pub(crate) fn workers(&self) -> Option<Arc<rayon::ThreadPool>> {
        match &self.crew {
            Crew::Pool(pool) => Some(pool.clone()),
            Crew::Workers(_) => None,
        }
    }

    pub(crate) fn submit(&mut self, job: Job) -> u64 {
        self.tickets += 1;
        self.shared.lock().jobs.push_back((self.tickets, job));
        match &self.crew {
            Crew::Pool(pool) => {
                let shared = self.shared.clone();
                pool.spawn(move || shared.run_oldest());
            }
            Crew::Workers(_) => self.shared.work.notify_one(),
        }
        self.tickets
    }

    /// Waits for one step.
    pub(crate) fn wait(&mut self, ticket: u64) -> Done {
        let mut state = self.shared.lock();
        loop {
            if let Some(index) = state.done.iter().position(|done| done.ticket == ticket) {
                return state.done.swap_remove(index);
            }
            let queued = if self.shared.doorbell.is_none() { state.take(ticket) } else { None };
            drop(state);
            match queued {
                Some((ticket, job)) => self.shared.run(ticket, job),
                None => self.shared.done.wait_unless(|| self.shared.has(ticket)),
            }
            state = self.shared.lock();
        }
    }

    /// Tickets and ranks of the steps that are done, without waiting.
    pub(crate) fn finished(&self) -> Vec<(u64, usize)> {
        self.shared.lock().done.iter().map(|done| (done.ticket, done.rank)).collect()
    }

    /// Number of steps that began while another one ran.
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
        let Crew::Workers(workers) = &mut self.crew else { return };
        for thread in workers.drain(..) {
            // A worker catches panics of operators, so joining it returns no error.
            let _ = thread.join();
        }
    }
}

impl State {
    /// Removes and returns the queued step under this ticket.
    fn take(&mut self, ticket: u64) -> Option<(u64, Job)> {
        let index = self.jobs.iter().position(|(queued, _)| *queued == ticket)?;
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
            self.run(ticket, job);
        }
    }

    /// Executes the step that has been queued longest, if it is not already running.
    fn run_oldest(&self) {
        let job = self.lock().jobs.pop_front();
        if let Some((ticket, job)) = job {
            self.run(ticket, job);
        }
    }

    /// True if the step under this ticket is done.
    fn has(&self, ticket: u64) -> bool {
        self.lock().done.iter().any(|done| done.ticket == ticket)
    }

    /// Executes a step on the current thread, and signals that it is done.
    fn run(&self, ticket: u64, job: Job) {
        if self.running.fetch_add(1, Ordering::Relaxed) > 0 {
            self.overlapped.fetch_add(1, Ordering::Relaxed);
        }
        let Job { rank, name, mut body, mut task, mut slots } = job;
        let mut ran = Ran::default();
        run(&mut *body, &name, &mut task, &mut slots, Some(crate::host::Begin::now()), &mut ran);
        self.running.fetch_sub(1, Ordering::Relaxed);
        self.lock().done.push(Done { ticket, rank, body, ran });
        self.done.ring();
        if let Some(ring) = &self.doorbell {
            ring();
        }
    }
}
