//! The bridge to ROS 2: messages, their bytes, what they mean, and the transport.
//!
//! Pure Rust over DDS (RustDDS); no ROS installation is needed on either side.
//!
//! | module | what |
//! |---|---|
//! | [`msg`] | the messages as ROS defines them, a module for each package |
//! | [`catalogue`] | all messages, all roles of topics, the topics of all vehicles: the one list of each |
//! | [`message`] | all of them behind one type |
//! | [`cdr`] | their bytes: `decode_any` for what a log or another program wrote, checked |
//! | [`check`] | whether what came may be believed |
//! | [`convert`] | between them and `swerve-msg`: units, frames, axes, stamps |
//! | [`mapping`] | which stream is which topic: built-in tables for vehicles, changed in TOML |
//! | [`clock`] | the offset between a sensor's clock and the host's, and what a stamp is worth |
//! | [`bridge`] | the node: [`bridge::Bridge::start`], `publish`, `take`, `statistics`, `stop` |
//! | [`transport`] | the same in a process of its own, with a bound on its memory |
//! | [`mod@env`] | what the environment says |
//! | [`samples`] | one example of every message, for tests |
//!
//! A program makes a [`mapping::Mapping`] from its configuration, [`bridge::Options::from_mapping`] for its side of
//! it (the stack's, or the vehicle's where a simulator takes its place), starts the bridge, and takes and publishes
//! messages by endpoint.
//!
//! Absences: no engine, no simulator. Only this crate knows DDS, and none of DDS's types leave it.

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
