//! The odometry frame (ROS REP 105): motion without jumps for control, while localization corrects the pose in the map.
//!
//! ```text
//! localizer --EgoState (map)----------> tracker, predictor, ...
//!           --LocalPose (odom, map)---> planner: carries its previous plan to the map of now and goes on from it
//!                                       controller: compares ego and plan in the odometry frame
//! ```
//!
//! A correction of the pose moves neither ego nor plan in the odometry frame. It enters by the route, to which the next
//! plans return within their limits.

use std::collections::VecDeque;

use swerve_core::{Span, Time};
use swerve_flow::Message;
use swerve_geom::{Ego, Odom, Point2, Pose2, angle_between, math};
use swerve_localization::lateral_velocity::{LateralMotion, LateralVelocity};
use swerve_msg::{EgoState, LocalPose, Plan};

use super::receiver::new_messages;

/// Longest step of the odometry, seconds: beyond it the motion since the last state is unknown.
const STEP_MAX_S: f64 = 0.2;

/// Time constant with which corrections enter the local pose, seconds: several fixes of a receiver at 10 Hz.
const CORRECTION_S: f64 = 0.5;

/// Share of the time since the start that is used as time constant until that reaches [`CORRECTION_S`]: early
/// corrections are not noise.
const CORRECTION_SHARE: f64 = 0.25;

/// Largest distance of the local pose from the estimate, metres and radians: a larger correction enters at once. A
/// third of the room that a car has beside it on a lane of 3.5 m.
const LAG_MAX_M: f64 = 0.3;
const LAG_MAX_RAD: f64 = 0.03;

/// Computes local poses from localized states.
///
/// The odometry integrates speed, yaw rate and lateral velocity. The lateral velocity estimated by localization is
/// mostly an error of the heading, so it is computed from tyres and inertial unit
/// ([`swerve_localization::lateral_velocity`]).
#[derive(Clone, Debug)]
pub(super) struct Odometer {
    odom: Pose2<Odom>,
    lateral_velocity: LateralVelocity,
    /// Time since the first state, seconds.
    age_s: f64,
    before: Option<Before>,
}

/// State of the step before.
#[derive(Clone, Copy, Debug)]
struct Before {
    state: EgoState,
    lateral_mps: f64,
    /// Local pose in the map.
    map: Pose2,
}

impl Odometer {
    /// For states measured by an inertial unit at this position in the ego frame, metres.
    pub(super) fn new(unit_at_m: [f64; 3]) -> Self {
        Self {
            odom: Pose2::default(),
            lateral_velocity: LateralVelocity::new(unit_at_m),
            age_s: 0.0,
            before: None,
        }
    }

    /// Local pose of a state. Its lateral acceleration is that of the unit, without gravity; `roll_radps` is the body's
    /// roll rate.
    pub(super) fn advance(&mut self, state: &EgoState, roll_radps: f64) -> LocalPose {
        let EgoState {
            stamp, speed_mps, lateral_accel_mps2: lateral_mps2, yaw_rate_radps: yaw_radps, ..
        } = *state;
        let lateral_mps = self
            .lateral_velocity
            .take(stamp, LateralMotion { lateral_mps2, roll_radps, yaw_radps, speed_mps });
        let mut map = state.pose;
        if let Some(before) = self.before {
            let dt_s = (stamp - before.state.stamp).as_secs().clamp(0.0, STEP_MAX_S);
            let mean = |one: f64, other: f64| 0.5 * (one + other);
            let ahead_m = mean(before.state.speed_mps, speed_mps) * dt_s;
            let step: Point2<Ego> = Point2::new(ahead_m, mean(before.lateral_mps, lateral_mps) * dt_s);
            let turn_rad = mean(before.state.yaw_rate_radps, yaw_radps) * dt_s;
            self.odom = moved(self.odom, step, turn_rad);
            self.age_s += dt_s;
            let share = dt_s / CORRECTION_S.min(CORRECTION_SHARE * self.age_s).max(1e-3);
            map = corrected(moved(before.map, step, turn_rad), state.pose, share);
        }
        self.before = Some(Before { state: *state, lateral_mps, map });
        LocalPose::new(stamp, self.odom, map)
    }
}

/// A pose after a step (ahead and to the left at the middle of the turn, metres) with a turn.
fn moved<F>(pose: Pose2<F>, step: Point2<Ego>, turn_rad: f64) -> Pose2<F> {
    let Pose2 { x_m, y_m, heading_rad, .. } = pose;
    let to = Pose2::<F>::new(x_m, y_m, heading_rad + 0.5 * turn_rad).from_local(step);
    Pose2::new(to.x_m, to.y_m, heading_rad + turn_rad)
}

/// A pose moved towards an estimate for a share of the time constant.
fn corrected(pose: Pose2, estimate: Pose2, share: f64) -> Pose2 {
    let off: Point2<Ego> = pose.to_local(estimate.point());
    let off_rad = angle_between(pose.heading_rad, estimate.heading_rad);
    let left = math::exp(-share);
    let lag = |off: f64, most: f64| (off * left).clamp(-most, most);
    let point = pose
        .from_local(Point2::<Ego>::new(off.x_m - lag(off.x_m, LAG_MAX_M), off.y_m - lag(off.y_m, LAG_MAX_M)));
    Pose2::new(point.x_m, point.y_m, pose.heading_rad + off_rad - lag(off_rad, LAG_MAX_RAD))
}

/// Time for which local poses are kept: older plans are expired.
const KEPT: Span = Span::from_ms(5000);

/// Local poses of the last seconds.
#[derive(Debug, Default)]
pub(super) struct LocalPoses {
    kept: VecDeque<LocalPose>,
    /// Number of messages taken.
    taken: u64,
}

impl LocalPoses {
    /// Takes the new messages of a window.
    pub(super) fn take(&mut self, window: &[Message<LocalPose>]) {
        let is_finite = |local: &LocalPose| local.odom.is_finite() && local.map_from_odom.is_finite();
        let new = new_messages(window, &mut self.taken).map(|local| **local);
        self.kept.extend(new.filter(is_finite));
        let newest = self.kept.back().map(|local| local.stamp);
        while newest.zip(self.kept.front()).is_some_and(|(newest, oldest)| newest - oldest.stamp > KEPT) {
            self.kept.pop_front();
        }
    }

    /// Newest pose up to an instant, else the oldest. `None` without localization.
    pub(super) fn at(&self, stamp: Time) -> Option<LocalPose> {
        let until = self.kept.partition_point(|local| local.stamp <= stamp);
        self.kept.get(until.saturating_sub(1)).copied()
    }

    /// Newest pose before an instant.
    pub(super) fn before(&self, stamp: Time) -> Option<LocalPose> {
        let until = self.kept.partition_point(|local| local.stamp < stamp);
        until.checked_sub(1).and_then(|newest| self.kept.get(newest)).copied()
    }

    /// A measured state with its local pose, in the map as known by `known`.
    pub(super) fn state(&self, measured: &EgoState, known: Option<LocalPose>) -> EgoState {
        let local = self.at(measured.stamp).zip(known);
        let pose = local.map_or(measured.pose, |(local, known)| known.to_map(local.odom));
        EgoState { pose, ..*measured }
    }
}

/// A plan made in the map as known by `then`, at the same position of the odometry frame in the map as known by `now`.
/// `None` if it is unchanged.
pub(super) fn carried(plan: &Plan, then: Option<LocalPose>, now: Option<LocalPose>) -> Option<Plan> {
    let (then, now) = then.zip(now).filter(|(then, now)| then.map_from_odom != now.map_from_odom)?;
    let mut plan = plan.clone();
    plan.points.iter_mut().for_each(|point| point.pose = now.to_map(then.to_odom(point.pose)));
    Some(plan)
}

#[cfg(test)]
mod tests;
