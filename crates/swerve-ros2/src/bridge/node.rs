//! The node over DDS.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError, mpsc};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use futures::channel::oneshot;
use ros2_client::dds::rustdds::DomainParticipantBuilder;
use ros2_client::dds::{Context, Node, Publisher, Subscription};
use ros2_client::qos::{Durability, History, QosProfile, Reliability, WhenFull};
use ros2_client::{MessageTypeName, Name, NodeName, NodeOptions, WriteError};

use super::receive::{self, Local, Shared, State};
use super::service::{self, ControlModeClient, ControlModeServer};
use super::{
    BridgeError, Direction, Endpoint, EndpointId, Options, PUBLISH_WAIT, PublishError, Received,
    ServiceError, Stopped, TopicStatistics, WriterGuid,
};
use crate::cdr::Padded;
use crate::mapping::Qos;
use crate::message::{AnyMessage, Kind};

/// Time for shutdown when a [`Bridge`] is dropped without [`Bridge::stop`].
const DROP_DEADLINE: Duration = Duration::from_secs(2);

/// A ROS 2 node with its topics.
pub struct Bridge {
    endpoints: Vec<Endpoint>,
    shared: Arc<Shared>,
    node: Option<NodeParts>,
    sent: Vec<Sent>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// DDS entities, which must be dropped together.
struct NodeParts {
    publishers: Vec<Option<Publisher<Padded>>>,
    client: Option<ControlModeClient>,
    server: Option<ControlModeServer>,
    /// Announces the endpoints while it exists.
    _node: Node,
}

#[derive(Default)]
struct Sent {
    published: AtomicU64,
    failed: AtomicU64,
}

impl Bridge {
    /// Starts a node.
    ///
    /// # Errors
    /// If a name is invalid in ROS or a socket cannot be opened.
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
        // Neither logs nor parameters go over the network: logs would flood it, and the parameter services work
        // with one middleware only.
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

    /// The endpoint with this name.
    pub fn endpoint(&self, name: &str) -> Option<EndpointId> {
        self.endpoints.iter().position(|endpoint| endpoint.name == name).map(EndpointId)
    }

    /// All endpoints in the order of their indices.
    pub fn endpoints(&self) -> &[Endpoint] {
        &self.endpoints
    }

    /// Publishes a message without checking it.
    ///
    /// # Errors
    /// See [`PublishError`]; all failures are counted.
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

    /// Takes the oldest message waiting on this endpoint.
    pub fn take(&self, EndpointId(id): EndpointId) -> Option<Received> {
        self.shared.lock().take(id)
    }

    /// Takes a message of any endpoint, round-robin.
    pub fn take_any(&self) -> Option<(EndpointId, Received)> {
        self.shared.lock().take_any().map(|(id, received)| (EndpointId(id), received))
    }

    /// Waits for a message on any endpoint; returns false on timeout.
    pub fn wait(&self, timeout: Duration) -> bool {
        self.wait_until(timeout, State::has_any)
    }

    /// GUID of this endpoint's writer.
    pub fn writer(&self, EndpointId(id): EndpointId) -> Option<WriterGuid> {
        let publisher = self.node.as_ref()?.publishers.get(id)?.as_ref()?;
        Some(WriterGuid(publisher.gid().to_bytes16()))
    }

    /// Number of matched readers or writers of this topic.
    pub fn matched(&self, EndpointId(id): EndpointId) -> usize {
        self.shared.lock().matched(id)
    }

    /// Waits until at least `others` readers or writers are matched; returns false on timeout.
    pub fn wait_matched(&self, EndpointId(id): EndpointId, others: usize, timeout: Duration) -> bool {
        self.wait_until(timeout, |state| state.matched(id) >= others)
    }

    fn wait_until(&self, timeout: Duration, mut reached: impl FnMut(&State) -> bool) -> bool {
        let state = self.shared.lock();
        let waited = self.shared.news.wait_timeout_while(state, timeout, |state| !reached(state));
        let (_state, result) = waited.unwrap_or_else(PoisonError::into_inner);
        !result.timed_out()
    }

    /// Requests a control mode of the vehicle (as in `ControlModeReport`) and waits for the answer; returns true if
    /// it was accepted.
    ///
    /// # Errors
    /// If there is no such service, or no answer in time.
    pub fn request_control_mode(&self, mode: u8, timeout: Duration) -> Result<bool, ServiceError> {
        let client = self.node.as_ref().and_then(|parts| parts.client.as_ref());
        client.ok_or(ServiceError::NotOpen)?.call(mode, timeout, &self.shared)
    }

    /// Answers waiting requests for a control mode: `take` returns true if the vehicle accepts the mode. Returns
    /// the number of requests answered.
    ///
    /// # Errors
    /// If there is no such service.
    pub fn serve_control_mode(&self, take: impl FnMut(u8) -> bool) -> Result<usize, ServiceError> {
        let server = self.node.as_ref().and_then(|parts| parts.server.as_ref());
        Ok(server.ok_or(ServiceError::NotOpen)?.serve(take))
    }

    /// Statistics so far, by endpoint.
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

    /// Stops the node. Also returns if the transport hangs, which it may do after malformed datagrams; the process
    /// must then be ended.
    pub fn stop(mut self, deadline: Duration) -> Stopped {
        self.end(deadline)
    }

    fn end(&mut self, deadline: Duration) -> Stopped {
        let (Some(parts), Some(thread)) = (self.node.take(), self.thread.take()) else {
            return Stopped::Clean;
        };
        if let Some(stop) = self.stop.take() {
            // Fails if the thread has already ended, which is fine.
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
