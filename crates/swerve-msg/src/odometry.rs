//! Wheel odometry.

use serde::{Deserialize, Serialize};
use swerve_core::Time;

/// Motion of the car since the previous message, measured by the wheels.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct WheelOdometry {
    /// End of the interval over which the speeds are averaged.
    pub stamp: Time,
    /// Encoder counts since the first message: front left, front right, rear left, rear right.
    pub counts: [i64; 4],
    /// Mean speed of each wheel, rad/s; positive forward.
    pub wheel_speeds_radps: [f64; 4],
    /// Speed of the ego origin along its heading, from the wheels, m/s.
    pub speed_mps: f64,
    /// Yaw rate from the wheels, rad/s; positive to the left.
    pub yaw_rate_radps: f64,
    /// Measured angle of the front road wheels, radians; positive to the left.
    pub steering_rad: f64,
}
