//! The odometry frame (ROS REP 105): its pose in the map while localization corrects it, and poses carried between
//! the map as it was known at two instants.
//!
//! ```text
//! localizer --EgoState (map)--------> planner, controller
//!           --MapFromOdom-----------> planner: carries its previous plan to the map of now
//!                                     controller: carries the ego to the map of the plan
//! ```
//!
//! Both compare ego and plan in the odometry frame, where a correction of the pose moves neither against the other.
//! The correction enters by the next plan, which leads back to the route within the limits of the planner.

use std::collections::VecDeque;

use swerve_core::{Span, Time};
use swerve_flow::Message;
use swerve_geom::{Odom, Pose2, Vector2};
use swerve_msg::{MapFromOdom, Plan};

use super::localizer::new;

/// Longest step of the odometry, seconds: over a longer silence the motion is unknown.
const STEP_MAX_S: f64 = 0.2;

/// Pose of the ego in the odometry frame by its velocity and yaw rate. Starts at the origin.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Odometer {
    pose: Pose2<Odom>,
    last: Option<Time>,
}

impl Odometer {
    /// Moves on to `stamp`. `velocity_mps` is of the ego origin along its axes, forward and to the left.
    pub(super) fn advance(
        &mut self,
        stamp: Time,
        velocity_mps: [f64; 2],
        yaw_rate_radps: f64,
    ) -> Pose2<Odom> {
        let dt_s = self.last.map_or(0.0, |last| (stamp - last).as_secs()).clamp(0.0, STEP_MAX_S);
        self.last = Some(stamp);
        let turn_rad = yaw_rate_radps * dt_s;
        let forward = Vector2::from_heading(self.pose.heading_rad + 0.5 * turn_rad);
        let [ahead, left] = velocity_mps;
        let to = self.pose.point() + forward * (ahead * dt_s) + forward.left() * (left * dt_s);
        self.pose = Pose2::new(to.x_m, to.y_m, self.pose.heading_rad + turn_rad);
        self.pose
    }
}

/// Transforms are kept for this long: plans older than that are expired.
const KEPT: Span = Span::from_ms(5000);

/// Transforms from the odometry frame to the map of the last seconds.
#[derive(Debug, Default)]
pub(super) struct OdomFrame {
    kept: VecDeque<MapFromOdom>,
    /// Messages that were taken.
    taken: u64,
}

impl OdomFrame {
    /// Takes the new messages of a window.
    pub(super) fn take(&mut self, window: &[Message<MapFromOdom>]) {
        self.kept.extend(new(window, &mut self.taken).filter(|from| from.pose.is_finite()).map(|from| **from));
        let newest = self.kept.back().map(|from| from.stamp);
        while newest.zip(self.kept.front()).is_some_and(|(newest, oldest)| newest - oldest.stamp > KEPT) {
            self.kept.pop_front();
        }
    }

    /// The transform known at an instant: the newest that is not younger, else the oldest. `None` without localization.
    pub(super) fn at(&self, stamp: Time) -> Option<MapFromOdom> {
        let until = self.kept.partition_point(|from| from.stamp <= stamp);
        self.kept.get(until.saturating_sub(1)).copied()
    }
}

/// A pose of the map as known by `then`, in the map as known by `now`: the same place in the odometry frame.
pub(super) fn carried(pose: Pose2, then: Option<MapFromOdom>, now: Option<MapFromOdom>) -> Pose2 {
    match (then, now) {
        (Some(then), Some(now)) if then != now => now.map(then.odom(pose)),
        _ => pose,
    }
}

/// A plan carried likewise; `None` where it stays as it is.
pub(super) fn carried_plan(
    plan: &Plan,
    then: Option<MapFromOdom>,
    now: Option<MapFromOdom>,
) -> Option<Plan> {
    (then.is_some() && now.is_some() && then != now).then(|| {
        let mut plan = plan.clone();
        plan.points.iter_mut().for_each(|point| point.pose = carried(point.pose, then, now));
        plan
    })
}
