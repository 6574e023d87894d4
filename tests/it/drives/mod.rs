//! Drives observed from outside.

mod agent;
mod deadlines;
mod faults;
mod gate;
mod gate_stops;
mod lost;
mod maps;
mod perception;
mod prediction;
mod ride;
mod roads;
mod sensors;
mod setting_off;
mod situations;
mod story;
mod traffic_lights;
