//! Mapping of streams to topics: built-in tables for known vehicles, changed by a table in TOML.
//!
//! ```toml
//! [ros2]
//! vehicle = "autoware"            # or "dataspeed", "raptor", "carla", "plain"
//! node = "swerve"
//! domain = 3                      # default: ROS_DOMAIN_ID
//! localhost_only = true           # default: ROS_LOCALHOST_ONLY
//! service_mapping = "cyclone"     # service mapping of the other side's middleware; "enhanced" for Fast DDS
//! transport_memory_mib = 1024     # memory limit of the transport process
//!
//! [ros2.frames]
//! map = "map"
//!
//! [ros2.topics.lidar]
//! topic = "/os1/points"
//! qos = "sensor"
//! frame = "os1"
//! rate_max_hz = 40.0
//!
//! [ros2.topics.camera_left]       # an additional topic: any name, and its role
//! role = "camera"
//! topic = "/left/image_raw"
//! ```
//!
//! `enabled = false` removes a topic. Problems name the key and the nearest valid one.

mod qos;
mod role;
mod tables;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use swerve_text::{Problems, Range, Reading, TableReader, did_you_mean};
use toml::{Table, Value};

pub use qos::Qos;
pub use role::{Purpose, Role, Side};
pub use tables::{TopicMap, Vehicle};

use crate::env::Network;
use crate::message::Kind;

/// Correlation of requests and replies, which differs between middlewares.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub enum ServiceMap {
    /// `rmw_fastrtps`.
    #[default]
    Enhanced,
    /// `rmw_cyclonedds`.
    Cyclone,
    /// Basic service mapping of DDS-RPC.
    Basic,
}

/// Default memory limit of the transport process, MiB. About a quarter is used with all of Autoware's topics,
/// including images.
const TRANSPORT_MEMORY_MIB: u32 = 1024;

/// Mapping of a vehicle's topics, and settings of the node.
#[derive(Clone, PartialEq, Debug)]
pub struct Mapping {
    /// Vehicle whose built-in table is the base.
    pub vehicle: Vehicle,
    /// Name of the node.
    pub node: String,
    /// Namespace of the node, beginning with a slash.
    pub namespace: String,
    /// Domain and interfaces.
    pub network: Network,
    /// Mapping of services in DDS.
    pub service_map: ServiceMap,
    /// Memory limit of the transport process, MiB.
    pub transport_memory_mib: u32,
    /// Name of the map frame.
    pub map_frame: String,
    /// Name of the frame at the centre of the rear axle.
    pub base_frame: String,
    /// All topics, by name.
    pub topics: Vec<TopicMap>,
}

impl Mapping {
    /// Built-in mapping of a vehicle.
    pub fn of(vehicle: Vehicle, network: Network) -> Self {
        Self {
            vehicle,
            node: "swerve".to_owned(),
            namespace: "/".to_owned(),
            network,
            service_map: ServiceMap::default(),
            transport_memory_mib: TRANSPORT_MEMORY_MIB,
            map_frame: "map".to_owned(),
            base_frame: "base_link".to_owned(),
            topics: tables::topics(vehicle),
        }
    }

    /// Mapping of the vehicle named by `[ros2]`, with the changes in it. `table` is the content of `[ros2]`; it
    /// overrides the environment's `network`.
    ///
    /// # Errors
    /// All unknown keys and invalid values; keys are relative to `table`.
    pub fn from_table(table: &Table, network: Network) -> Result<Self, Problems> {
        let reading = Reading::without_text("[ros2]");
        let mapping = Self::read(&reading.top(table), network);
        reading.into_problems().or(mapping)
    }

    fn read(table: &TableReader<'_>, network: Network) -> Self {
        let mut mapping = Self::of(named(table, "vehicle", &Vehicle::NAMES).unwrap_or_default(), network);
        replace(&mut mapping.node, table.text_like("node", "a name of letters, digits and `_`", is_name));
        replace(&mut mapping.namespace, path(table, "namespace"));
        let domain = table.whole_if_any("domain", 0, 232);
        replace(&mut mapping.network.domain, domain.and_then(|domain| u16::try_from(domain).ok()));
        replace(&mut mapping.network.localhost_only, table.truth_if_any("localhost_only"));
        replace(&mut mapping.service_map, named(table, "service_mapping", &SERVICE_NAMES));
        let memory_mib = table.whole_if_any("transport_memory_mib", 256, 65_536);
        replace(&mut mapping.transport_memory_mib, memory_mib.and_then(|mib| u32::try_from(mib).ok()));
        if let Some(frames) = table.table_if_any("frames") {
            replace(&mut mapping.map_frame, text(&frames, "map"));
            replace(&mut mapping.base_frame, text(&frames, "base_link"));
            frames.finish();
        }
        if let Some(topics) = table.table_if_any("topics") {
            mapping.change_topics(&topics);
        }
        table.finish();
        mapping
    }

    fn change_topics(&mut self, table: &TableReader<'_>) {
        for name in table.keys() {
            let Some(own) = table.named_table(name) else { continue };
            let known = self.topics.iter().position(|topic| topic.name == *name);
            let topic = match known {
                Some(i) => Some(self.topics.remove(i)),
                None => self.new_topic(table, name, &own),
            };
            let Some(mut topic) = topic else { continue };
            if topic.change(&own) {
                self.topics.push(topic);
            }
        }
        self.topics.sort_by(|a, b| a.name.cmp(&b.name));
        let mut taken: BTreeMap<&str, &TopicMap> = BTreeMap::new();
        for topic in self.topics.iter().filter(|topic| !topic.topic.is_empty()) {
            let Some(other) = taken.insert(&topic.topic, topic) else { continue };
            let (name, kind) = (&other.name, other.kind);
            let message = if other.role.side() == topic.role.side() {
                format!("`{name}` is on `{}` too", topic.topic)
            } else if kind != topic.kind {
                format!("`{name}` is on `{}` too, with messages of type {kind}", topic.topic)
            } else {
                continue;
            };
            table.report(&format!("{}.topic", topic.name), message);
        }
    }

    /// Reads a topic that the vehicle's table does not contain: its ROS name is required.
    fn new_topic(&self, topics: &TableReader<'_>, name: &str, own: &TableReader<'_>) -> Option<TopicMap> {
        let role = if own.has("role") {
            named(own, "role", &role::names())?
        } else if let Some((_, role)) = role::names().into_iter().find(|(role, _)| *role == name) {
            role
        } else {
            let here = self.topics.iter().map(|topic| topic.name.as_str());
            let hint = did_you_mean(name, here.chain(Role::ALL.iter().map(|role| role.name())));
            topics.report(name, format!("unknown topic; one of another name needs `role`{hint}"));
            return None;
        };
        if !own.has("topic") {
            own.report(
                "topic",
                "is missing: a topic that is not in the vehicle's table needs its name in ROS",
            );
        }
        Some(TopicMap {
            name: name.to_owned(),
            role,
            topic: String::new(),
            kind: role.kinds()[0],
            qos: role.qos(),
            frame: String::new(),
            rate_max_hz: role.rate_max_hz(),
        })
    }

    /// The topic with this name.
    pub fn topic(&self, name: &str) -> Option<&TopicMap> {
        self.topics.iter().find(|topic| topic.name == name)
    }

    /// Topics of this role, ordered by name.
    pub fn with_role(&self, role: Role) -> impl Iterator<Item = &TopicMap> {
        self.topics.iter().filter(move |topic| topic.role == role)
    }
}

impl TopicMap {
    /// Applies changes; returns false if the topic is disabled.
    fn change(&mut self, table: &TableReader<'_>) -> bool {
        replace(&mut self.topic, path(table, "topic"));
        self.change_kind(table);
        self.change_qos(table);
        replace(&mut self.frame, text(table, "frame"));
        if let Some(rate_hz) = table.number_if_any("rate_max_hz", Range::between(0.01, 100_000.0)) {
            self.rate_max_hz = Some(rate_hz);
        }
        let role = named(table, "role", &role::names());
        if role.is_some_and(|role| role != self.role) {
            table.report("role", format!("it is `{}` in the vehicle's table", self.role.name()));
        }
        let enabled = table.truth_if_any("enabled").unwrap_or(true);
        table.finish();
        enabled
    }

    /// Changes the type, which is written with or without `msg` in the middle.
    fn change_kind(&mut self, table: &TableReader<'_>) {
        let allowed = self.role.kinds();
        let written = table.value("type").and_then(Value::as_str).and_then(Kind::parse);
        if let Some(kind) = written.filter(|kind| allowed.contains(kind)) {
            self.kind = kind;
            return;
        }
        let names: Vec<String> = allowed.iter().map(|kind| kind.type_name()).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        replace(&mut self.kind, table.one_of_if_any("type", &names).map(|i| allowed[i]));
    }

    /// Changes the quality of service: a named profile, or a table of single policies.
    fn change_qos(&mut self, table: &TableReader<'_>) {
        if !table.value("qos").is_some_and(Value::is_table) {
            replace(&mut self.qos, named(table, "qos", &Qos::NAMES));
            return;
        }
        let Some(table) = table.table_if_any("qos") else { return };
        let Qos { reliable, transient_local, depth } = &mut self.qos;
        replace(reliable, named(&table, "reliability", &[("reliable", true), ("best_effort", false)]));
        replace(
            transient_local,
            named(&table, "durability", &[("transient_local", true), ("volatile", false)]),
        );
        replace(depth, table.whole_if_any("depth", 1, 10_000).and_then(|depth| usize::try_from(depth).ok()));
        table.finish();
    }
}

const SERVICE_NAMES: [(&str, ServiceMap); 3] =
    [("enhanced", ServiceMap::Enhanced), ("cyclone", ServiceMap::Cyclone), ("basic", ServiceMap::Basic)];

/// Replaces a value if a new one is given.
fn replace<T>(old: &mut T, new: Option<T>) {
    if let Some(new) = new {
        *old = new;
    }
}

fn text(table: &TableReader<'_>, key: &'static str) -> Option<String> {
    let is_text = |text: &str| text.len() < 256 && !text.chars().any(char::is_control);
    table.text_like(key, "a text of one line", is_text)
}

/// Returns true for letters, digits and underscores, not starting with a digit.
fn is_name(name: &str) -> bool {
    let first = name.chars().next().is_some_and(|c| c.is_ascii_alphabetic() || c == '_');
    let rest = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') && !name.contains("__");
    first && rest && name.len() < 256
}

/// Reads a ROS name: names separated by slashes, with a leading slash.
fn path(table: &TableReader<'_>, key: &'static str) -> Option<String> {
    table.text_like(key, "a name in ROS such as \"/sensing/lidar\"", |path| {
        let is_path = |rest: &str| rest.is_empty() || rest.split('/').all(is_name);
        path.len() < 256 && path.strip_prefix('/').is_some_and(is_path)
    })
}

fn named<T: Copy>(table: &TableReader<'_>, key: &'static str, names: &[(&str, T)]) -> Option<T> {
    let all: Vec<&str> = names.iter().map(|(name, _)| *name).collect();
    table.one_of_if_any(key, &all).map(|i| names[i].1)
}

#[cfg(test)]
mod tests;
