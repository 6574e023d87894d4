//! The node: topics in, topics out, on a thread of its own.
//!
//! RustDDS and ros2-client have peculiarities that are handled here, so that nobody else has to know them:
//!
//! - fragments are not filled up to four bytes: every message is (`cdr`);
//! - type names are not compared: a writer of another type is found out by what discovery says of it, and its
//!   messages are refused; so is what fails its check;
//! - ros2-client's own executor subscribes `/clock` as another type than ROS publishes, and offers parameter
//!   services that only one middleware understands: it is not run, `/clock` is a topic like any other;
//! - who is matched is followed from DDS's own events ([`Bridge::wait_matched`]): a message that is published
//!   before that is lost unless the topic is latched;
//! - a reliable topic may block its publisher: it waits [`PUBLISH_WAIT`] at most, and the message is counted;
//! - shutting down may hang after malformed datagrams: [`Bridge::stop`] has a deadline;
//! - `ROS_DOMAIN_ID` and its like are not read: [`crate::env`];
//! - a reader that lost fragments floods the log: a program that installs a logger silences `rustdds::structure`.

mod options;
mod receive;
mod service;
mod statistics;

use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, mpsc};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use futures::channel::oneshot;
use ros2_client::dds::rustdds::DomainParticipantBuilder;
use ros2_client::dds::{Context, Node, Publisher, Subscription};
use ros2_client::qos::{Durability, History, QosProfile, Reliability, WhenFull};
use ros2_client::{MessageTypeName, Name, NodeName, NodeOptions, WriteError};

pub use self::options::{Direction, Endpoint, Options};
use self::receive::{Local, State};
use self::service::{ControlModeClient, ControlModeServer};
pub use self::service::{ServiceError, ServiceSide};
pub use self::statistics::{Latency, Refused, TopicStatistics};
use crate::cdr::Padded;
use crate::clock::StampVerdict;
use crate::mapping::Qos;
use crate::message::{AnyMessage, Kind};

/// How long publishing on a reliable topic may wait for readers that are slow.
pub const PUBLISH_WAIT: Duration = Duration::from_millis(10);

/// How long [`Bridge`] takes for its end when it is dropped without [`Bridge::stop`].
const DROP_DEADLINE: Duration = Duration::from_secs(2);

/// Which endpoint: its place in [`Options::endpoints`].
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct EndpointId(pub usize);

/// The name of a writer on the network, by which DDS tells writers apart. Anybody can claim any.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
pub struct WriterGuid(pub [u8; 16]);

impl fmt::Display for WriterGuid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts = self.0.chunks(4).map(|part| part.iter().map(|byte| format!("{byte:02x}")).collect());
        f.write_str(&parts.collect::<Vec<String>>().join("."))
    }
}

/// A message that came, and passed its checks.
#[derive(Clone, PartialEq, Debug)]
pub struct Received {
    /// Who wrote it.
    pub writer: WriterGuid,
    /// The message.
    pub message: AnyMessage,
    /// When this host received it, nanoseconds since the Unix epoch.
    pub received_ns: i64,
    /// When its writer says that it wrote it, by the writer's clock.
    pub source_ns: Option<i64>,
    /// The worth of its stamp; `None` where it has none or stamps are not judged.
    pub stamp: Option<StampVerdict>,
}

/// A bridge that could not be made.
#[derive(Debug, thiserror::Error)]
pub enum BridgeError {
    /// A name that ROS does not allow.
    #[error("`{name}` is no name in ROS: {reason}")]
    Name {
        /// The name.
        name: String,
        /// Why not.
        reason: String,
    },
    /// The transport did not start, or refused a topic.
    #[error("the ROS 2 transport does not start ({at}): {reason}")]
    Transport {
        /// For what.
        at: String,
        /// Its own words.
        reason: String,
    },
    /// No thread.
    #[error("no thread for the ROS 2 transport: {0}")]
    Thread(#[from] std::io::Error),
}

/// A message that was not sent.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum PublishError {
    /// The endpoint receives, or there is none of this number.
    #[error("nothing is sent on this endpoint")]
    NoPublisher,
    /// The message is of another kind than the topic.
    #[error("the topic is of type {topic}, not {message}")]
    Kind {
        /// The topic's.
        topic: Kind,
        /// The message's.
        message: Kind,
    },
    /// Readers are slower than the writer: it is counted, the next message has a new chance.
    #[error("the readers are slow: no room within 10 ms")]
    Full,
    /// The bridge was stopped.
    #[error("the bridge is stopped")]
    Stopped,
    /// The transport refused it.
    #[error("not sent: {0}")]
    Transport(String),
}

/// How a bridge ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Stopped {
    /// All is gone.
    Clean,
    /// The transport still hangs: end the process with `std::process::exit`, do not return from `main`.
    Hanging,
}

/// A node with its topics.
pub struct Bridge {
    endpoints: Vec<Endpoint>,
    shared: Arc<Shared>,
    node: Option<NodeParts>,
    sent: Vec<Sent>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// The parts that belong to DDS, to be dropped together.
struct NodeParts {
    publishers: Vec<Option<Publisher<Padded>>>,
    client: Option<ControlModeClient>,
    server: Option<ControlModeServer>,
    /// Announces what there is for as long as it lives.
    _node: Node,
}

#[derive(Default)]
struct Sent {
    published: AtomicU64,
    failed: AtomicU64,
}

/// The state that the receiving thread and the readers share.
struct Shared {
    state: Mutex<State>,
    news: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        // A panic while it was held would be a bug of ours in plain bookkeeping: what is there is still whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Bridge {
    /// Starts a node.
    ///
    /// # Errors
    /// Names that ROS does not allow, sockets that cannot be opened.
    pub fn start(options: &Options) -> Result<Self, BridgeError> {
        let transport = |at: &str, reason: &dyn std::fmt::Display| BridgeError::Transport {
            at: at.to_owned(),
            reason: reason.to_string(),
        };
        let mut builder = DomainParticipantBuilder::new(options.network.domain);
        if let Some(addresses) = options.network.addresses() {
            builder = builder.with_only_networks(addresses);
        }
        let participant = builder.build().map_err(|e| transport("participant", &e))?;
        let context =
            Context::from_domain_participant(participant.clone()).map_err(|e| transport("context", &e))?;
        let name = NodeName::new(&options.namespace, &options.node).map_err(|e| BridgeError::Name {
            name: format!("{} {}", options.namespace, options.node),
            reason: format!("{e:?}"),
        })?;
        // Neither logs nor parameters go over the network: the first would flood it, the second work with one
        // middleware only.
        let node_options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        let mut node = context.new_node(name, node_options).map_err(|e| transport("node", &e))?;

        let mut parts = Parts::default();
        for (i, endpoint) in options.endpoints.iter().enumerate() {
            parts.add(&mut node, i, endpoint)?;
        }
        let service = options.control_mode_service.as_ref();
        let (client, server) = service::open(&mut node, options.service_map, service)?;
        let state = State::new(&options.endpoints, options.judge_stamps);
        let shared = Arc::new(Shared { state: Mutex::new(state), news: Condvar::new() });
        let (stop, stopped) = oneshot::channel();
        let Parts { subscriptions, publishers, local } = parts;
        let thread = thread::Builder::new().name("swerve-ros2".to_owned()).spawn({
            let shared = Arc::clone(&shared);
            move || receive::run(&shared, &participant, &subscriptions, &local, stopped)
        })?;
        Ok(Self {
            endpoints: options.endpoints.clone(),
            shared,
            node: Some(NodeParts { publishers, client, server, _node: node }),
            sent: options.endpoints.iter().map(|_| Sent::default()).collect(),
            stop: Some(stop),
            thread: Some(thread),
        })
    }

    /// The endpoint of this name.
    pub fn endpoint(&self, name: &str) -> Option<EndpointId> {
        self.endpoints.iter().position(|endpoint| endpoint.name == name).map(EndpointId)
    }

    /// All endpoints, in the order of their numbers.
    pub fn endpoints(&self) -> &[Endpoint] {
        &self.endpoints
    }

    /// Sends a message; it is not checked, what we send is ours to answer for.
    ///
    /// # Errors
    /// See [`PublishError`]; all are counted.
    pub fn publish(&self, EndpointId(id): EndpointId, message: AnyMessage) -> Result<(), PublishError> {
        let Some(parts) = &self.node else { return Err(PublishError::Stopped) };
        let Some(publisher) = parts.publishers.get(id).and_then(Option::as_ref) else {
            return Err(PublishError::NoPublisher);
        };
        let (topic, message_kind) = (self.endpoints[id].kind, message.kind());
        if topic != message_kind {
            return Err(PublishError::Kind { topic, message: message_kind });
        }
        let result = publisher.publish(Padded(message)).map_err(|e| match e {
            WriteError::WouldBlock { .. } => PublishError::Full,
            other => PublishError::Transport(other.to_string()),
        });
        let counter = if result.is_ok() { &self.sent[id].published } else { &self.sent[id].failed };
        counter.fetch_add(1, Ordering::Relaxed);
        result
    }

    /// The oldest message that waits on this endpoint.
    pub fn take(&self, EndpointId(id): EndpointId) -> Option<Received> {
        self.shared.lock().take(id)
    }

    /// A message of any endpoint, in turn.
    pub fn take_any(&self) -> Option<(EndpointId, Received)> {
        self.shared.lock().take_any().map(|(id, received)| (EndpointId(id), received))
    }

    /// Waits until a message waits on any endpoint; `false` when none came in time.
    pub fn wait(&self, timeout: Duration) -> bool {
        self.wait_until(timeout, State::has_any)
    }

    /// The name on the network of who sends on this endpoint.
    pub fn writer(&self, EndpointId(id): EndpointId) -> Option<WriterGuid> {
        let publisher = self.node.as_ref()?.publishers.get(id)?.as_ref()?;
        Some(WriterGuid(publisher.gid().to_bytes16()))
    }

    /// How many others read or write this topic.
    pub fn matched(&self, EndpointId(id): EndpointId) -> usize {
        self.shared.lock().matched(id)
    }

    /// Waits until so many others read or write this topic; `false` when they did not in time.
    pub fn wait_matched(&self, EndpointId(id): EndpointId, others: usize, timeout: Duration) -> bool {
        self.wait_until(timeout, |state| state.matched(id) >= others)
    }

    fn wait_until(&self, timeout: Duration, mut reached: impl FnMut(&State) -> bool) -> bool {
        let state = self.shared.lock();
        let waited = self.shared.news.wait_timeout_while(state, timeout, |state| !reached(state));
        let (_state, result) = waited.unwrap_or_else(PoisonError::into_inner);
        !result.timed_out()
    }

    /// Asks the vehicle for a control mode (as in `ControlModeReport`), and waits for the answer: whether it took it.
    ///
    /// # Errors
    /// There is no such service, or no answer in time.
    pub fn request_control_mode(&self, mode: u8, timeout: Duration) -> Result<bool, ServiceError> {
        let client = self.node.as_ref().and_then(|parts| parts.client.as_ref());
        client.ok_or(ServiceError::NotOpen)?.call(mode, timeout, &self.shared)
    }

    /// Answers the requests for a control mode that wait: `take` says whether the vehicle takes the mode. Returns
    /// how many were answered.
    ///
    /// # Errors
    /// There is no such service.
    pub fn serve_control_mode(&self, take: impl FnMut(u8) -> bool) -> Result<usize, ServiceError> {
        let server = self.node.as_ref().and_then(|parts| parts.server.as_ref());
        Ok(server.ok_or(ServiceError::NotOpen)?.serve(take))
    }

    /// Counts so far, by endpoint.
    pub fn statistics(&self) -> Vec<TopicStatistics> {
        let state = self.shared.lock();
        let both = self.endpoints.iter().zip(&self.sent).enumerate();
        both.map(|(i, (endpoint, sent))| {
            let published = sent.published.load(Ordering::Relaxed);
            let not_published = sent.failed.load(Ordering::Relaxed);
            TopicStatistics { published, not_published, ..state.statistics(i, endpoint) }
        })
        .collect()
    }

    /// Ends the node. The transport may hang when it was fed malformed datagrams; then this returns all the same,
    /// and the process has to be ended.
    pub fn stop(mut self, deadline: Duration) -> Stopped {
        self.end(deadline)
    }

    fn end(&mut self, deadline: Duration) -> Stopped {
        let (Some(parts), Some(thread)) = (self.node.take(), self.thread.take()) else {
            return Stopped::Clean;
        };
        if let Some(stop) = self.stop.take() {
            // It fails where the thread has ended by itself: that is what was wanted.
            let _ = stop.send(());
        }
        let (done, wait) = mpsc::sync_channel(1);
        let ending = thread::Builder::new().name("swerve-ros2-end".to_owned()).spawn(move || {
            let _ = thread.join();
            drop(parts);
            let _ = done.send(());
        });
        match ending {
            Ok(_) if wait.recv_timeout(deadline).is_ok() => Stopped::Clean,
            _ => Stopped::Hanging,
        }
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        self.end(DROP_DEADLINE);
    }
}

#[derive(Default)]
struct Parts {
    subscriptions: Vec<(usize, Kind, Subscription<AnyMessage>)>,
    publishers: Vec<Option<Publisher<Padded>>>,
    local: Local,
}

impl Parts {
    fn add(&mut self, node: &mut Node, i: usize, endpoint: &Endpoint) -> Result<(), BridgeError> {
        let Endpoint { topic, kind, .. } = endpoint;
        let name = Name::parse(topic)
            .map_err(|e| BridgeError::Name { name: topic.clone(), reason: format!("{e:?}") })?;
        let refused = |reason: &dyn std::fmt::Display| BridgeError::Transport {
            at: topic.clone(),
            reason: reason.to_string(),
        };
        let qos = profile(endpoint.qos);
        let type_name = MessageTypeName::new(kind.package(), kind.name());
        let dds_topic = node.create_topic(&name, type_name, &qos).map_err(|e| refused(&e))?;
        match endpoint.direction {
            Direction::Receive => {
                let subscription =
                    node.create_subscription(&dds_topic, Some(qos)).map_err(|e| refused(&e))?;
                self.local.insert(subscription.gid(), i);
                self.subscriptions.push((i, *kind, subscription));
                self.publishers.push(None);
            }
            Direction::Send => {
                let publisher = node.create_publisher(&dds_topic, Some(qos)).map_err(|e| refused(&e))?;
                self.local.insert(publisher.gid(), i);
                self.publishers.push(Some(publisher));
            }
        }
        Ok(())
    }
}

fn profile(qos: Qos) -> QosProfile {
    let reliability = if qos.reliable {
        Reliability::Reliable { when_full: WhenFull::Wait(PUBLISH_WAIT) }
    } else {
        Reliability::BestEffort
    };
    let durability = if qos.transient_local { Durability::TransientLocal } else { Durability::Volatile };
    QosProfile::subscription_default()
        .reliability(reliability)
        .durability(durability)
        .history(History::KeepLast { depth: qos.depth })
}

/// The largest receive buffer that this host's kernel gives a socket, bytes; `None` where it does not say.
///
/// Below 4 MiB, messages of a megabyte arrive with losses: raise `net.core.rmem_max` and `net.core.rmem_default`.
pub fn receive_buffer_max() -> Option<u64> {
    std::fs::read_to_string("/proc/sys/net/core/rmem_max").ok()?.trim().parse().ok()
}
