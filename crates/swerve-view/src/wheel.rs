//! A run that is driven by hand: what a page asks of pedals and steering, in the place of the controller.

use swerve_msg::Command;
use swerve_stack::agent::Seat;
use swerve_vehicle::Kinematic;

/// Pedals and steering as a person has them.
#[derive(Clone, Copy, PartialEq, Debug, serde::Deserialize)]
pub(crate) struct Held {
    /// -1 (as far to the right as the speed allows) to 1 (to the left).
    pub(crate) steering: f64,
    /// 0 to 1.
    pub(crate) throttle: f64,
    /// 0 to 1.
    pub(crate) brake: f64,
}

/// The driver's place in a run.
pub(crate) struct Wheel {
    seat: Seat<Command>,
    car: Kinematic,
    /// How fast it goes, m/s.
    pub(crate) speed_mps: f64,
}

impl Wheel {
    /// Nothing is held yet: the car rolls.
    pub(crate) fn new(seat: Seat<Command>, car: Kinematic) -> Self {
        seat.set(Command::default());
        Self { seat, car, speed_mps: 0.0 }
    }

    /// Asks the car for what is held; all the way over is what it can take at its speed.
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
