//! Plausibility check of the pose: over a window, it has to move as the vehicle's speed and steering angle imply.
//!
//! ```text
//! pose now, relative to the pose a second ago   -  the same by dead reckoning over the reports
//! ```
//!
//! The difference is bounded by the tolerance of a blind stop. A car whose heading is wrong by `e` and that stops
//! within `d` metres deviates laterally by `e d` metres, so `e` is at most the margin in the lane over `d`. If that is
//! below the resolution of the sensors, their resolution is the bound. Localization may correct itself within its
//! declared uncertainty: three of its standard deviations are added.

use std::collections::VecDeque;

use swerve_core::{Span, Time};
use swerve_geom::{Map, Point2, Pose2, angle_between, math};
use swerve_msg::{EgoState, PoseQuality, VehicleReport};

use super::GateParams;
use crate::SlipParams;

/// Time window of the comparison.
const WINDOW: Span = Span::from_ms(1000);
/// Interval between the poses that later ones are compared with.
const EVERY: Span = Span::from_ms(100);
/// Longest gap between two poses, or two reports, that a comparison bridges.
const GAP_MAX: Span = Span::from_ms(300);
/// Number of reports kept: a pose may be older than the latest report by their time span.
const KEPT: usize = 256;
/// Time from detection to full brake, seconds.
const REACTION_S: f64 = 0.3;
/// Heading correction of a healthy localizer within the window, radians.
const HEADING_RAD: f64 = 0.03;
/// Calibration error of a steering angle, radians.
const STEERING_RAD: f64 = 0.005;
/// Fraction of a turn caused by tyre slip, and fraction of a distance caused by sideslip and tyre radius.
const TURN_SHARE: f64 = 0.15;
const WAY_SHARE: f64 = 0.05;
/// Lateral acceleration that tyres hold, m/s²: turning the wheels further does not turn the car more. [`TURN_SHARE`]
/// covers more or less grip.
const GRIP_MPS2: f64 = 8.0;
/// Number of its standard deviations by which localization may correct itself.
const SIGMAS: f64 = 3.0;

/// Dead reckoning from the reports up to a stamp: geometric, for the bounds of the comparison, and with slip.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reckoned {
    stamp: Time,
    pose: Pose2<Map>,
    slipped: Pose2<Map>,
    /// Distance so far, metres; forwards and backwards both count.
    way_m: f64,
    pub(super) speed_mps: f64,
    yaw_rate_radps: f64,
    /// Curvature of the heading with slip, 1/m.
    pub(super) curvature_1pm: f64,
}

impl Reckoned {
    /// Advances to `stamp` with constant speed, yaw rate and curvature.
    fn at(&self, stamp: Time) -> Self {
        let dt_s = (stamp - self.stamp).as_secs();
        let Self { pose, speed_mps, yaw_rate_radps, .. } = *self;
        let ego = EgoState { pose, speed_mps, yaw_rate_radps, ..EgoState::default() };
        let slip = SlipParams::default();
        let slipped = slip.moved(self.slipped, self.curvature_1pm, speed_mps, speed_mps * dt_s);
        let way_m = self.way_m + speed_mps.abs() * dt_s.max(0.0);
        Self { stamp, pose: ego.pose_after(dt_s), slipped, way_m, ..*self }
    }
}

/// A pose, the dead-reckoned state at its stamp, and its declared standard deviations.
#[derive(Clone, Copy, Debug)]
struct Pair {
    pose: Pose2<Map>,
    reckoned: Reckoned,
    /// Standard deviations of position, metres, and heading, radians.
    sigma: [f64; 2],
}

/// Compares the latest pose with dead reckoning from earlier ones.
#[derive(Clone, Debug, Default)]
pub(super) struct PoseCheck {
    reckoned: VecDeque<Reckoned>,
    pairs: VecDeque<Pair>,
    newest: Option<Time>,
    implausible: bool,
    /// Number of restarts of the dead reckoning.
    epoch: u32,
}

/// A plausible pose as the origin of dead reckoning.
#[derive(Clone, Copy, Debug)]
pub(super) struct Anchor {
    pair: Pair,
    epoch: u32,
}

impl PoseCheck {
    /// Takes a report with finite numbers, in order of stamps, of a car that is commanded a deceleration.
    pub(super) fn take_report(&mut self, report: &VehicleReport, decel_mps2: f64, params: &GateParams) {
        let VehicleReport { stamp, speed_mps, steering_rad, .. } = *report;
        let steering_rad = steering_rad.clamp(-params.steering_max_rad, params.steering_max_rad);
        let grip_radps = GRIP_MPS2 / speed_mps.abs().max(1.0);
        let yaw_rate_radps =
            (speed_mps * math::tan(steering_rad) / params.wheelbase_m).clamp(-grip_radps, grip_radps);
        let slip = SlipParams::default();
        let curvature_1pm = slip.curvature_1pm(steering_rad, params.wheelbase_m, speed_mps, decel_mps2);
        let last = self.reckoned.back().copied();
        let last = last.filter(|last| stamp - last.stamp <= GAP_MAX);
        if last.is_none() {
            self.clear();
        } else if last.is_some_and(|last| last.stamp == stamp) {
            return;
        }
        let moved = last.map(|last| last.at(stamp));
        let (pose, slipped, way_m) =
            moved.map_or_else(Default::default, |moved| (moved.pose, moved.slipped, moved.way_m));
        let now = Reckoned { stamp, pose, slipped, way_m, speed_mps, yaw_rate_radps, curvature_1pm };
        self.reckoned.push_back(now);
        if self.reckoned.len() > KEPT {
            self.reckoned.pop_front();
        }
    }

    /// Takes the latest pose with its declared quality.
    pub(super) fn take_pose(&mut self, ego: &EgoState, quality: Option<&PoseQuality>, params: &GateParams) {
        let is_new = self.newest.is_none_or(|newest| ego.stamp > newest);
        if !is_new || params.lane_margin_m <= 0.0 || !ego.is_plausible() {
            return;
        }
        let gap = self.newest.is_some_and(|newest| ego.stamp - newest > GAP_MAX);
        self.newest = Some(ego.stamp);
        if gap {
            self.pairs.clear();
        }
        let Some(reckoned) = self.reckoned_at(ego.stamp) else { return };
        let sigma = quality.map_or([0.0; 2], |quality| {
            [quality.sigma_m(), quality.covariance[5].max(0.0).sqrt()]
                .map(|x| if x.is_finite() { x } else { 0.0 })
        });
        let now = Pair { pose: ego.pose, reckoned, sigma };
        while self.pairs.front().is_some_and(|pair| ego.stamp - pair.reckoned.stamp > WINDOW) {
            self.pairs.pop_front();
        }
        self.implausible = self.differs(&now, params);
        if self.pairs.back().is_none_or(|pair| ego.stamp - pair.reckoned.stamp >= EVERY) {
            self.pairs.push_back(now);
        }
    }

    /// Returns true if the latest pose moved differently from the wheels.
    pub(super) fn is_implausible(&self) -> bool {
        self.implausible
    }

    /// The oldest pose of the window: from before a fault detected now.
    pub(super) fn anchor(&self) -> Option<Anchor> {
        self.pairs.front().map(|pair| Anchor { pair: *pair, epoch: self.epoch })
    }

    /// Place of the car by dead reckoning from `anchor`, in the map, and its motion; `None` if reports are missing.
    pub(super) fn place_since(&self, anchor: &Anchor, now: Time) -> Option<(Pose2<Map>, Reckoned)> {
        let reckoned = self.reckoned_at(now).filter(|_| anchor.epoch == self.epoch)?;
        let Pair { pose, reckoned: then, .. } = anchor.pair;
        let place = pose.from_local(then.slipped.to_local::<Map>(reckoned.slipped.point()));
        let turn_rad = angle_between(then.slipped.heading_rad, reckoned.slipped.heading_rad);
        Some((Pose2::new(place.x_m, place.y_m, pose.heading_rad + turn_rad), reckoned))
    }

    fn clear(&mut self) {
        self.epoch = self.epoch.wrapping_add(1);
        self.reckoned.clear();
        self.pairs.clear();
        self.implausible = false;
    }

    /// Dead-reckoned state at a stamp, at most a gap beyond the latest report.
    fn reckoned_at(&self, stamp: Time) -> Option<Reckoned> {
        let before = self.reckoned.iter().rev().find(|reckoned| reckoned.stamp <= stamp)?;
        (stamp - before.stamp <= GAP_MAX).then(|| before.at(stamp))
    }

    fn differs(&self, now: &Pair, params: &GateParams) -> bool {
        let Some(then) = self.pairs.front() else { return false };
        let way_m = now.reckoned.way_m - then.reckoned.way_m;
        let turn_rad = angle_between(then.reckoned.pose.heading_rad, now.reckoned.pose.heading_rad);
        let moved = |from: Pose2<Map>, to: Pose2<Map>| -> Point2<Map> { from.to_local(to.point()) };
        let place_m = moved(then.pose, now.pose).distance(moved(then.reckoned.pose, now.reckoned.pose));
        let heading_rad =
            angle_between(turn_rad, angle_between(then.pose.heading_rad, now.pose.heading_rad)).abs();
        let most = |of: fn(&Pair) -> f64| self.pairs.iter().map(of).fold(0.0, f64::max);
        let [sigma_m, sigma_rad] = [most(|pair| pair.sigma[0]), most(|pair| pair.sigma[1])];

        let speed_mps = now.reckoned.speed_mps.abs();
        let stop_m = speed_mps * REACTION_S + speed_mps * speed_mps / (2.0 * params.stop_decel_mps2);
        let by_lane_rad = params.lane_margin_m / stop_m.max(1e-3);
        let by_sensors_rad = HEADING_RAD + STEERING_RAD * way_m / params.wheelbase_m;
        let most_rad = by_lane_rad.max(by_sensors_rad) + TURN_SHARE * turn_rad.abs() + SIGMAS * sigma_rad;
        let most_m = params.lane_margin_m + WAY_SHARE * way_m + SIGMAS * sigma_m;
        heading_rad > most_rad || place_m > most_m
    }
}

#[cfg(test)]
mod tests;
