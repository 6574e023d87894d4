//! From a plan to steering and pedals.
//!
//! A [`Controller`] is called at a fixed rate with the measured [`EgoState`](swerve_msg::EgoState), the newest
//! plan and the route, and returns a [`Command`](swerve_msg::Command) with a [`Status`] that says what it
//! followed. Laws: the [`pid`] of Pylot with its steering by the angle to a waypoint, pure pursuit and Stanley
//! ([`lateral`]) with a speed law of our own ([`speed`]),
//! and a model predictive controller ([`mpc`]).
//!
//! Frames: plans, routes and states are in the map; angles of the road wheels are positive to the left.
//! Absences: no engine, no clock (the instant is an input), no simulator, no files.

#[cfg(test)]
mod allocations;
#[cfg(test)]
mod bicycle;
mod controller;
pub mod lateral;
pub mod mpc;
pub mod pedals;
pub mod pid;
mod reference;
pub mod safety_gate;
mod slip;
pub mod speed;
mod validate;

pub use controller::{
    AlongParams, Controller, Following, Input, Law, Output, Params, Status, StopParams, StopReason,
};
pub use pedals::{AccelToPedals, LinearPedals, Pedals};
pub use slip::SlipParams;
