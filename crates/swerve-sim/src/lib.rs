//! The simulated world: a rapier scene with the ego, scripted actors, collisions, infractions and sensors.
//!
//! [`Simulator`] turns a `Scenario` and one `Command` per step into one `WorldState` per step: it is a
//! `swerve_world::World`, and moves each actor by a `swerve_world::Driver`: the script of the scenario, its traffic, a
//! recording that brakes for the ego, or another simulator (`swerve_world::Others`), whose road users come and go.
//! Sensors ([`sense`]) are
//! functions of that state. Everything is a function of scenario, parameters and seed: no clock, no thread order, no
//! unseeded random number.
//!
//! **Frames**: the map frame of `swerve_geom`; rapier runs in the same axes with gravity along -z, in `f32`. Scripted
//! motion, distances, contacts and sight lines are computed in `f64` beside it. The conversion to rapier's types is in
//! `bodies` and `ego`; none of them appears in a public signature of this crate outside `ego`.
//!
//! [`Ahead`] predicts scripted actors, as far as their motion is determined.
//!
//! The crate contains no rendering, operators or file access.

mod ahead;
mod bodies;
mod contact;
mod contacts;
pub mod ego;
mod neighbours;
mod reacting;
mod rules;
mod script;
mod scripted;
pub mod sense;
mod simulator;
mod track;
mod traffic;

pub use ahead::Ahead;
pub use simulator::{SimError, SimParams, Simulator};
pub use traffic::with_traffic;

#[cfg(test)]
mod tests;
