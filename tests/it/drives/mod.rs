//! Drives whose operators are looked at from outside.

mod agent;
mod deadlines;
mod faults;
mod gate;
mod lost;
mod perception;
mod prediction;
mod ride;
mod sensors;
mod story;
mod traffic_lights;
