//! Sensors: functions of the world's state, and for those with noise of (seed, sensor, stamp).
//!
//! No sensor keeps state, so the order in which they are asked, or whether, changes nothing. `WorldState` in;
//! messages of the stack out, stamped with the state's stamp.

mod motion;
mod obstacles;

pub use motion::{GnssParams, ImuParams, PoseParams, gnss, imu, pose};
pub use obstacles::{SensorMount, SensorParams, fixed_points, visible_obstacles};

#[cfg(test)]
mod tests;
