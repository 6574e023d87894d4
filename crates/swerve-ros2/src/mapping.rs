//! Which of our streams is which topic: built-in tables for known vehicles, changed by a table in TOML.
//!
//! ```toml
//! [ros2]
//! vehicle = "autoware"            # or "dataspeed", "raptor", "plain"
//! node = "swerve"
//! domain = 3                      # else ROS_DOMAIN_ID
//! localhost_only = true           # else ROS_LOCALHOST_ONLY
//! service_mapping = "cyclone"     # how the other side's middleware maps services; "enhanced" is Fast DDS's
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
//! [ros2.topics.camera_left]       # a topic more: any name, and the role that it plays
//! role = "camera"
//! topic = "/left/image_raw"
//! ```
//!
//! A topic is `enabled = false` to leave it out. Errors name the key and the nearest valid one.

pub(crate) mod role;
pub(crate) mod tables;

use std::collections::BTreeMap;

use toml::{Table, Value};

pub use role::{Purpose, Role, Side};
pub use tables::Vehicle;

use crate::env::Network;
use crate::message::Kind;

/// How a topic's messages are delivered.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Qos {
    /// Whether what is lost is sent again. A reader that wants that is not matched with a writer that does not.
    pub reliable: bool,
    /// Whether who comes late gets what was sent before.
    pub transient_local: bool,
    /// How many messages are kept.
    pub depth: usize,
}

impl Qos {
    /// Sensors: the newest five, lost ones stay lost.
    pub const SENSOR: Self = Self { reliable: false, transient_local: false, depth: 5 };
    /// ROS's default: the newest ten, lost ones are sent again.
    pub const DEFAULT: Self = Self { reliable: true, transient_local: false, depth: 10 };
    /// Autoware's vehicle topics: only the newest counts.
    pub const VEHICLE: Self = Self { reliable: true, transient_local: false, depth: 1 };
    /// Maps and fixed frames: the newest one also for who comes late.
    pub const LATCHED: Self = Self { reliable: true, transient_local: true, depth: 1 };

    const NAMES: [(&str, Self); 4] = [
        ("sensor", Self::SENSOR),
        ("default", Self::DEFAULT),
        ("vehicle", Self::VEHICLE),
        ("latched", Self::LATCHED),
    ];
}

/// One topic.
#[derive(Clone, PartialEq, Debug)]
pub struct TopicMap {
    /// Its name here.
    pub name: String,
    /// The use that it is of.
    pub role: Role,
    /// Its name in ROS.
    pub topic: String,
    /// The type of its messages.
    pub kind: Kind,
    /// How it is delivered.
    pub qos: Qos,
    /// The frame of its messages; empty where they have none or any is taken.
    pub frame: String,
    /// Faster than this is a flood; `None` for any.
    pub rate_max_hz: Option<f64>,
}

/// How requests and replies are told apart, which differs between middlewares.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum ServiceMap {
    /// `rmw_fastrtps`.
    #[default]
    Enhanced,
    /// `rmw_cyclonedds`.
    Cyclone,
    /// Plain remote procedure calls over DDS.
    Basic,
}

/// Everything that a bridge is told.
#[derive(Clone, PartialEq, Debug)]
pub struct Mapping {
    /// Which table it began with.
    pub vehicle: Vehicle,
    /// Name of the node.
    pub node: String,
    /// Namespace of the node, beginning with a slash.
    pub namespace: String,
    /// Where to look for others.
    pub network: Network,
    /// How services are mapped.
    pub service_map: ServiceMap,
    /// Name of the map frame.
    pub map_frame: String,
    /// Name of the frame at the centre of the rear axle.
    pub base_frame: String,
    /// All topics, by name.
    pub topics: Vec<TopicMap>,
}

/// A mistake in the table.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("`{key}`: {problem}{}", suggestion(.nearest.as_deref()))]
pub struct MappingError {
    /// The key, from the top of the table: `topics.lidar.qos`.
    pub key: String,
    /// The mistake.
    pub problem: String,
    /// The name that was probably meant.
    pub nearest: Option<String>,
}

fn suggestion(nearest: Option<&str>) -> String {
    nearest.map_or_else(String::new, |name| format!("; did you mean `{name}`?"))
}

impl Mapping {
    /// The built-in table of a vehicle.
    pub fn of(vehicle: Vehicle, network: Network) -> Self {
        Self {
            vehicle,
            node: "swerve".to_owned(),
            namespace: "/".to_owned(),
            network,
            service_map: ServiceMap::default(),
            map_frame: "map".to_owned(),
            base_frame: "base_link".to_owned(),
            topics: tables::topics(vehicle),
        }
    }

    /// The table of the vehicle that `[ros2]` names, changed as it says. `table` is what is below `[ros2]`;
    /// `network` what the environment says, which the table overrules.
    ///
    /// # Errors
    /// A key that there is not, or a value that it cannot have.
    pub fn from_table(table: &Table, network: Network) -> Result<Self, MappingError> {
        let vehicle = match table.get("vehicle") {
            None => Vehicle::default(),
            Some(value) => named("vehicle", value, &Vehicle::NAMES)?,
        };
        let mut mapping = Self::of(vehicle, network);
        for (key, value) in table {
            match key.as_str() {
                "vehicle" => {}
                "node" => mapping.node = name(key, value)?,
                "namespace" => mapping.namespace = path(key, value)?,
                "domain" => mapping.network.domain = whole(key, value, 0, 232)? as u16,
                "localhost_only" => mapping.network.localhost_only = truth(key, value)?,
                "service_mapping" => mapping.service_map = named(key, value, &SERVICE_NAMES)?,
                "frames" => mapping.set_frames(subtable(key, value)?)?,
                "topics" => mapping.set_topics(subtable(key, value)?)?,
                _ => {
                    const KEYS: [&str; 8] = [
                        "vehicle",
                        "node",
                        "namespace",
                        "domain",
                        "localhost_only",
                        "service_mapping",
                        "frames",
                        "topics",
                    ];
                    return Err(unknown(key, key, &KEYS));
                }
            }
        }
        Ok(mapping)
    }

    fn set_frames(&mut self, table: &Table) -> Result<(), MappingError> {
        for (key, value) in table {
            let at = format!("frames.{key}");
            match key.as_str() {
                "map" => self.map_frame = text(&at, value)?,
                "base_link" => self.base_frame = text(&at, value)?,
                _ => return Err(unknown(&at, key, &["map", "base_link"])),
            }
        }
        Ok(())
    }

    fn set_topics(&mut self, table: &Table) -> Result<(), MappingError> {
        for (name, value) in table {
            let at = format!("topics.{name}");
            let own = subtable(&at, value)?;
            let known = self.topics.iter().position(|topic| topic.name == *name);
            let mut topic = match known {
                Some(i) => self.topics.remove(i),
                None => self.new_topic(&at, name, own)?,
            };
            if topic.change(&at, own)? {
                self.topics.push(topic);
            }
        }
        self.topics.sort_by(|a, b| a.name.cmp(&b.name));
        let mut taken: BTreeMap<&str, (&str, Side)> = BTreeMap::new();
        for topic in &self.topics {
            let here = (topic.name.as_str(), topic.role.side());
            if let Some((other, side)) = taken.insert(&topic.topic, here)
                && side == here.1
            {
                let problem = format!("`{other}` is on `{}` too", topic.topic);
                return Err(MappingError {
                    key: format!("topics.{}.topic", topic.name),
                    problem,
                    nearest: None,
                });
            }
        }
        Ok(())
    }

    /// A topic that the vehicle's table does not have: it needs at least its name in ROS.
    fn new_topic(&self, at: &str, name: &str, own: &Table) -> Result<TopicMap, MappingError> {
        let role = match own.get("role") {
            Some(value) => named(&format!("{at}.role"), value, &role::names())?,
            None => match role::names().into_iter().find(|(role, _)| *role == name) {
                Some((_, role)) => role,
                None => {
                    let names: Vec<&str> = self
                        .topics
                        .iter()
                        .map(|t| t.name.as_str())
                        .chain(Role::ALL.iter().map(|r| r.name()))
                        .collect();
                    let mut error = unknown(at, name, &names);
                    error.problem += "; a topic of another name needs `role`";
                    return Err(error);
                }
            },
        };
        if !own.contains_key("topic") {
            let problem = "a topic that is not in the vehicle's table needs its name in ROS".to_owned();
            return Err(MappingError { key: format!("{at}.topic"), problem, nearest: None });
        }
        Ok(TopicMap {
            name: name.to_owned(),
            role,
            topic: String::new(),
            kind: role.kinds()[0],
            qos: role.qos(),
            frame: String::new(),
            rate_max_hz: role.rate_max_hz(),
        })
    }

    /// The topic of this name.
    pub fn topic(&self, name: &str) -> Option<&TopicMap> {
        self.topics.iter().find(|topic| topic.name == name)
    }

    /// The topics of this role, by name.
    pub fn with_role(&self, role: Role) -> impl Iterator<Item = &TopicMap> {
        self.topics.iter().filter(move |topic| topic.role == role)
    }
}

impl TopicMap {
    /// `false` where the topic is left out.
    fn change(&mut self, at: &str, table: &Table) -> Result<bool, MappingError> {
        let mut enabled = true;
        for (key, value) in table {
            let at = format!("{at}.{key}");
            match key.as_str() {
                "topic" => self.topic = path(&at, value)?,
                "type" => self.kind = self.kind_of(&at, value)?,
                "qos" => self.qos = qos(&at, value, self.qos)?,
                "frame" => self.frame = text(&at, value)?,
                "rate_max_hz" => self.rate_max_hz = Some(rate(&at, value)?),
                "enabled" => enabled = truth(&at, value)?,
                "role" => {
                    let role = named(&at, value, &role::names())?;
                    if role != self.role {
                        let problem = format!("it is `{}` in the vehicle's table", self.role.name());
                        return Err(MappingError { key: at, problem, nearest: None });
                    }
                }
                _ => {
                    const KEYS: [&str; 7] =
                        ["role", "topic", "type", "qos", "frame", "rate_max_hz", "enabled"];
                    return Err(unknown(&at, key, &KEYS));
                }
            }
        }
        Ok(enabled)
    }

    fn kind_of(&self, at: &str, value: &Value) -> Result<Kind, MappingError> {
        let written = text(at, value)?;
        let allowed = self.role.kinds();
        if let Some(kind) = Kind::parse(&written).filter(|kind| allowed.contains(kind)) {
            return Ok(kind);
        }
        let names: Vec<String> = allowed.iter().map(|kind| kind.type_name()).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let problem = format!("`{written}` is no type that `{}` can have", self.role.name());
        Err(MappingError { problem, ..unknown(at, &written, &names) })
    }
}

const SERVICE_NAMES: [(&str, ServiceMap); 3] =
    [("enhanced", ServiceMap::Enhanced), ("cyclone", ServiceMap::Cyclone), ("basic", ServiceMap::Basic)];

fn unknown(at: &str, written: &str, names: &[&str]) -> MappingError {
    let likeness = |name: &str| strsim::jaro_winkler(written, name);
    let nearest = names.iter().copied().reduce(|a, b| if likeness(b) > likeness(a) { b } else { a });
    let nearest = nearest.filter(|name| likeness(name) > 0.7 || names.len() == 1).map(str::to_owned);
    let problem = format!("there is no `{written}`");
    MappingError { key: at.to_owned(), problem, nearest }
}

fn wrong<T>(at: &str, value: &Value, wanted: &str) -> Result<T, MappingError> {
    let problem = format!("{wanted} was expected, not `{value}`");
    Err(MappingError { key: at.to_owned(), problem, nearest: None })
}

fn text(at: &str, value: &Value) -> Result<String, MappingError> {
    match value.as_str() {
        Some(text) if text.len() < 256 && !text.chars().any(char::is_control) => Ok(text.to_owned()),
        _ => wrong(at, value, "a text"),
    }
}

/// A name of letters, digits and underscores that does not begin with a digit.
fn name(at: &str, value: &Value) -> Result<String, MappingError> {
    let name = text(at, value)?;
    if is_name(&name) { Ok(name) } else { wrong(at, value, "a name of letters, digits and `_`") }
}

fn is_name(name: &str) -> bool {
    let first = name.chars().next().is_some_and(|c| c.is_ascii_alphabetic() || c == '_');
    first && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') && !name.contains("__")
}

/// Names with slashes, beginning with one.
fn path(at: &str, value: &Value) -> Result<String, MappingError> {
    let path = text(at, value)?;
    let parts = path.strip_prefix('/').map(|rest| rest.is_empty() || rest.split('/').all(is_name));
    if parts == Some(true) { Ok(path) } else { wrong(at, value, "a name in ROS such as \"/sensing/lidar\"") }
}

fn truth(at: &str, value: &Value) -> Result<bool, MappingError> {
    value.as_bool().map_or_else(|| wrong(at, value, "true or false"), Ok)
}

fn whole(at: &str, value: &Value, min: i64, max: i64) -> Result<i64, MappingError> {
    match value.as_integer() {
        Some(n) if (min..=max).contains(&n) => Ok(n),
        _ => wrong(at, value, &format!("a whole number from {min} to {max}")),
    }
}

fn rate(at: &str, value: &Value) -> Result<f64, MappingError> {
    let rate = value.as_float().or_else(|| value.as_integer().map(|n| n as f64));
    match rate {
        Some(hz) if (0.01..=100_000.0).contains(&hz) => Ok(hz),
        _ => wrong(at, value, "a rate from 0.01 to 100000"),
    }
}

fn subtable<'a>(at: &str, value: &'a Value) -> Result<&'a Table, MappingError> {
    value.as_table().map_or_else(|| wrong(at, value, "a table"), Ok)
}

fn named<T: Copy>(at: &str, value: &Value, names: &[(&str, T)]) -> Result<T, MappingError> {
    let written = text(at, value)?;
    if let Some((_, found)) = names.iter().find(|(name, _)| *name == written) {
        return Ok(*found);
    }
    let names: Vec<&str> = names.iter().map(|(name, _)| *name).collect();
    Err(unknown(at, &written, &names))
}

/// A name of a set, or a table of single policies over what it was.
fn qos(at: &str, value: &Value, mut qos: Qos) -> Result<Qos, MappingError> {
    let Some(table) = value.as_table() else { return named(at, value, &Qos::NAMES) };
    for (key, value) in table {
        let at = format!("{at}.{key}");
        match key.as_str() {
            "reliability" => qos.reliable = named(&at, value, &[("reliable", true), ("best_effort", false)])?,
            "durability" => {
                qos.transient_local = named(&at, value, &[("transient_local", true), ("volatile", false)])?;
            }
            "depth" => qos.depth = whole(&at, value, 1, 10_000)? as usize,
            _ => return Err(unknown(&at, key, &["reliability", "durability", "depth"])),
        }
    }
    Ok(qos)
}

#[cfg(test)]
mod tests;
