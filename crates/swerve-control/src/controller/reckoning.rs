//! Dead reckoning from the commands: ego state between measured states, after the last one, and when they are late.
//!
//! ```text
//! states      S1 ......... S2                     known until here, and late
//! commands      c c c c c c c c c c c c c c c c   known until now
//! ego         S2, advanced by the commands since its stamp with a single-track model
//! ```

use std::collections::VecDeque;

use swerve_core::{Span, Time};
use swerve_geom::{Odom, Pose2, angle_between, math};
use swerve_msg::EgoState;

use crate::SlipParams;

/// A state is overdue this long after the previous one: five periods of a pose at 100 Hz.
const OVERDUE: Span = Span::from_ms(50);

/// Length of the kept history: older states are first extrapolated with their own speed and yaw rate.
const KEPT: Span = Span::from_ms(1000);

/// Below this speed the yaw rate does not determine the curvature, m/s.
const SLOW_MPS: f64 = 1.0;

/// Motion of the ego according to its commands, with the newest state.
#[derive(Clone, Debug)]
pub(super) struct Reckoning {
    slip: SlipParams,
    wheelbase_m: f64,
    /// Lag of steering and tyres, seconds.
    lag_s: f64,
    at: Time,
    odom: Pose2<Odom>,
    speed_mps: f64,
    /// Acceleration in response to the commands, m/s², and its integral.
    accel_mps2: f64,
    gained_mps: f64,
    /// Curvature of the heading, 1/m.
    curvature_1pm: f64,
    steering_rad: f64,
    /// Deceleration of a stop without a state, m/s².
    pub(super) decel_mps2: Option<f64>,
    trail: VecDeque<Past>,
    newest: Option<Newest>,
}

/// Commanded motion at one instant.
#[derive(Clone, Copy, Debug)]
struct Past {
    at: Time,
    odom: Pose2<Odom>,
    gained_mps: f64,
}

/// A state with its place in the odometry frame.
#[derive(Clone, Copy, Debug)]
struct Newest {
    state: EgoState,
    came: Time,
    pose: Pose2,
    odom: Pose2<Odom>,
}

impl Reckoning {
    /// Creates the dead reckoning of a single-track model with this slip, whose yaw response lags the wheels.
    pub(super) fn new(slip: SlipParams, wheelbase_m: f64, lag_s: f64) -> Self {
        Self {
            slip,
            wheelbase_m,
            lag_s,
            at: Time::MIN,
            odom: Pose2::default(),
            speed_mps: 0.0,
            accel_mps2: 0.0,
            gained_mps: 0.0,
            curvature_1pm: 0.0,
            steering_rad: 0.0,
            decel_mps2: None,
            trail: VecDeque::with_capacity(256),
            newest: None,
        }
    }

    /// Advances to `now` with the steering angle and acceleration of the last command.
    pub(super) fn advance(&mut self, now: Time, steering_rad: f64, accel_mps2: f64) {
        let dt_s = if self.at == Time::MIN { 0.0 } else { (now - self.at).as_secs().max(0.0) };
        let decel_mps2 = self.decel_mps2.unwrap_or(0.0);
        let answered = 1.0 - math::exp(-dt_s / self.lag_s.max(1e-3));
        self.accel_mps2 = match self.decel_mps2 {
            Some(decel_mps2) => -decel_mps2,
            None => self.accel_mps2 + answered * (accel_mps2 - self.accel_mps2),
        };
        let before_mps = self.speed_mps;
        self.speed_mps = (before_mps + self.accel_mps2 * dt_s).max(0.0);
        self.gained_mps += self.accel_mps2 * dt_s;
        let wheels_1pm = self.slip.curvature_1pm(steering_rad, self.wheelbase_m, self.speed_mps, decel_mps2);
        self.curvature_1pm += answered * (wheels_1pm - self.curvature_1pm);
        let way_m = 0.5 * (before_mps + self.speed_mps) * dt_s;
        self.odom = self.slip.moved(self.odom, self.curvature_1pm, self.speed_mps, way_m);
        (self.at, self.steering_rad) = (now, steering_rad);
        self.trail.push_back(Past { at: now, odom: self.odom, gained_mps: self.gained_mps });
        while self.trail.front().is_some_and(|past| now - past.at > KEPT) {
            self.trail.pop_front();
        }
    }

    /// Takes a state; ignores one that is not newer than the last.
    pub(super) fn take(&mut self, state: &EgoState) {
        if self.newest.is_some_and(|newest| state.stamp <= newest.state.stamp) {
            return;
        }
        let after = self.trail.partition_point(|past| past.at < state.stamp);
        let now = Past { at: self.at, odom: self.odom, gained_mps: self.gained_mps };
        let Past { at, odom, gained_mps } = self.trail.get(after).copied().unwrap_or(now);
        let pose = state.pose_after((at - state.stamp).as_secs().max(0.0));
        let age = self.at - state.stamp;
        self.speed_mps = (state.speed_mps.max(0.0) + self.gained_mps - gained_mps).max(0.0);
        if age <= OVERDUE {
            self.curvature_1pm = state.yaw_rate_radps / self.speed_mps.max(SLOW_MPS);
        }
        self.newest = Some(Newest { state: *state, came: self.at, pose, odom });
    }

    /// Returns true if a new state is overdue.
    pub(super) fn is_overdue(&self) -> bool {
        self.newest.is_some_and(|newest| self.at - newest.came > OVERDUE)
    }

    /// Returns true if the newest state is older than [`OVERDUE`]: its age would make the control loop oscillate.
    pub(super) fn is_late(&self) -> bool {
        self.newest.is_some_and(|newest| self.at - newest.state.stamp > OVERDUE)
    }

    /// The ego state now; `None` before the first state.
    pub(super) fn state(&self) -> Option<EgoState> {
        let Newest { state, pose, odom, .. } = self.newest?;
        let steering_rad = if self.is_late() { self.steering_rad } else { state.steering_rad };
        let place = pose.from_local(odom.to_local::<Odom>(self.odom.point()));
        let turn_rad = angle_between(odom.heading_rad, self.odom.heading_rad);
        Some(EgoState {
            stamp: self.at,
            pose: Pose2::new(place.x_m, place.y_m, pose.heading_rad + turn_rad),
            speed_mps: self.speed_mps,
            accel_mps2: self.decel_mps2.map_or(self.accel_mps2, |decel_mps2| -decel_mps2),
            yaw_rate_radps: self.curvature_1pm * self.speed_mps,
            steering_rad,
            ..state
        })
    }
}
