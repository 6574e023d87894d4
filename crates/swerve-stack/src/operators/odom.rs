//! The odometry frame (ROS REP 105): motion without jumps for control, while localization corrects the pose in the map.
//!
//! ```text
//! localizer --EgoState (map)----------> tracker, predictor, ...
//!           --LocalPose (odom, map)---> planner: carries its previous plan to the map of now and goes on from it
//!                                       controller: compares ego and plan in the odometry frame
//! ```
//!
//! A correction of the pose moves neither ego nor plan in the odometry frame. It enters by the route, which the next plans
//! lead back to within their limits.

use std::collections::VecDeque;

use swerve_core::{Span, Time};
use swerve_flow::Message;
use swerve_geom::{Ego, Odom, Point2, Pose2, angle_between, math};
use swerve_localization::sideways;
use swerve_msg::{EgoState, LocalPose, Plan};

use super::localizer::new;

/// Longest step of the odometry, seconds: beyond it the motion since the state before is unknown.
const STEP_MAX_S: f64 = 0.2;

/// Time constant of a swerve's lateral velocity beside that of a steady turn, seconds. What stays for longer is an error of the
/// heading.
const SWAY_S: f64 = 1.0;

/// A lateral velocity that changes faster than this is a correction, m/s².
const SWAY_MAX_MPS2: f64 = 8.0;

/// Time constant with which corrections enter the pose for control, seconds: several fixes of a receiver at 10 Hz.
const CORRECTION_S: f64 = 0.5;

/// At the start corrections are no noise: until the time constant is reached it is this share of the time since then.
const CORRECTION_SHARE: f64 = 0.25;

/// The pose for control is at most this far from the estimate, metres and radians: a larger correction enters at once.
/// A third of the room that a car has beside it on a lane of 3.5 m.
const LAG_MAX_M: f64 = 0.3;
const LAG_MAX_RAD: f64 = 0.03;

/// Makes poses for control of the states that localization estimates.
///
/// The odometry integrates speed, yaw rate and lateral velocity. The lateral velocity of the rear axle in a steady turn is that
/// of its tyres' slip: the estimate of localization is mostly an error of the heading. Changes of the estimate are right: they
/// are the onset of a swerve, with the roll of the body.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Odometer {
    odom: Pose2<Odom>,
    /// Lateral velocity beside that of a steady turn, m/s.
    sway_mps: f64,
    /// Time since the first state, seconds.
    age_s: f64,
    /// The state before with its estimated lateral velocity (m/s), and the pose in the map for control then.
    before: Option<(EgoState, f64, Pose2)>,
}

impl Odometer {
    /// The pose for control of a state and of the lateral velocity that localization estimates with it, m/s.
    pub(super) fn advance(&mut self, state: &EgoState, lateral_mps: f64) -> LocalPose {
        let mut map = state.pose;
        if let Some((before, lateral_before_mps, smooth)) = self.before {
            let dt_s = (state.stamp - before.stamp).as_secs().clamp(0.0, STEP_MAX_S);
            let mean = |one: f64, other: f64| 0.5 * (one + other);
            let speed_mps = mean(before.speed_mps, state.speed_mps);
            let yaw_rate_radps = mean(before.yaw_rate_radps, state.yaw_rate_radps);
            let sway_before_mps = self.sway_mps;
            let gained_mps = lateral_mps - lateral_before_mps - (steady_mps(state) - steady_mps(&before));
            if gained_mps.abs() <= SWAY_MAX_MPS2 * dt_s && dt_s < STEP_MAX_S {
                self.sway_mps += gained_mps;
            }
            self.sway_mps *= math::exp(-dt_s / SWAY_S);
            let sideways_mps = mean(steady_mps(&before) + sway_before_mps, steady_mps(state) + self.sway_mps);
            let step: Point2<Ego> = Point2::new(speed_mps * dt_s, sideways_mps * dt_s);
            let turn_rad = yaw_rate_radps * dt_s;
            self.odom = moved(self.odom, step, turn_rad);
            self.age_s += dt_s;
            let share = dt_s / CORRECTION_S.min(CORRECTION_SHARE * self.age_s).max(1e-3);
            map = corrected(moved(smooth, step, turn_rad), state.pose, share);
        }
        self.before = Some((*state, lateral_mps, map));
        LocalPose::new(state.stamp, self.odom, map)
    }
}

/// Lateral velocity of the rear axle in a steady turn with the speed and yaw rate of a state, m/s.
fn steady_mps(state: &EgoState) -> f64 {
    sideways::steady_mps(state.speed_mps, state.yaw_rate_radps)
}

/// A pose after a step (ahead and to the left at the middle of the turn, metres) with a turn.
fn moved<F>(pose: Pose2<F>, step: Point2<Ego>, turn_rad: f64) -> Pose2<F> {
    let Pose2 { x_m, y_m, heading_rad, .. } = pose;
    let to = Pose2::<F>::new(x_m, y_m, heading_rad + 0.5 * turn_rad).from_local(step);
    Pose2::new(to.x_m, to.y_m, heading_rad + turn_rad)
}

/// A pose led towards an estimate for a share of the time constant.
fn corrected(pose: Pose2, estimate: Pose2, share: f64) -> Pose2 {
    let off: Point2<Ego> = pose.to_local(estimate.point());
    let off_rad = angle_between(pose.heading_rad, estimate.heading_rad);
    let left = math::exp(-share);
    let lag = |off: f64, most: f64| (off * left).clamp(-most, most);
    let point = pose
        .from_local(Point2::<Ego>::new(off.x_m - lag(off.x_m, LAG_MAX_M), off.y_m - lag(off.y_m, LAG_MAX_M)));
    Pose2::new(point.x_m, point.y_m, pose.heading_rad + off_rad - lag(off_rad, LAG_MAX_RAD))
}

/// Poses for control are kept for this long: plans older than that are expired.
const KEPT: Span = Span::from_ms(5000);

/// The poses for control of the last seconds.
#[derive(Debug, Default)]
pub(super) struct LocalPoses {
    kept: VecDeque<LocalPose>,
    /// Messages that were taken.
    taken: u64,
}

impl LocalPoses {
    /// Takes the new messages of a window.
    pub(super) fn take(&mut self, window: &[Message<LocalPose>]) {
        let is_finite = |local: &LocalPose| local.odom.is_finite() && local.map_from_odom.is_finite();
        let new = new(window, &mut self.taken).map(|local| **local);
        self.kept.extend(new.filter(is_finite));
        let newest = self.kept.back().map(|local| local.stamp);
        while newest.zip(self.kept.front()).is_some_and(|(newest, oldest)| newest - oldest.stamp > KEPT) {
            self.kept.pop_front();
        }
    }

    /// The newest that is not younger than an instant, else the oldest. `None` without localization.
    pub(super) fn at(&self, stamp: Time) -> Option<LocalPose> {
        let until = self.kept.partition_point(|local| local.stamp <= stamp);
        self.kept.get(until.saturating_sub(1)).copied()
    }

    /// The newest that is older than an instant.
    pub(super) fn before(&self, stamp: Time) -> Option<LocalPose> {
        let until = self.kept.partition_point(|local| local.stamp < stamp);
        until.checked_sub(1).and_then(|newest| self.kept.get(newest)).copied()
    }

    /// A measured state with its pose for control, in the map as known by `known`.
    pub(super) fn state(&self, measured: &EgoState, known: Option<LocalPose>) -> EgoState {
        let local = self.at(measured.stamp).zip(known);
        let pose = local.map_or(measured.pose, |(local, known)| known.to_map(local.odom));
        EgoState { pose, ..*measured }
    }
}

/// A plan made in the map as known by `then`, at the same place of the odometry frame in the map as known by `now`.
/// `None` where it stays as it is.
pub(super) fn carried(plan: &Plan, then: Option<LocalPose>, now: Option<LocalPose>) -> Option<Plan> {
    let (then, now) = then.zip(now).filter(|(then, now)| then.map_from_odom != now.map_from_odom)?;
    let mut plan = plan.clone();
    plan.points.iter_mut().for_each(|point| point.pose = now.to_map(then.to_odom(point.pose)));
    Some(plan)
}

#[cfg(test)]
mod tests;
