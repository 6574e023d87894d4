use serde::{Deserialize, Serialize};
use swerve_core::Time;

/// What the wheels say of the car's motion since the previous message.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct WheelOdometry {
    /// End of the time that the speeds are means over.
    pub stamp: Time,
    /// Counts of the encoders since the first message: front left, front right, rear left, rear right.
    pub counts: [i64; 4],
    /// Mean speed of each wheel, rad/s; positive forward.
    pub wheel_speeds_radps: [f64; 4],
    /// Speed of the ego origin along its heading from them, m/s.
    pub speed_mps: f64,
    /// Yaw rate from them, rad/s; positive to the left.
    pub yaw_rate_radps: f64,
    /// Angle of the front road wheels as its sensor reads it, radians; positive to the left.
    pub steering_rad: f64,
}
