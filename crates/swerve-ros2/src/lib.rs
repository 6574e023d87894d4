//! The bridge to ROS 2: messages, their bytes, what they mean, and the transport.
//!
//! Pure Rust over DDS (RustDDS); no ROS installation is needed on either side.
//!
//! - [`msg`]: the messages as ROS defines them; [`message`]: all of them behind one type; [`cdr`]: their bytes;
//!   [`check`]: whether what came may be believed.
//!
//! Absences: no engine, no simulator. Only this crate knows DDS, and none of DDS's types leave it.

pub mod bridge;
pub mod cdr;
pub mod check;
pub mod clock;
pub mod convert;
pub mod env;
mod inbox;
pub mod logging;
pub mod mapping;
pub mod message;
pub mod msg;
pub mod samples;

pub use message::{AnyMessage, Kind, RosMessage};
