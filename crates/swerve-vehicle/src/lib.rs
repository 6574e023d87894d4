//! The vehicle: its shape, its limits and how it moves.
//!
//! Shared by simulator, planners and controllers. Absences: no rapier, no engine, no messages.

mod shape;

pub use shape::{Limits, Shape};
