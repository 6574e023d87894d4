//! State shared between the program and the threads that serve its transport process.

use std::collections::BTreeMap;
use std::os::unix::net::UnixStream;
use std::process::Command;
use std::sync::mpsc::SyncSender;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::frame::Order;
use crate::bridge::{Received, TopicStatistics};
use crate::inbox::Inbox;

/// Maximum time for a process to create its node.
pub(super) const START_WITHIN: Duration = Duration::from_secs(10);

/// Maximum number of messages in transit to the process; longer waits would make them stale.
pub(super) const WINDOW: usize = 32;

/// Start parameters of the process.
pub struct TransportProcess {
    /// Command that runs [`run`](super::run).
    pub command: Box<dyn Fn() -> Command + Send>,
    /// Memory limit, MiB.
    pub memory_mib: u32,
    /// Data, in addition to the newest state, that the process needs to continue alone; passed to [`run`](super::run) in
    /// [`Orphan`](super::Orphan).
    pub setup: Vec<u8>,
}

pub(super) struct Shared {
    pub(super) state: Mutex<State>,
    pub(super) news: Condvar,
}

impl Shared {
    pub(super) fn lock(&self) -> MutexGuard<'_, State> {
        // The updates leave the state consistent even if a holder of the lock panics.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn wait(
        &self,
        timeout: Duration,
        mut reached: impl FnMut(&State) -> bool,
    ) -> (MutexGuard<'_, State>, bool) {
        let waited = self.news.wait_timeout_while(self.lock(), timeout, |state| !reached(state));
        let (state, result) = waited.unwrap_or_else(PoisonError::into_inner);
        (state, !result.timed_out())
    }
}

/// State shared between the threads.
#[derive(Default)]
pub(super) struct State {
    pub(super) inboxes: Vec<Inbox<Received>>,
    /// Endpoint at which the next search for a message starts.
    pub(super) search_from: usize,
    /// Statistics of the running process.
    pub(super) counts: Vec<TopicStatistics>,
    /// Statistics of earlier processes.
    pub(super) earlier: Vec<TopicStatistics>,
    /// Messages dropped because there was no process or it was too slow, by endpoint.
    pub(super) not_handed_on: Vec<u64>,
    /// Session with the running process, while it has a node.
    pub(super) session: Option<Session>,
    /// Messages in transit to the process.
    pub(super) on_their_way: usize,
    pub(super) asked: u64,
    pub(super) answers: BTreeMap<u64, Result<bool, String>>,
    pub(super) modes: Vec<u8>,
    /// Reasons for the ends of processes that have not been taken yet.
    pub(super) losses: Vec<String>,
    pub(super) lost: u64,
    /// Result of starting the first process.
    pub(super) began: Option<Result<(), String>>,
    pub(super) is_ending: bool,
    pub(super) has_ended: bool,
    /// Number of requested statistics received.
    pub(super) counted: u64,
}

/// Connection to a process.
pub(super) struct Session {
    pub(super) orders: SyncSender<Order>,
    pub(super) socket: UnixStream,
}
