//! Transport of messages.

use core::time::Duration;
use std::collections::{BTreeMap, BTreeSet};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use swerve_core::{Span, Time};
use swerve_drive::program::Program;
use swerve_ros2::AnyMessage;
use swerve_ros2::bridge::{Direction, Endpoint, EndpointId, Options, ServiceSide, TopicStatistics};
use swerve_ros2::mapping::{Mapping, Purpose, Role, Side};
use swerve_ros2::transport::{Transport, TransportProcess};
use swerve_stack::Setup;
use swerve_stack::config::live::{EnableBy, LiveConfig};

use crate::legacy::Legacy;

/// Host clock; run time starts when it is created.
#[derive(Clone, Copy, Debug)]
pub struct HostClock {
    begin: Instant,
    epoch_ns: i64,
}

/// Maximum age of a message when it is fetched; guards against changes of the host's clock.
const AGE_MAX: Span = Span::from_ms(1000);

impl HostClock {
    /// Starts the clock.
    #[expect(clippy::disallowed_methods, reason = "a vehicle moves in real time: this is where it is read")]
    pub fn start() -> Self {
        Self { begin: Instant::now(), epoch_ns: unix_ns() }
    }

    /// Host time at the start, nanoseconds since the Unix epoch.
    pub fn epoch_ns(&self) -> i64 {
        self.epoch_ns
    }

    /// Run time. Monotonic, even if the host's clock is set.
    #[expect(clippy::disallowed_methods, reason = "a vehicle moves in real time: this is where it is read")]
    pub fn now(&self) -> Time {
        let passed = (Instant::now() - self.begin).as_nanos();
        Time::from_ns(i64::try_from(passed).unwrap_or(i64::MAX))
    }

    /// Run time of an event with this host time, nanoseconds since the Unix epoch.
    pub fn at_host(&self, host_ns: i64) -> Time {
        let age = Span::from_ns(unix_ns().saturating_sub(host_ns)).clamp(Span::ZERO, AGE_MAX);
        self.now() - age
    }
}

#[expect(clippy::disallowed_methods, reason = "stamps of ROS are times of the day")]
fn unix_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

/// A received message.
#[derive(Debug)]
pub struct Taken<'a> {
    /// Name of its topic in the mapping.
    pub name: &'a str,
    /// Content.
    pub message: AnyMessage,
    /// Host time of reception, nanoseconds since the Unix epoch.
    pub received_ns: i64,
}

/// Result of sending a message.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Sent {
    /// Sent.
    Done,
    /// Sending failed.
    Failed,
    /// There is no topic for it, or the topic is receive-only.
    NoTopic,
}

/// Transport between the vehicle and the stack: the bridge, or a substitute in tests.
pub trait Wire: Sync {
    /// Waits for a message; returns false on timeout.
    fn wait(&self, timeout: Duration) -> bool;

    /// Takes a waiting message.
    fn take(&self) -> Option<Taken<'_>>;

    /// Sends a message on the topic of a role.
    fn send(&self, role: Role, message: AnyMessage) -> Sent;

    /// Requests a control mode of the vehicle and waits for the answer; returns true if the vehicle accepts it.
    ///
    /// # Errors
    /// If there is no answer.
    fn ask_mode(&self, mode: u8, timeout: Duration) -> Result<bool, String>;

    /// Statistics of the topics.
    fn statistics(&self) -> Vec<TopicStatistics>;

    /// Reasons why nothing usable arrives on a topic, each with the topic's name in the mapping; by what is known
    /// without waiting.
    fn faults(&self) -> Vec<(String, String)> {
        Vec::new()
    }

    /// Passes the state to the transport from which it stops the vehicle if this program dies.
    fn leave(&self, _: &Legacy) {}

    /// Descriptions of transport losses since the last call; each lost transport has been replaced.
    fn take_losses(&self) -> Vec<String> {
        Vec::new()
    }
}

/// Command-line argument that runs this program as the transport process.
pub const TRANSPORT: &str = "transport";

/// Starts a transport in a separate process of this program; `setup` is the configuration of a drive whose vehicle
/// the transport stops if this program dies.
///
/// # Errors
/// If the transport does not start.
pub(super) fn transport(mapping: &Mapping, options: &Options, setup: Vec<u8>) -> anyhow::Result<Transport> {
    let program = Program::this()?.with(&[TRANSPORT]);
    let memory_mib = mapping.transport_memory_mib;
    let process = TransportProcess { command: Box::new(move || program.command()), memory_mib, setup };
    Ok(Transport::start(options, process)?)
}

/// The bridge as a wire.
pub struct BridgeWire {
    bridge: Transport,
    sends: BTreeMap<Role, EndpointId>,
    /// Names of the topics that have one publisher.
    single: BTreeSet<String>,
}

impl BridgeWire {
    /// Starts a node for the topics of a mapping.
    ///
    /// # Errors
    /// If the transport does not start.
    pub fn start(config: &Setup, mapping: &Mapping, live: &LiveConfig) -> anyhow::Result<Self> {
        let options = options(mapping, live);
        let bridge = transport(mapping, &options, config.to_text().into_bytes())?;
        let single = mapping.topics.iter().filter(|topic| has_one_publisher(topic.role));
        let single = single.map(|topic| topic.name.clone()).collect();
        Ok(Self { sends: sends(mapping, &options.endpoints), bridge, single })
    }

    /// Stops the node.
    pub fn stop(self, deadline: Duration) {
        self.bridge.stop(deadline);
    }

    /// Number of lost transport processes.
    pub fn lost(&self) -> u64 {
        self.bridge.lost()
    }
}

/// Returns true for measurements and reports, of which several sources contradict each other.
fn has_one_publisher(role: Role) -> bool {
    use Purpose::{Localization, Perception, Report, Sensor};
    matches!(role.purpose(), Localization | Perception | Report | Sensor)
}

/// Sending endpoints by role.
pub(super) fn sends(mapping: &Mapping, endpoints: &[Endpoint]) -> BTreeMap<Role, EndpointId> {
    let sent = endpoints.iter().enumerate().filter(|(_, e)| e.direction == Direction::Send);
    let role = |(i, e): (usize, &Endpoint)| {
        let name = e.name.strip_suffix(OWN).unwrap_or(&e.name);
        mapping.topic(name).map(|topic| (topic.role, EndpointId(i)))
    };
    sent.filter_map(role).collect()
}

/// Name suffix of endpoints for our own messages on topics on which a person's messages are also received.
pub(super) const OWN: &str = " (own)";

/// Options for the stack's side of a mapping. If a person operates the switch, its topics are also received.
pub(super) fn options(mapping: &Mapping, live: &LiveConfig) -> Options {
    let mut options = Options::from_mapping(mapping, Side::Stack);
    if live.enable == EnableBy::Topic {
        let is_switch = |e: &&mut Endpoint| {
            mapping.topic(&e.name).is_some_and(|t| matches!(t.role, Role::Enable | Role::Disable))
        };
        let mut own = Vec::new();
        for endpoint in options.endpoints.iter_mut().filter(is_switch) {
            own.push(Endpoint { name: endpoint.name.clone() + OWN, ..endpoint.clone() });
            endpoint.direction = Direction::Receive;
        }
        options.endpoints.extend(own);
    }
    let service = &live.control_mode_service;
    options.control_mode_service = (!service.is_empty()).then(|| (ServiceSide::Client, service.clone()));
    options
}

impl Wire for BridgeWire {
    fn wait(&self, timeout: Duration) -> bool {
        self.bridge.wait(timeout)
    }

    fn take(&self) -> Option<Taken<'_>> {
        let (EndpointId(id), received) = self.bridge.take_any()?;
        let name = self.bridge.endpoints()[id].name.as_str();
        Some(Taken { name, message: received.message, received_ns: received.received_ns })
    }

    fn send(&self, role: Role, message: AnyMessage) -> Sent {
        match self.sends.get(&role) {
            None => Sent::NoTopic,
            Some(id) if self.bridge.publish(*id, message).is_ok() => Sent::Done,
            Some(_) => Sent::Failed,
        }
    }

    fn ask_mode(&self, mode: u8, timeout: Duration) -> Result<bool, String> {
        self.bridge.request_control_mode(mode, timeout).map_err(|error| error.to_string())
    }

    fn statistics(&self) -> Vec<TopicStatistics> {
        self.bridge.statistics()
    }

    fn faults(&self) -> Vec<(String, String)> {
        let latest = self.bridge.latest_statistics();
        let fault = |topic: &TopicStatistics| Some((topic.name.clone(), topic.fault()?.replace(OWN, "")));
        let is_crowded = |topic: &&TopicStatistics| topic.matched > 1 && self.single.contains(&topic.name);
        let crowd = |topic: &TopicStatistics| {
            let message = format!("{} has {} publishers, expected one", topic.topic, topic.matched);
            (topic.name.clone(), message)
        };
        let crowds = latest.iter().filter(is_crowded).map(crowd);
        latest.iter().filter_map(fault).chain(crowds).collect()
    }

    fn leave(&self, legacy: &Legacy) {
        if let Ok(state) = serde_json::to_vec(legacy) {
            self.bridge.leave(state);
        }
    }

    fn take_losses(&self) -> Vec<String> {
        self.bridge.take_losses()
    }
}

#[cfg(test)]
mod tests {
    use swerve_ros2::env::Network;
    use swerve_ros2::mapping::Vehicle;

    use super::*;

    #[test]
    fn switch_topics_are_received_and_sent_when_a_person_enables() {
        let mapping = Mapping::of(Vehicle::Dataspeed, Network::default());
        let ways = |enable| {
            let live = LiveConfig { enable, ..LiveConfig::default() };
            let options = options(&mapping, &live);
            let on = |topic: &str| -> Vec<Direction> {
                options.endpoints.iter().filter(|e| e.topic == topic).map(|e| e.direction).collect()
            };
            [on("/vehicle/enable"), on("/vehicle/disable"), on("/vehicle/steering/cmd")]
        };
        use Direction::{Receive, Send};
        assert_eq!(ways(EnableBy::Topic), [vec![Receive, Send], vec![Receive, Send], vec![Send]]);
        assert_eq!(ways(EnableBy::AtStart), [vec![Send], vec![Send], vec![Send]]);
    }
}
