//! State shared by the run and the viewers: topics, and the queue of each viewer.
//!
//! The run hands over messages that are not yet encoded and continues; the first viewer that takes one encodes it. For
//! a viewer that is too slow the oldest messages are dropped and counted.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::{Arc, Condvar, LazyLock, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use swerve_foxglove::Form;

/// Maximum number of queued messages of a subscription,
const WAITING: usize = 256;
/// and approximate maximum of their bytes, if there is more than one.
const WAITING_BYTES: usize = 16 << 20;
/// Interval of time messages, nanoseconds of the run.
const TICK_NS: u64 = 10_000_000;

type Make = Box<dyn FnOnce() -> Vec<u8> + Send>;

/// A message, encoded on first access.
pub(super) struct Message {
    /// Publication time, nanoseconds of the run.
    pub(super) at_ns: u64,
    /// Approximate size, bytes.
    bytes: usize,
    data: LazyLock<Vec<u8>, Make>,
}

impl Message {
    pub(super) fn new(at_ns: u64, bytes: usize, make: Make) -> Self {
        Self { at_ns, bytes, data: LazyLock::new(make) }
    }

    /// Encoded message; empty if there is nothing to show.
    pub(super) fn data(&self) -> &[u8] {
        &self.data
    }
}

/// Next item to send to a viewer.
pub(super) enum Todo {
    /// Starts a session: the topics of the previous run end.
    Session(String),
    Offer(Arc<str>, Arc<Form>),
    Dropped(u64),
    Time(u64),
    Message(Arc<str>, Arc<Message>),
}

struct Topic {
    form: Arc<Form>,
    /// Kept for viewers that connect later: some topics have one message per run.
    newest: Arc<Message>,
}

#[derive(Default)]
struct Waiting {
    messages: VecDeque<(u64, Arc<Message>)>,
    bytes: usize,
}

#[derive(Default)]
struct Viewer {
    session: u64,
    offered: BTreeSet<Arc<str>>,
    subscriptions: BTreeMap<Arc<str>, Waiting>,
    time_ns: Option<u64>,
    dropped: u64,
    told: u64,
    /// Number of messages read.
    taken: u64,
}

#[derive(Default)]
struct State {
    session: u64,
    topics: BTreeMap<Arc<str>, Topic>,
    messages: u64,
    now_ns: u64,
    viewers: BTreeMap<u64, Viewer>,
    entered: u64,
}

/// Topics and viewers.
#[derive(Default)]
pub(super) struct Hub {
    /// Unique name for this server's sessions.
    name: String,
    state: Mutex<State>,
    changed: Condvar,
}

impl Hub {
    pub(super) fn new(name: String) -> Self {
        Self { name, ..Self::default() }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Starts the session of another run: its time starts again.
    pub(super) fn begin(&self) {
        let mut state = self.state();
        state.session += 1;
        state.topics.clear();
        state.now_ns = 0;
        self.changed.notify_all();
    }

    /// Queues a message for all subscribers.
    pub(super) fn publish(&self, topic: &str, form: impl FnOnce() -> Form, message: Message) {
        let mut state = self.state();
        let state = &mut *state;
        let message = Arc::new(message);
        state.now_ns = state.now_ns.max(message.at_ns);
        state.messages += 1;
        match state.topics.get_mut(topic) {
            Some(known) => known.newest = Arc::clone(&message),
            None => {
                let new = Topic { form: Arc::new(form()), newest: Arc::clone(&message) };
                state.topics.insert(topic.into(), new);
            }
        }
        for viewer in state.viewers.values_mut() {
            if let Some(waiting) = viewer.subscriptions.get_mut(topic) {
                viewer.dropped += waiting.push(state.messages, &message);
            }
        }
        self.changed.notify_all();
    }

    /// Adds a viewer; returns its number and the current session.
    pub(super) fn enter(&self) -> (u64, String) {
        let mut state = self.state();
        state.entered += 1;
        let (id, session) = (state.entered, state.session);
        state.viewers.insert(id, Viewer { session, ..Viewer::default() });
        self.changed.notify_all();
        (id, self.session(session))
    }

    fn session(&self, number: u64) -> String {
        format!("{}-{number}", self.name)
    }

    /// Removes a viewer; returns the numbers of messages sent and dropped.
    pub(super) fn leave(&self, id: u64) -> (u64, u64) {
        let gone = self.state().viewers.remove(&id);
        gone.map_or((0, 0), |viewer| (viewer.taken, viewer.dropped))
    }

    /// Subscribes a viewer to a topic, starting with its newest message.
    pub(super) fn subscribe(&self, id: u64, topic: &str) {
        let mut state = self.state();
        let State { viewers, topics, .. } = &mut *state;
        if let (Some(viewer), Some((topic, Topic { newest, .. }))) =
            (viewers.get_mut(&id), topics.get_key_value(topic))
        {
            let mut waiting = Waiting::default();
            waiting.push(0, newest);
            viewer.subscriptions.insert(Arc::clone(topic), waiting);
        }
        self.changed.notify_all();
    }

    /// Unsubscribes a viewer from a topic.
    pub(super) fn unsubscribe(&self, id: u64, topic: &str) {
        if let Some(viewer) = self.state().viewers.get_mut(&id) {
            viewer.subscriptions.remove(topic);
        }
    }

    /// Next item to send to a viewer; waits for a short time if there is none.
    pub(super) fn next(&self, id: u64, wait: Duration) -> Option<Todo> {
        let mut state = self.state();
        if let Some(todo) = self.next_of(&mut state, id) {
            return Some(todo);
        }
        state = self.changed.wait_timeout(state, wait).unwrap_or_else(PoisonError::into_inner).0;
        self.next_of(&mut state, id)
    }

    fn next_of(&self, state: &mut State, id: u64) -> Option<Todo> {
        let viewer = state.viewers.get_mut(&id)?;
        if viewer.session != state.session {
            *viewer = Viewer {
                session: state.session,
                dropped: viewer.dropped,
                told: viewer.told,
                taken: viewer.taken,
                ..Viewer::default()
            };
            return Some(Todo::Session(self.session(state.session)));
        }
        if viewer.offered.len() < state.topics.len() {
            let (topic, Topic { form, .. }) =
                state.topics.iter().find(|(topic, _)| !viewer.offered.contains(*topic))?;
            viewer.offered.insert(Arc::clone(topic));
            return Some(Todo::Offer(Arc::clone(topic), Arc::clone(form)));
        }
        let first = |waiting: &Waiting| waiting.messages.front().map(|(number, _)| *number);
        let next = viewer.subscriptions.iter_mut().filter_map(|(topic, w)| Some((first(w)?, topic, w)));
        let next = next.min_by_key(|(number, ..)| *number);
        // Reported occasionally during the run, and when the queue is empty.
        if viewer.dropped > viewer.told && (next.is_none() || viewer.dropped >= 2 * viewer.told) {
            viewer.told = viewer.dropped;
            return Some(Todo::Dropped(viewer.dropped));
        }
        let Some((_, topic, waiting)) = next else {
            let is_late = viewer.time_ns.is_none_or(|told| told < state.now_ns);
            return is_late.then(|| Todo::Time(*viewer.time_ns.insert(state.now_ns)));
        };
        let (_, message) = waiting.messages.front()?;
        if viewer.time_ns.is_none_or(|told| told + TICK_NS <= message.at_ns) {
            return Some(Todo::Time(*viewer.time_ns.insert(message.at_ns)));
        }
        let (_, message) = waiting.messages.pop_front()?;
        waiting.bytes -= message.bytes;
        viewer.taken += 1;
        Some(Todo::Message(Arc::clone(topic), message))
    }

    /// Waits at most for `wait` until more than this many viewers have connected; returns their number if so.
    pub(super) fn wait_for_viewers(&self, more_than: u64, wait: Duration) -> Option<u64> {
        let none = |state: &mut State| state.entered <= more_than;
        let waited = self.changed.wait_timeout_while(self.state(), wait, none);
        let (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        (state.entered > more_than).then_some(state.entered)
    }
}

impl Waiting {
    /// Queues a message; returns the number of messages dropped for it.
    fn push(&mut self, number: u64, message: &Arc<Message>) -> u64 {
        self.messages.push_back((number, Arc::clone(message)));
        self.bytes += message.bytes;
        let mut dropped = 0;
        while self.messages.len() > WAITING || (self.bytes > WAITING_BYTES && self.messages.len() > 1) {
            let Some((_, oldest)) = self.messages.pop_front() else { break };
            self.bytes -= oldest.bytes;
            dropped += 1;
        }
        dropped
    }
}
