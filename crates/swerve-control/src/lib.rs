//! Vehicle control: from a plan to steering and pedals.
//!
//! A [`Controller`] is called at a fixed rate with the measured [`EgoState`](swerve_msg::EgoState), the newest plan and
//! the route, and returns a [`Command`](swerve_msg::Command) with a [`Status`] that names the path it followed. Laws:
//! Pylot's [`pid`] with its steering by the angle to a waypoint, pure pursuit and Stanley ([`lateral`]) with a separate
//! speed law ([`speed`]), and a model predictive controller ([`mpc`]), all in one [`LawController`].
//!
//! Frames: plans, routes and states are in the map; angles of the road wheels are positive to the left. The crate has
//! no engine, clock (the instant is an input), simulator or files.

#[cfg(test)]
mod allocations;
#[cfg(test)]
mod bicycle;
mod controller;
mod grip;
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
    AlongParams, ComfortAccelParams, Controller, Following, Input, Law, LawController, Output, Params,
    Status, StopParams, StopReason,
};
pub use grip::GripParams;
pub use pedals::{AccelToPedals, LinearPedals, Pedals};
pub use slip::SlipParams;
