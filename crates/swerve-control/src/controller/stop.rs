//! Stops of the controller: along the last path without a plan, by dead reckoning without a state.
//!
//! ```text
//! last state         blind_after_s          standstill
//!     |---- as fast as then ----|-- blind_decel_mps2, --|
//!          |                       harder as planned
//!       overdue: by dead reckoning, along the path of the last plan
//! ```
//!
//! Once a state is overdue, the ego is placed by the last state and the commands since then. It keeps to its path, as
//! plans that still arrive may have been made without a state too.

use swerve_core::{Span, Time};
use swerve_msg::EgoState;

use super::{Drive, Here, Input, Law, LawController};
use crate::Pedals;
use crate::speed::{SpeedLaw, Stop};

impl LawController {
    /// Returns true if a state is finite and recent enough for control.
    pub(super) fn is_usable(&self, ego: &EgoState, now: Time) -> bool {
        super::is_finite(ego) && now - ego.stamp <= Span::from_secs(self.params.stop.blind_after_s)
    }

    /// Begins a stop, unless one is under way.
    pub(super) fn begin_stop(&mut self, now: Time, ego: &EgoState) {
        let from_mps = ego.speed_mps.max(0.0);
        self.stopping.get_or_insert(Stop { since: now, from_mps, decel_mps2: self.params.stop.decel_mps2 });
    }

    /// Resumes from a state. After an interval without states, braking continues at the same rate until there is a plan
    /// made from the new state.
    pub(super) fn see(&mut self, ego: &EgoState, now: Time) {
        if let Some(decel_mps2) = self.reckoning.decel_mps2.take() {
            self.seen_again = Some(ego.stamp);
            self.stopping = Some(Stop { since: now, from_mps: ego.speed_mps.max(0.0), decel_mps2 });
        }
        self.seen = Some(*ego);
    }

    /// Brakes without a state: by `blind_decel_mps2`, or as planned if that is harder. Integrals are reset.
    pub(super) fn brake_blind(&mut self, input: &Input<'_>) {
        self.pid.reset();
        self.speed = SpeedLaw::new(self.params.speed);
        let planned_mps2 =
            input.plan.and_then(|plan| plan.at(input.now)).map_or(0.0, |point| -point.accel_mps2);
        let decel_mps2 = planned_mps2.min(self.limits.brake_max_mps2).max(self.params.stop.blind_decel_mps2);
        self.reckoning.decel_mps2 = Some(decel_mps2);
    }

    /// Steers by Stanley's law, whichever law steers otherwise, and brakes.
    pub(super) fn step_blind(&self, ego: &EgoState, here: &Here) -> (f64, Drive) {
        let steering_rad = self.steering_by(Law::Stanley, ego, here, -ego.accel_mps2);
        (steering_rad, self.drive_at(ego.speed_mps, ego.accel_mps2, ego))
    }

    /// The same output without throttle during a stop, whatever the measured speed. From the end of the stop on, the
    /// brake is at least the holding brake.
    pub(super) fn braked(&self, drive: Drive, now: Time) -> Drive {
        if self.reckoning.decel_mps2.is_some() {
            return Drive { pedals: Pedals { throttle: 0.0, ..drive.pedals }, ..drive };
        }
        let Some(stop) = self.stopping else { return drive };
        let rests = stop.target(now).speed_mps <= 0.0;
        let hold_mps2 = if rests { self.params.speed.hold_mps2 } else { 0.0 };
        let hold = if rests { self.drive.pedals(-hold_mps2, 0.0).brake } else { 0.0 };
        Drive {
            pedals: Pedals { throttle: 0.0, brake: drive.pedals.brake.max(hold) },
            accel_mps2: drive.accel_mps2.map(|accel_mps2| accel_mps2.min(-hold_mps2)),
            ..drive
        }
    }
}
