//! Sensors: functions of the world state and, if noisy, of (seed, sensor, stamp).
//!
//! They turn a `WorldState` into messages of the stack with the state's stamp. Each sensor draws only from its own key,
//! so that the order of evaluation, or omission of sensors, changes nothing. Sensors that count or compare (wheel
//! encoders, lane lines, stop lines) or whose errors drift (GNSS receiver, IMU) keep only their last reading.

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
