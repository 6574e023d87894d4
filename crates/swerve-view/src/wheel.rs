//! Manually driven run: pedals and steering from the page in place of the controller.

use swerve_msg::Command;
use swerve_stack::agent::Seat;
use swerve_vehicle::Kinematic;

/// Positions of pedals and steering.
#[derive(Clone, Copy, PartialEq, Debug, serde::Deserialize)]
pub(crate) struct Held {
    /// -1 (right limit at this speed) to 1 (left limit).
    pub(crate) steering: f64,
    /// 0 to 1.
    pub(crate) throttle: f64,
    /// 0 to 1.
    pub(crate) brake: f64,
}

/// Manual controls of a run.
pub(crate) struct Wheel {
    seat: Seat<Command>,
    car: Kinematic,
    /// Speed, m/s.
    pub(crate) speed_mps: f64,
}

impl Wheel {
    /// Creates the controls with nothing pressed: the car coasts.
    pub(crate) fn new(seat: Seat<Command>, car: Kinematic) -> Self {
        seat.set(Command::default());
        Self { seat, car, speed_mps: 0.0 }
    }

    /// Commands the car; full steering is the limit at its speed.
    pub(crate) fn hold(&self, held: Held) -> Result<(), &'static str> {
        let Held { steering, throttle, brake } = held;
        if !((-1.0..=1.0).contains(&steering) && [throttle, brake].iter().all(|x| (0.0..=1.0).contains(x))) {
            return Err("expected steering from -1 to 1, throttle and brake from 0 to 1");
        }
        let steering_rad = steering * self.car.steering_max_rad(self.speed_mps);
        self.seat.set(Command { steering_rad, throttle, brake });
        Ok(())
    }
}
