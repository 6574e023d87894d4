//! Stops of the controller itself: along the last path where no plan comes, by dead reckoning where no state comes.
//!
//! ```text
//! last state       blind_after_s       standstill
//!     |-- as fast as then --|-- blind_decel_mps2 --|
//! ```
//!
//! Without a state the ego is taken to be on its path, as far along it as this motion brings it: no law has an error to
//! correct, and the wheels follow the curvature of the path.

use swerve_core::{Span, Time};
use swerve_msg::EgoState;

use super::{Controller, Drive, Input};
use crate::Pedals;
use crate::speed::{SpeedLaw, Target};

/// A stop: since when, from which speed, how hard.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Stop {
    since: Time,
    from_mps: f64,
    decel_mps2: f64,
    /// Whether it is one without a state.
    is_blind: bool,
}

impl Stop {
    /// Speed and acceleration that the ego should have.
    pub(super) fn target(&self, instant: Time) -> Target {
        let left_mps = (self.from_mps - self.decel_mps2 * (instant - self.since).as_secs()).max(0.0);
        Target { speed_mps: left_mps, accel_mps2: if left_mps > 0.0 { -self.decel_mps2 } else { 0.0 } }
    }

    /// The way since it began, metres.
    fn way_m(&self, now: Time) -> f64 {
        let lasts_s = (now - self.since).as_secs().min(self.from_mps / self.decel_mps2);
        (self.from_mps - 0.5 * self.decel_mps2 * lasts_s) * lasts_s
    }
}

impl Controller {
    /// Whether a state can be driven by.
    pub(super) fn is_usable(&self, ego: &EgoState, now: Time) -> bool {
        super::is_finite(ego) && now - ego.stamp <= Span::from_secs(self.params.stop.blind_after_s)
    }

    /// Stops from now on, unless it does already.
    pub(super) fn begin_stop(&mut self, now: Time, ego: &EgoState, is_blind: bool) {
        let decel_mps2 =
            if is_blind { self.params.stop.blind_decel_mps2 } else { self.params.stop.decel_mps2 };
        let begun = Stop { since: now, from_mps: ego.speed_mps.max(0.0), decel_mps2, is_blind };
        let goes_on = self.stopping.filter(|stop| stop.is_blind == is_blind);
        self.stopping = goes_on.or(Some(begun));
    }

    /// The ego where it should be by now without a state since `seen`; the path is loaded. Integrals begin anew afterwards.
    pub(super) fn reckoned(&mut self, seen: &EgoState, input: &Input<'_>) -> EgoState {
        self.pid.reset();
        self.speed = SpeedLaw::new(self.params.speed);
        let Some(stop) = self.stopping else { return *seen };
        let came_m = stop.from_mps * (stop.since - seen.stamp).as_secs().max(0.0) + stop.way_m(input.now);
        let s_m = self.reference.project(seen.pose.point());
        let until_m = s_m.max(0.0) + came_m + self.reach_m(seen.speed_mps);
        self.reference.extend(input.route, self.route_m - s_m.max(0.0), until_m);
        let there = self.at(s_m + came_m);
        let Target { speed_mps, accel_mps2 } = stop.target(input.now);
        EgoState {
            stamp: input.now,
            pose: there.pose,
            speed_mps,
            accel_mps2,
            yaw_rate_radps: there.curvature_1pm * speed_mps,
            steering_rad: self.steering_rad,
            ..*seen
        }
    }

    /// While the ego is being stopped: the same by the brake alone, whatever the measured speed is. Once it has to stand,
    /// at least what holds it; without a state at least the deceleration of that stop.
    pub(super) fn braked(&self, drive: Drive, now: Time) -> Drive {
        let Some(stop) = self.stopping else { return drive };
        let speed_mps = stop.target(now).speed_mps;
        let least_mps2 = match (stop.is_blind, speed_mps <= 0.0) {
            (true, _) => stop.decel_mps2,
            (false, true) => self.params.speed.hold_mps2,
            (false, false) => 0.0,
        };
        let least = if least_mps2 > 0.0 { self.drive.pedals(-least_mps2, speed_mps).brake } else { 0.0 };
        Drive {
            pedals: Pedals { throttle: 0.0, brake: drive.pedals.brake.max(least) },
            accel_mps2: drive.accel_mps2.map(|accel_mps2| accel_mps2.min(-least_mps2)),
            ..drive
        }
    }
}
