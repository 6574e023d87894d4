//! Sensors: functions of the world's state, and for those with noise of (seed, sensor, stamp).
//!
//! `WorldState` in; messages of the stack out, stamped with the state's stamp. No sensor draws from anything
//! but its key, so the order in which they are asked, or whether, changes nothing. Those that count or compare
//! (wheel encoders, lines, stop lines) or whose errors wander (satellite receiver, inertial unit) remember their own
//! last reading and nothing else.

mod events;
mod gnss;
mod imu;
mod lights;
mod motion;
mod obstacles;
mod occluders;
mod odometry;
mod radar;
mod timing;

pub use events::*;
pub use gnss::*;
pub use imu::*;
pub use lights::*;
pub use motion::*;
pub use obstacles::*;
pub use odometry::*;
pub use radar::{Radar, RadarParams, RadarPreset, rcs_dbsm};
pub use timing::*;

use motion::key;

#[cfg(test)]
mod tests;
