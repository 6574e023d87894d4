//! The simulated world: a rapier scene with the ego, scripted actors, collisions, infractions and sensors.
//!
//! [`Simulator`] turns a `Scenario` and one `Command` per step into one `WorldState` per step. Sensors
//! ([`sense`]) are functions of that state. Everything is a function of scenario, parameters and seed: no
//! clock, no order of threads, no unseeded random number.
//!
//! **Frames**: the map of `swerve_geom`; rapier runs in the same axes with gravity along -z, in `f32`.
//! Scripted motion, distances, contacts and sight lines are computed in `f64` beside it; the conversion to
//! rapier's types is in `bodies` and `ego`, and none of them appears in a public signature of this crate
//! outside `ego`.
//!
//! [`Ahead`] tells where scripted actors will be, as far as that is settled.
//!
//! Absences: no rendering, no operators, no files.

mod ahead;
mod bodies;
mod contact;
pub mod ego;
mod rules;
mod script;
pub mod sense;
mod simulator;
mod trigger;

pub use ahead::Ahead;
pub use simulator::{SimError, SimParams, Simulator};

#[cfg(test)]
mod tests;
