//! What the run and the viewers share: topics, and of each viewer what waits for it.
//!
//! The run hands over messages that nobody has made yet and goes on; the first viewer that takes one makes it. A viewer
//! that takes them more slowly than they come loses the oldest, and they are counted.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Condvar, LazyLock, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::protocol::{Asked, Channel, Form};

/// Messages that wait of one subscription, at most,
const WAITING: usize = 256;
/// and about how many bytes of them, where there is more than one.
const WAITING_BYTES: usize = 16 << 20;
/// Subscriptions of one viewer.
const SUBSCRIPTIONS: usize = 1024;
/// The time of the run is told so often, nanoseconds of the run.
const TICK_NS: u64 = 10_000_000;

type Make = Box<dyn FnOnce() -> Vec<u8> + Send>;

/// A message, made when it is first asked for.
pub(super) struct Message {
    /// When it was published, nanoseconds of the run.
    pub(super) at_ns: u64,
    /// About how much it holds.
    bytes: usize,
    data: LazyLock<Vec<u8>, Make>,
}

impl Message {
    pub(super) fn new(at_ns: u64, bytes: usize, make: Make) -> Self {
        Self { at_ns, bytes, data: LazyLock::new(make) }
    }

    /// Its bytes; empty where there is nothing to show.
    pub(super) fn data(&self) -> &[u8] {
        &self.data
    }
}

/// What a viewer is to be sent.
pub(super) enum Todo {
    /// Another run begins; these channels are gone.
    Session(String, Vec<u64>),
    Advertise(Vec<Arc<Channel>>),
    Dropped(u64),
    Time(u64),
    Message(u32, Arc<Message>),
}

struct Topic {
    channel: Arc<Channel>,
    /// For who comes later: some topics have one message a run.
    newest: Arc<Message>,
}

#[derive(Default)]
struct Waiting {
    channel: u64,
    messages: VecDeque<(u64, Arc<Message>)>,
    bytes: usize,
}

#[derive(Default)]
struct Viewer {
    /// None before it was told of any.
    session: Option<u64>,
    advertised: Vec<u64>,
    subscriptions: BTreeMap<u32, Waiting>,
    time_ns: Option<u64>,
    dropped: u64,
    told: u64,
    /// What was taken by it.
    taken: u64,
}

#[derive(Default)]
struct State {
    session: u64,
    topics: BTreeMap<String, Topic>,
    channels: u64,
    messages: u64,
    now_ns: u64,
    viewers: BTreeMap<u64, Viewer>,
    entered: u64,
}

/// Topics and viewers.
#[derive(Default)]
pub(super) struct Hub {
    /// What no other server's sessions are called.
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

    /// Another run begins: its time starts again.
    pub(super) fn begin(&self) {
        let mut state = self.state();
        state.session += 1;
        state.topics.clear();
        state.now_ns = 0;
        self.changed.notify_all();
    }

    /// Hands a message to whoever wants it.
    pub(super) fn publish(&self, topic: &str, form: impl FnOnce() -> Form, message: Message) {
        let mut state = self.state();
        let state = &mut *state;
        let message = Arc::new(message);
        state.now_ns = state.now_ns.max(message.at_ns);
        state.messages += 1;
        let channel = match state.topics.get_mut(topic) {
            Some(known) => {
                known.newest = Arc::clone(&message);
                known.channel.id
            }
            None => {
                state.channels += 1;
                let (id, newest) = (state.channels, Arc::clone(&message));
                let channel = Arc::new(Channel { id, topic: topic.to_owned(), form: form() });
                state.topics.insert(topic.to_owned(), Topic { channel, newest });
                id
            }
        };
        for viewer in state.viewers.values_mut() {
            let of_channel = viewer.subscriptions.values_mut().filter(|waiting| waiting.channel == channel);
            viewer.dropped += of_channel.map(|waiting| waiting.push(state.messages, &message)).sum::<u64>();
        }
        self.changed.notify_all();
    }

    /// A viewer comes; gives its number.
    pub(super) fn enter(&self) -> u64 {
        let mut state = self.state();
        state.entered += 1;
        let id = state.entered;
        state.viewers.insert(id, Viewer::default());
        self.changed.notify_all();
        id
    }

    /// A viewer goes; gives how many messages it got, and how many were dropped.
    pub(super) fn leave(&self, id: u64) -> (u64, u64) {
        let gone = self.state().viewers.remove(&id);
        gone.map_or((0, 0), |viewer| (viewer.taken, viewer.dropped))
    }

    /// Does what a viewer asks for.
    pub(super) fn hear(&self, id: u64, asked: Asked) {
        let mut state = self.state();
        let state = &mut *state;
        let Some(viewer) = state.viewers.get_mut(&id) else { return };
        match asked {
            Asked::Subscribe { subscriptions } => {
                for wanted in subscriptions {
                    let topic = state.topics.values().find(|topic| topic.channel.id == wanted.channel_id);
                    let is_known = viewer.subscriptions.contains_key(&wanted.id);
                    // A channel of the run before is no more.
                    let Some(topic) =
                        topic.filter(|_| !is_known && viewer.subscriptions.len() < SUBSCRIPTIONS)
                    else {
                        continue;
                    };
                    let mut waiting = Waiting { channel: wanted.channel_id, ..Waiting::default() };
                    waiting.push(0, &topic.newest);
                    viewer.subscriptions.insert(wanted.id, waiting);
                }
            }
            Asked::Unsubscribe { subscription_ids } => {
                viewer.subscriptions.retain(|id, _| !subscription_ids.contains(id));
            }
            Asked::Other => {}
        }
    }

    /// What a viewer is to be sent next; waits a little where there is nothing.
    pub(super) fn next(&self, id: u64, wait: Duration) -> Option<Todo> {
        let mut state = self.state();
        if let Some(todo) = state.next(id, &self.name) {
            return Some(todo);
        }
        if wait.is_zero() {
            return None;
        }
        state = self.changed.wait_timeout(state, wait).unwrap_or_else(PoisonError::into_inner).0;
        state.next(id, &self.name)
    }

    /// Waits until more viewers than so many have come, at most so long; whether they have, and how many it were.
    pub(super) fn wait_for_viewers(&self, more_than: u64, wait: Duration) -> Option<u64> {
        let none = |state: &mut State| state.entered <= more_than;
        let waited = self.changed.wait_timeout_while(self.state(), wait, none);
        let (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        (state.entered > more_than).then_some(state.entered)
    }
}

impl State {
    fn next(&mut self, id: u64, name: &str) -> Option<Todo> {
        let viewer = self.viewers.get_mut(&id)?;
        if viewer.session != Some(self.session) {
            viewer.session = Some(self.session);
            viewer.subscriptions.clear();
            viewer.time_ns = None;
            let gone = core::mem::take(&mut viewer.advertised);
            return Some(Todo::Session(format!("{name}-{}", self.session), gone));
        }
        if viewer.advertised.len() < self.topics.len() {
            let is_new = |topic: &&Topic| !viewer.advertised.contains(&topic.channel.id);
            let new: Vec<_> =
                self.topics.values().filter(is_new).map(|topic| Arc::clone(&topic.channel)).collect();
            viewer.advertised.extend(new.iter().map(|channel| channel.id));
            return Some(Todo::Advertise(new));
        }
        let first = |waiting: &Waiting| waiting.messages.front().map(|(number, _)| *number);
        let next = viewer.subscriptions.iter_mut().filter_map(|(id, w)| Some((first(w)?, id, w)));
        let next = next.min_by_key(|(number, ..)| *number);
        // Told now and then while it goes on, and at the end of what waits.
        if viewer.dropped > viewer.told && (next.is_none() || viewer.dropped >= 2 * viewer.told) {
            viewer.told = viewer.dropped;
            return Some(Todo::Dropped(viewer.dropped));
        }
        let Some((_, id, waiting)) = next else {
            let is_late = viewer.time_ns.is_none_or(|told| told < self.now_ns);
            return is_late.then(|| Todo::Time(*viewer.time_ns.insert(self.now_ns)));
        };
        let (_, message) = waiting.messages.front()?;
        if viewer.time_ns.is_none_or(|told| told + TICK_NS <= message.at_ns) {
            return Some(Todo::Time(*viewer.time_ns.insert(message.at_ns)));
        }
        let (_, message) = waiting.messages.pop_front()?;
        waiting.bytes -= message.bytes;
        viewer.taken += 1;
        Some(Todo::Message(*id, message))
    }
}

impl Waiting {
    /// Has a message wait; gives how many are dropped for it.
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
