//! Commands of the stack to the vehicle.

use serde::{Deserialize, Serialize};
use swerve_core::Time;

/// Actuation command: steering angle and pedals.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Command {
    /// Wanted angle of the front road wheels, radians; positive to the left.
    pub steering_rad: f64,
    /// Accelerator pedal, 0 to 1.
    pub throttle: f64,
    /// Brake pedal, 0 to 1.
    pub brake: f64,
}

impl Command {
    /// Returns true if all values are finite.
    pub fn is_finite(&self) -> bool {
        [self.steering_rad, self.throttle, self.brake].iter().all(|x| x.is_finite())
    }

    /// Straight wheels, no accelerator, full brake.
    pub const FULL_BRAKE: Self = Self { steering_rad: 0.0, throttle: 0.0, brake: 1.0 };
}

/// Motion command for a vehicle with its own speed or acceleration controller.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct MotionCommand {
    /// Instant of the state from which it was computed.
    pub stamp: Time,
    /// Wanted angle of the front road wheels, radians; positive to the left.
    pub steering_rad: f64,
    /// Wanted speed of the ego origin along its heading, m/s; negative in reverse.
    pub speed_mps: f64,
    /// Wanted acceleration along the heading, m/s².
    pub accel_mps2: f64,
}
