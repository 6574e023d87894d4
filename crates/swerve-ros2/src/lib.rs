//! Bridge to ROS 2: messages, serialization, conversion, and transport.
//!
//! Pure Rust over DDS (RustDDS); no ROS installation is needed on either side.
//!
//! | module | content |
//! |---|---|
//! | [`msg`] | messages as ROS defines them, one module per package |
//! | [`catalogue`] | lists of all messages, roles of topics, and topics of vehicles |
//! | [`message`] | the table of all messages, and one type for all of them |
//! | [`cdr`] | serialization: `decode_any` validates messages of logs and other programs |
//! | [`check`] | validation of received messages |
//! | [`convert`] | conversion to and from `swerve-msg`: units, frames, axes, stamps |
//! | [`mapping`] | mapping of streams to topics: built-in tables for vehicles, changed in TOML |
//! | [`clock`] | offset between a sensor's clock and the host's, and plausibility of stamps |
//! | [`bridge`] | the node: [`bridge::Bridge::start`], `publish`, `take`, `statistics`, `stop` |
//! | [`transport`] | the same in a separate process with bounded memory |
//! | [`mod@env`] | environment variables |
//! | [`samples`] | one sample of every message, for tests |
//!
//! A program builds a [`mapping::Mapping`] from its configuration and [`bridge::Options::from_mapping`] for its
//! side of it (the stack, or the vehicle when simulated), starts the bridge, and takes and publishes messages by
//! endpoint.
//!
//! Contains no engine and no simulator. Only this crate depends on DDS, and it exposes no DDS types. Without the feature
//! `dds` no node starts; all else is the same: see [`bridge::MISSING`].

#![cfg_attr(not(feature = "dds"), allow(dead_code, reason = "without the feature, its helpers are unused"))]

pub mod bridge;
pub mod catalogue;
pub mod cdr;
pub mod check;
pub mod clock;
pub mod convert;
pub mod env;
mod inbox;
pub mod mapping;
pub mod message;
pub mod msg;
pub mod samples;
pub mod transport;

pub use message::{AnyMessage, Kind, RosMessage};
