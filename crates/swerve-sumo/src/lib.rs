//! SUMO as the source of traffic: its configurations, its process, and the protocol TraCI.
//!
//! [`SumoConfig`] is a `.sumocfg`. [`Sumo`] is a `swerve_world::Others`: it starts SUMO, keeps the ego in SUMO where it
//! is in the world, advances SUMO by its own step, and returns the vehicles around the ego at any instant in between.
//! [`Client`] speaks TraCI.
//!
//! **Frames and units.** Places of SUMO are those of its net, metres, x east, y north; a place of the map is a place of
//! the net less [`Settings::offset_m`]. SUMO's place of a vehicle is the middle of its front bumper and its angle is in
//! degrees clockwise from north; [`Sumo`] converts both to the centre and to radians from x towards y.
//!
//! **Time.** Instant 0 of the run is SUMO's begin plus [`Settings::warmup_s`]. The ego is in SUMO, at rest at its start,
//! for the last 10 s before it, so that vehicles behind it can stop. A step of SUMO is a multiple of that of the
//! world. SUMO is asked at the begin of each of its steps for the state at its end, with the ego extrapolated over the
//! step at its velocity and yaw rate. Between two states, vehicles move in straight lines.
//!
//! **Errors.** [`SumoError`]: SUMO is missing, ends, does not answer in time, refuses a command, or answers with bytes or
//! vehicles that are invalid. Messages are at most 64 MiB long.
//!
//! **Source.** SUMO's documentation, "TraCI", protocol version 22 (SUMO 1.28.0).
//!
//! Excluded: pedestrians and containers of SUMO, several clients of one SUMO, the control of vehicles other than the ego,
//! `libsumo`, physics, scenarios, and the map (`swerve_map_io`).

mod additional;
mod client;
mod config;
mod ego;
mod error;
mod lights;
mod process;
mod read;
mod states;
mod sumo;
#[cfg(test)]
mod tests;
mod ways;
mod wire;

pub use client::{Answer, Client, Subscribed, Values};
pub use config::SumoConfig;
pub use error::SumoError;
pub use lights::LightProgram;
pub use process::{Environment, Process};
pub use read::text_of;
pub use sumo::{Settings, Sumo};
pub use ways::{car_lanes, ways};
pub use wire::{Command, Domain, Insertion, LIGHT_STATE, Value};
