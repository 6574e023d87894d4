//! Plans.

use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::{Pose2, angle_between};

use crate::EgoState;

/// Planned motion of the ego origin.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Plan {
    /// Stamp of the predictions from which it was made.
    pub stamp: Time,
    /// Origin of the plan.
    pub status: PlanStatus,
    /// Points at increasing instants.
    pub points: Vec<PlanPoint>,
    /// Work of the planner: candidates (FOT), iterations (RRT*), expanded neighbours (Hybrid A*).
    pub work: u64,
}

/// One point of a plan.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PlanPoint {
    /// Instant of the point.
    pub at: Time,
    /// Pose of the ego origin in the map.
    pub pose: Pose2,
    /// Curvature of the path, 1/m; positive turns left.
    pub curvature_1pm: f64,
    /// Speed along the path, m/s.
    pub speed_mps: f64,
    /// Acceleration along the path, m/s².
    pub accel_mps2: f64,
}

/// Origin of a plan.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlanStatus {
    /// No planning requested: the plan follows the route.
    #[default]
    Route,
    /// The planner found this path.
    Found,
    /// No path found: keeps the previous plan, which is still collision-free.
    Kept,
    /// No path found: full braking along the previous path.
    Brake,
    /// No path found: zero speed along the route.
    Stop,
    /// No path found: follows the route regardless.
    GaveUp,
    /// The comfortable layer found this path.
    Comfortable,
    /// Stop, because the pose is too uncertain for the lane.
    PoseUncertain,
    /// Full braking in place of a plan that no car can follow ([`Plan::is_plausible`]).
    Refused,
}

impl PlanStatus {
    /// Returns true if the planner failed to find a path.
    pub fn is_fallback(self) -> bool {
        matches!(self, Self::Kept | Self::Brake | Self::Stop | Self::GaveUp | Self::Refused)
    }
}

impl Plan {
    /// Returns true if all values are finite and physically possible for a road vehicle, and the instants are in order.
    pub fn is_plausible(&self) -> bool {
        let point = |p: &PlanPoint| {
            let state = EgoState {
                pose: p.pose,
                speed_mps: p.speed_mps,
                accel_mps2: p.accel_mps2,
                ..EgoState::default()
            };
            state.is_plausible() && p.curvature_1pm.is_finite()
        };
        self.points.iter().all(point) && self.points.is_sorted_by_key(|p| p.at)
    }

    /// Instant of the last point, or the stamp without points.
    pub fn end(&self) -> Time {
        self.points.last().map_or(self.stamp, |p| p.at)
    }

    /// Planned state at `instant`: linear between points, clamped to the first and last point. `None` without
    /// points.
    pub fn at(&self, instant: Time) -> Option<PlanPoint> {
        let after = self.points.partition_point(|p| p.at <= instant);
        if after == 0 {
            return self.points.first().copied();
        }
        let a = self.points[after - 1];
        let Some(b) = self.points.get(after) else { return Some(a) };
        let t = (instant - a.at).as_secs() / (b.at - a.at).as_secs();
        let mix = |x: f64, y: f64| x + (y - x) * t;
        let turn = angle_between(a.pose.heading_rad, b.pose.heading_rad);
        Some(PlanPoint {
            at: instant,
            pose: Pose2::new(
                mix(a.pose.x_m, b.pose.x_m),
                mix(a.pose.y_m, b.pose.y_m),
                a.pose.heading_rad + turn * t,
            ),
            curvature_1pm: mix(a.curvature_1pm, b.curvature_1pm),
            speed_mps: mix(a.speed_mps, b.speed_mps),
            accel_mps2: mix(a.accel_mps2, b.accel_mps2),
        })
    }
}
