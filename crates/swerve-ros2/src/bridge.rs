//! ROS 2 node: subscribers and publishers, with reception on a separate thread.
//!
//! Workarounds for RustDDS and ros2-client are contained in `bridge/node.rs` and the files below it, which the feature
//! `dds` turns on:
//!
//! - RustDDS does not pad fragments to four bytes: every message is padded (`cdr`);
//! - type names are not compared when matching: a writer of another type is detected through discovery and described
//!   ([`TopicStatistics::mismatch`]), and its messages are rejected, as are messages that fail their check. Other
//!   middlewares compare the types and send nothing;
//! - ros2-client's own executor subscribes to `/clock` with another type than ROS publishes, and offers parameter
//!   services that only one middleware understands: it is not run, and `/clock` is an ordinary topic;
//! - matching is tracked through DDS status events ([`Bridge::wait_matched`]): a message published
//!   before that is lost unless the topic is latched;
//! - a reliable topic may block its publisher: it waits at most [`PUBLISH_WAIT`], and the message is counted;
//! - shutdown may hang after malformed datagrams: [`Bridge::stop`] has a deadline;
//! - `ROS_DOMAIN_ID` and similar variables are not read: see [`crate::env`];
//! - a reader that lost fragments floods the log: a program that installs a logger should silence
//!   `rustdds::structure`.

#[cfg(any(feature = "dds", test))]
mod mismatch;
#[cfg(feature = "dds")]
mod node;
#[cfg(not(feature = "dds"))]
#[path = "bridge/no_node.rs"]
mod node;
mod options;
#[cfg(feature = "dds")]
mod receive;
#[cfg(feature = "dds")]
mod service;
mod statistics;

use serde::{Deserialize, Serialize};
use std::fmt;
use std::time::Duration;

pub use self::node::Bridge;
pub use self::options::{Direction, Endpoint, Options};
pub use self::statistics::{Latency, Refused, TopicStatistics};
use crate::clock::StampVerdict;
use crate::message::{AnyMessage, Kind};

/// Reason why this program has no ROS 2 node; `None` if it can start one.
pub const MISSING: Option<&str> = if cfg!(feature = "dds") { None } else { Some(NOT_BUILT) };

const NOT_BUILT: &str =
    "this program was built without ROS 2: build it with `--features ros2` (all: `--features full`)";

/// Maximum time that publishing on a reliable topic waits for slow readers.
pub const PUBLISH_WAIT: Duration = Duration::from_millis(10);

/// Identifier of an endpoint: its index in [`Options::endpoints`].
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct EndpointId(pub usize);

/// GUID of a writer on the network. Not authenticated: any participant can claim any GUID.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
pub struct WriterGuid(pub [u8; 16]);

impl fmt::Display for WriterGuid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts = self.0.chunks(4).map(|part| part.iter().map(|byte| format!("{byte:02x}")).collect());
        f.write_str(&parts.collect::<Vec<String>>().join("."))
    }
}

/// A received message that passed its checks.
#[derive(Clone, PartialEq, Debug)]
pub struct Received {
    /// GUID of its writer.
    pub writer: WriterGuid,
    /// Content.
    pub message: AnyMessage,
    /// Host time of reception, nanoseconds since the Unix epoch.
    pub received_ns: i64,
    /// Source timestamp, by the writer's clock, nanoseconds since the Unix epoch.
    pub source_ns: Option<i64>,
    /// Verdict on its stamp; `None` if it has none or stamps are not judged.
    pub stamp: Option<StampVerdict>,
}

/// The bridge could not be created.
#[derive(Debug, thiserror::Error)]
pub enum BridgeError {
    /// A name that is invalid in ROS.
    #[error("`{name}` is not a ROS name: {reason}")]
    Name {
        /// The name.
        name: String,
        /// Reason.
        reason: String,
    },
    /// The transport did not start or rejected a topic.
    #[error("the ROS 2 transport does not start ({at}): {reason}")]
    Transport {
        /// Part that failed.
        at: String,
        /// Error text of the transport.
        reason: String,
    },
    /// The thread could not be started.
    #[error("no thread for the ROS 2 transport: {0}")]
    Thread(#[from] std::io::Error),
    /// The program was built without the feature `ros2`.
    #[error("{NOT_BUILT}")]
    NotBuilt,
}

/// A message was not sent.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum PublishError {
    /// The endpoint is for receiving, or does not exist.
    #[error("nothing is sent on this endpoint")]
    NoPublisher,
    /// The message type differs from that of the topic.
    #[error("the topic is of type {topic}, not {message}")]
    Kind {
        /// Type of the topic.
        topic: Kind,
        /// Type of the message.
        message: Kind,
    },
    /// Readers are slower than the writer. The message is counted; the next one may succeed.
    #[error("the readers are slow: no room within 10 ms")]
    Full,
    /// The bridge was stopped.
    #[error("the bridge is stopped")]
    Stopped,
    /// The transport refused it.
    #[error("not sent: {0}")]
    Transport(String),
}

/// Side of Autoware's control mode service.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum ServiceSide {
    /// Sends requests.
    Client,
    /// Answers requests.
    Server,
}

/// A request of the control mode service failed.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ServiceError {
    /// The bridge was started without the service.
    #[error("the bridge was started without this service")]
    NotOpen,
    /// No answer in time; the other side may map services differently.
    #[error(
        "no answer in time; if the vehicle's middleware is Cyclone DDS, set `service_mapping = \"cyclone\"`"
    )]
    NoAnswer,
    /// The transport refused it.
    #[error("not sent: {0}")]
    Transport(String),
}

/// Result of stopping a bridge.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Stopped {
    /// Fully shut down.
    Clean,
    /// The transport hangs: end the process with `std::process::exit`, do not return from `main`.
    Hanging,
}

/// Maximum socket receive buffer of this host's kernel, bytes; `None` if unknown.
///
/// Below 4 MiB, megabyte messages arrive with losses: raise `net.core.rmem_max` and `net.core.rmem_default`.
pub fn receive_buffer_max() -> Option<u64> {
    std::fs::read_to_string("/proc/sys/net/core/rmem_max").ok()?.trim().parse().ok()
}
