//! Catalogue of all messages, roles and vehicles.
//!
//! Adding a topic takes three places: the fields and checks of its message in [`crate::msg`], its rows, and its use (the
//! vehicle's interface, the intake or the simulated car). A message is a row of the table in `message.rs`, its role a row
//! in `mapping/role.rs`, and its ROS name a row of the vehicle's table in `mapping/tables.rs`.

pub use crate::mapping::{Role, Vehicle};
pub use crate::message::{AnyMessage, Kind};

#[cfg(test)]
mod tests;
