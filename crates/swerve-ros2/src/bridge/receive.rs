//! Receiving thread and its state.

use std::collections::{BTreeMap, BTreeSet};
use std::pin::pin;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use futures::channel::oneshot;
use futures::stream::{self, LocalBoxStream, StreamExt};
use futures::{FutureExt, executor};
use ros2_client::dds::Subscription;
use ros2_client::dds::rustdds::{
    DomainParticipant, DomainParticipantStatusEvent as Status, EndpointDescription, GUID, QosPolicies,
    StatusEvented, policy,
};
use ros2_client::{Gid, MessageInfo, ReadError, ReadResult};

use super::mismatch::{self, OtherQos};
use super::statistics::{Counters, TopicStatistics};
use super::{Direction, Endpoint, Received, WriterGuid};
use crate::clock::{ClockEstimator, ClockParams};
use crate::inbox::Inbox;
use crate::message::{AnyMessage, Kind};

/// Writers tracked per topic; the types of further writers are not checked.
const WRITERS_MAX: usize = 256;

/// GUID of a reader or writer, sixteen bytes.
type EndpointGid = [u8; 16];

/// Indices of our endpoints by GUID.
#[derive(Default)]
pub(super) struct Local(BTreeMap<EndpointGid, usize>);

impl Local {
    pub(super) fn insert(&mut self, gid: Gid, endpoint: usize) {
        self.0.insert(gid.to_bytes16(), endpoint);
    }

    fn find(&self, guid: GUID) -> Option<usize> {
        self.0.get(&name(guid)).copied()
    }
}

fn name(guid: GUID) -> EndpointGid {
    Gid::from(guid).to_bytes16()
}

/// State of one topic.
struct Topic {
    inbox: Inbox<Received>,
    counters: Counters,
    clock: Option<ClockEstimator>,
    /// Known writers: the newest sequence number, and the type if it differs from the topic's.
    writers: BTreeMap<EndpointGid, Writer>,
    matched: BTreeSet<EndpointGid>,
    /// Our endpoint, and its topic's name in DDS.
    endpoint: Endpoint,
    dds_topic: String,
    /// Discovered writers and readers that cannot exchange messages with us, each with its description.
    mismatches: BTreeMap<EndpointGid, String>,
}

struct Writer {
    newest: i64,
    wrong_type: Option<String>,
}

/// State of all topics.
pub(super) struct State {
    topics: Vec<Topic>,
    /// Topic at which the next search for a message starts.
    search_from: usize,
}

impl State {
    pub(super) fn new(endpoints: &[Endpoint], judge: Option<ClockParams>) -> Self {
        let topic = |endpoint: &Endpoint| Topic {
            inbox: Inbox::new(endpoint.qos.depth, endpoint.rate_max_hz),
            counters: Counters::default(),
            clock: judge.filter(|_| endpoint.direction == Direction::Receive).map(ClockEstimator::new),
            writers: BTreeMap::new(),
            matched: BTreeSet::new(),
            endpoint: endpoint.clone(),
            dds_topic: format!("rt{}", endpoint.topic),
            mismatches: BTreeMap::new(),
        };
        Self { topics: endpoints.iter().map(topic).collect(), search_from: 0 }
    }

    pub(super) fn take(&mut self, id: usize) -> Option<Received> {
        let topic = self.topics.get_mut(id)?;
        let received = topic.inbox.pop()?;
        topic.counters.delivered += 1;
        Some(received)
    }

    pub(super) fn take_any(&mut self) -> Option<(usize, Received)> {
        let n = self.topics.len();
        for i in 0..n {
            let id = (self.search_from + i) % n;
            if let Some(received) = self.take(id) {
                self.search_from = (id + 1) % n;
                return Some((id, received));
            }
        }
        None
    }

    pub(super) fn has_any(&self) -> bool {
        self.topics.iter().any(|topic| !topic.inbox.is_empty())
    }

    pub(super) fn matched(&self, id: usize) -> usize {
        self.topics.get(id).map_or(0, |topic| topic.matched.len())
    }

    pub(super) fn statistics(&self, id: usize, endpoint: &Endpoint) -> TopicStatistics {
        let topic = &self.topics[id];
        TopicStatistics {
            matched: topic.matched.len(),
            mismatch: topic.mismatches.values().next().cloned(),
            overwritten: topic.inbox.overwritten,
            over_rate: topic.inbox.over_rate,
            clock: topic.clock.as_ref().and_then(ClockEstimator::offset),
            ..topic.counters.statistics(endpoint)
        }
    }
}

impl State {
    /// Compares the type of a discovered writer or reader with those of our endpoints on its topic.
    fn compare_types(&mut self, ours: Direction, other: &EndpointDescription) {
        let ours =
            |topic: &&mut Topic| topic.endpoint.direction == ours && topic.dds_topic == other.topic_name;
        for topic in self.topics.iter_mut().filter(ours) {
            match mismatch::of_type(&topic.endpoint, &other.type_name) {
                Some(mismatch) => topic.describe(other.guid, mismatch),
                // It was announced anew; its quality of service is compared next.
                None => drop(topic.mismatches.remove(&name(other.guid))),
            }
        }
    }
}

impl Topic {
    /// Validates a message and queues it.
    fn receive(
        &mut self,
        message: AnyMessage,
        info: &MessageInfo,
        type_of: impl FnOnce(EndpointGid) -> Option<String>,
    ) {
        let received_ns = info.received_timestamp().map_or(0, |t| t.to_nanos());
        let source_ns = info.source_timestamp().map(|t| t.to_nanos());
        self.counters.receive(received_ns, source_ns);
        if let Some(wrong) = self.follow(info, message.kind(), type_of) {
            self.counters.refused.wrong_type += 1;
            self.counters.last_refusal = Some(format!("its writer declares the type {wrong}"));
            return;
        }
        if let Err(invalid) = message.check() {
            self.counters.refused.implausible += 1;
            self.counters.last_refusal = Some(invalid.to_string());
            return;
        }
        let stamp_ns = message.stamp().map(|stamp| stamp.ns());
        let stamp = match (&mut self.clock, stamp_ns) {
            (Some(clock), Some(stamp_ns)) => Some(clock.judge(stamp_ns, received_ns)),
            _ => None,
        };
        if let Some(verdict) = stamp.filter(|verdict| verdict.is_refused()) {
            self.counters.refuse_stamp(verdict);
            return;
        }
        let writer = WriterGuid(info.publisher_gid().to_bytes16());
        self.inbox.push(Received { writer, message, received_ns, source_ns, stamp }, received_ns);
    }

    /// Counts messages lost from this writer; returns the name of its type if it differs from the topic's.
    fn follow(
        &mut self,
        info: &MessageInfo,
        kind: Kind,
        type_of: impl FnOnce(EndpointGid) -> Option<String>,
    ) -> Option<String> {
        let (gid, number) = (info.publisher_gid().to_bytes16(), info.sequence_number());
        if !self.writers.contains_key(&gid) {
            if self.writers.len() >= WRITERS_MAX {
                return None;
            }
            let wrong_type = type_of(gid).filter(|name| *name != kind.dds_type_name());
            self.writers.insert(gid, Writer { newest: number, wrong_type });
        }
        let writer = self.writers.get_mut(&gid)?;
        if number > writer.newest {
            self.counters.lost += number.saturating_sub(writer.newest + 1) as u64;
            writer.newest = number;
        }
        writer.wrong_type.clone()
    }
}

impl Topic {
    /// Keeps the description of a writer or reader that does not fit; a later one of the same replaces it.
    fn describe(&mut self, other: GUID, mismatch: String) {
        if self.mismatches.len() < WRITERS_MAX || self.mismatches.contains_key(&name(other)) {
            self.mismatches.insert(name(other), mismatch);
        }
    }

    /// Records the mismatch in quality of service, unless the types differ as well.
    fn describe_qos(&mut self, other: GUID, qos: &QosPolicies) {
        self.counters.incompatible += 1;
        if !self.mismatches.contains_key(&name(other)) {
            let reliable = matches!(qos.reliability(), Some(policy::Reliability::Reliable { .. }));
            let transient_local = qos.durability().is_some_and(|kind| kind != policy::Durability::Volatile);
            let mismatch = mismatch::of_qos(&self.endpoint, OtherQos { reliable, transient_local });
            self.describe(other, mismatch);
        }
    }
}

enum Event {
    Sample(usize, Box<ReadResult<(AnyMessage, MessageInfo)>>),
    Status(Box<Status>),
    Stop,
}

/// Runs until `stopped` is sent or dropped.
pub(super) fn run(
    shared: &Shared,
    participant: &DomainParticipant,
    subscriptions: &[(usize, Kind, Subscription<AnyMessage>)],
    local: &Local,
    stopped: oneshot::Receiver<()>,
) {
    let listener = participant.status_listener();
    let mut streams: Vec<LocalBoxStream<'_, Event>> = vec![
        listener.as_async_status_stream().map(|status| Event::Status(Box::new(status))).boxed_local(),
        stopped.map(|_| Event::Stop).into_stream().boxed_local(),
    ];
    for (i, kind, subscription) in subscriptions {
        let samples = subscription.async_stream_seed(*kind);
        streams.push(samples.map(|sample| Event::Sample(*i, Box::new(sample))).boxed_local());
    }
    let mut events = pin!(stream::select_all(streams));
    executor::block_on(async {
        while let Some(event) = events.next().await {
            match event {
                Event::Stop => break,
                Event::Sample(i, sample) => match *sample {
                    Ok((message, info)) => {
                        let type_of = |gid| discovered_type(participant, gid);
                        shared.lock().topics[i].receive(message, &info, type_of);
                    }
                    Err(error) => refuse(&mut shared.lock().topics[i], &error),
                },
                Event::Status(status) => follow(&mut shared.lock(), local, &status),
            }
            shared.news.notify_all();
        }
    });
}

fn refuse(topic: &mut Topic, error: &ReadError) {
    match error {
        ReadError::Deserialization { .. } | ReadError::Malformed => {
            topic.counters.received += 1;
            topic.counters.refused.malformed += 1;
        }
        _ => topic.counters.refused.transport += 1,
    }
    topic.counters.last_refusal = Some(error.to_string());
}

/// Type of a writer according to discovery; `None` if the writer is unknown.
fn discovered_type(participant: &DomainParticipant, gid: EndpointGid) -> Option<String> {
    let writers = participant.discovered_writers();
    let writer = writers.into_iter().find(|w| name(w.publication_topic_data.key) == gid)?;
    Some(writer.publication_topic_data.type_name)
}

/// Updates matched readers and writers.
fn follow(state: &mut State, local: &Local, status: &Status) {
    match status {
        Status::RemoteReaderMatched { local_writer: ours, remote_reader: other }
        | Status::RemoteWriterMatched { local_reader: ours, remote_writer: other } => {
            if let Some(i) = local.find(*ours) {
                state.topics[i].matched.insert(name(*other));
            }
        }
        Status::ReaderLost { guid, .. } | Status::WriterLost { guid, .. } => {
            for topic in &mut state.topics {
                topic.matched.remove(&name(*guid));
                topic.writers.remove(&name(*guid));
                topic.mismatches.remove(&name(*guid));
            }
        }
        Status::ReaderDetected { reader: other } => state.compare_types(Direction::Send, other),
        Status::WriterDetected { writer: other } => state.compare_types(Direction::Receive, other),
        Status::RemoteReaderQosIncompatible {
            local_writer: ours,
            remote_reader: other,
            requested_qos: qos,
            ..
        }
        | Status::RemoteWriterQosIncompatible {
            local_reader: ours,
            remote_writer: other,
            offered_qos: qos,
            ..
        } => {
            if let Some(i) = local.find(*ours) {
                state.topics[i].describe_qos(*other, qos);
            }
        }
        _ => {}
    }
}

/// State shared between the receiving thread and the readers.
pub(super) struct Shared {
    pub(super) state: Mutex<State>,
    pub(super) news: Condvar,
}

impl Shared {
    pub(super) fn lock(&self) -> MutexGuard<'_, State> {
        // The updates leave the state consistent even if a holder of the lock panics.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
