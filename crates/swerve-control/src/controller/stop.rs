//! Stops of the controller itself: along the last path where no plan comes, by dead reckoning where no state comes.
//!
//! ```text
//! last state       blind_after_s          standstill
//!     |-- as fast as then --|-- blind_decel_mps2, --|
//!                              harder as planned
//! ```
//!
//! Without a state the ego is taken to be on its path, as far along it as this motion brings it: the wheels follow the
//! curvature of the path, whichever law steers otherwise.

use swerve_core::{Span, Time};
use swerve_msg::EgoState;

use super::{Controller, Drive, Here, Input};
use crate::Pedals;
use crate::speed::{SpeedLaw, Target};

/// A stop: since when, from which speed, how hard.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Stop {
    since: Time,
    from_mps: f64,
    decel_mps2: f64,
}

impl Stop {
    /// Speed and acceleration that the ego should have.
    pub(super) fn target(&self, instant: Time) -> Target {
        let left_mps = (self.from_mps - self.decel_mps2 * (instant - self.since).as_secs()).max(0.0);
        Target { speed_mps: left_mps, accel_mps2: if left_mps > 0.0 { -self.decel_mps2 } else { 0.0 } }
    }
}

/// The motion of an ego without a state.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Blind {
    at: Time,
    speed_mps: f64,
    /// The way since its last state, metres.
    way_m: f64,
    decel_mps2: f64,
}

impl Controller {
    /// True if a state is finite and recent enough for control.
    pub(super) fn is_usable(&self, ego: &EgoState, now: Time) -> bool {
        super::is_finite(ego) && now - ego.stamp <= Span::from_secs(self.params.stop.blind_after_s)
    }

    /// Stops from now on, unless it does already.
    pub(super) fn begin_stop(&mut self, now: Time, ego: &EgoState) {
        let from_mps = ego.speed_mps.max(0.0);
        self.stopping.get_or_insert(Stop { since: now, from_mps, decel_mps2: self.params.stop.decel_mps2 });
    }

    /// The ego where it should be by now without a state since `seen`; the path is loaded. Integrals begin anew afterwards.
    pub(super) fn reckoned(&mut self, seen: &EgoState, input: &Input<'_>) -> EgoState {
        self.pid.reset();
        self.speed = SpeedLaw::new(self.params.speed);
        let Blind { way_m, speed_mps, decel_mps2, .. } = self.slowed(seen, input);
        let s_m = self.reference.project(seen.pose.point());
        let until_m = s_m.max(0.0) + way_m + self.reach_m(seen.speed_mps);
        self.reference.extend(input.route, self.route_m - s_m.max(0.0), until_m);
        let there = self.at(s_m + way_m);
        EgoState {
            stamp: input.now,
            pose: there.pose,
            speed_mps,
            accel_mps2: -decel_mps2,
            yaw_rate_radps: there.curvature_1pm * speed_mps,
            ..*seen
        }
    }

    /// The motion without a state up to now: braking, and as hard as planned where that is harder.
    fn slowed(&mut self, seen: &EgoState, input: &Input<'_>) -> Blind {
        let now = input.now;
        let planned_mps2 = input.plan.and_then(|plan| plan.at(now)).map_or(0.0, |point| -point.accel_mps2);
        let least_mps2 = self.params.stop.blind_decel_mps2;
        let decel_mps2 = planned_mps2.min(self.limits.brake_max_mps2).max(least_mps2);
        let v = seen.speed_mps.max(0.0);
        let begun =
            || Blind { at: now, speed_mps: v, way_m: v * (now - seen.stamp).as_secs().max(0.0), decel_mps2 };
        let before = self.blind.unwrap_or_else(begun);
        let speed_mps = (before.speed_mps - decel_mps2 * (now - before.at).as_secs()).max(0.0);
        let way_m = before.way_m + 0.5 * (before.speed_mps + speed_mps) * (now - before.at).as_secs();
        *self.blind.insert(Blind { at: now, speed_mps, way_m, decel_mps2 })
    }

    /// Steers as the path asks a car that is on it, and brakes.
    pub(super) fn step_blind(&self, ego: &EgoState, here: &Here) -> (f64, Drive) {
        let v = ego.speed_mps;
        let curvature_1pm = self.at(here.s_m + self.params.stanley.preview_s * v).curvature_1pm;
        let steering_rad =
            self.steering_of(curvature_1pm) + self.params.slip.understeer_s2pm * v * v * curvature_1pm;
        (steering_rad, self.drive_at(v, ego.accel_mps2, ego))
    }

    /// While the ego is being stopped: the same by the brake alone, whatever the measured speed is. Once it has to stand,
    /// at least what holds it.
    pub(super) fn braked(&self, drive: Drive, now: Time) -> Drive {
        if self.blind.is_some() {
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
