//! Plan counts by status, and the first path found.

use serde::{Deserialize, Serialize};
use swerve_msg::{Plan, PlanStatus};

use crate::seconds;

/// Plan counts by status.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct PlanCounts {
    /// Route followed; no planning was needed.
    pub route: u64,
    /// Path found.
    pub found: u64,
    /// No path found; the previous plan was continued.
    pub kept: u64,
    /// No path found; full brake along the previous path.
    pub brake: u64,
    /// No path found; speed zero along the route.
    pub stop: u64,
    /// No path found; the route was followed regardless.
    pub gave_up: u64,
    /// Path within the comfort limits found.
    #[serde(default)]
    pub comfortable: u64,
    /// Stop because the pose was too uncertain for the lane.
    #[serde(default)]
    pub pose_uncertain: u64,
    /// Full brake in place of a plan that no car can follow.
    #[serde(default)]
    pub refused: u64,
}

impl PlanCounts {
    /// Total number of plans.
    pub fn all(&self) -> u64 {
        let Self { route, found, kept, brake, stop, gave_up, comfortable, pose_uncertain, refused } = self;
        route + found + kept + brake + stop + gave_up + comfortable + pose_uncertain + refused
    }
}

/// Plan counts, and times of finding paths and of standing.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PlanMetrics {
    /// Plan counts by status.
    pub counts: PlanCounts,
    /// Plans that are not driven: without points, with impossible values, or with instants out of order.
    #[serde(default)]
    pub refused: u64,
    /// Stamp of the first path found outside the comfort limits, seconds.
    pub first_found_s: Option<f64>,
    /// Share of the plans from the comfortable layer, 0 to 1; the others are from the planner itself. Null without a
    /// plan.
    #[serde(default)]
    pub comfortable_share: Option<f64>,
    /// Stamp since which all plans up to the end are stops for an uncertain pose, seconds.
    #[serde(default)]
    pub pose_uncertain_since_s: Option<f64>,
    /// Time at rest after setting off, seconds.
    #[serde(default)]
    pub stood_s: f64,
    /// Part of that time under plans that stop for an uncertain pose, seconds.
    #[serde(default)]
    pub stood_uncertain_s: f64,
}

impl PlanMetrics {
    /// Adds time at rest, after setting off, under a plan of this status.
    pub fn stood(&mut self, status: PlanStatus, for_s: f64) {
        self.stood_s += for_s;
        self.stood_uncertain_s += if status == PlanStatus::PoseUncertain { for_s } else { 0.0 };
    }

    /// Adds one plan.
    pub fn take(&mut self, plan: &Plan) {
        let counts = &mut self.counts;
        *match plan.status {
            PlanStatus::Route => &mut counts.route,
            PlanStatus::Found => &mut counts.found,
            PlanStatus::Kept => &mut counts.kept,
            PlanStatus::Brake => &mut counts.brake,
            PlanStatus::Stop => &mut counts.stop,
            PlanStatus::GaveUp => &mut counts.gave_up,
            PlanStatus::Comfortable => &mut counts.comfortable,
            PlanStatus::PoseUncertain => &mut counts.pose_uncertain,
            PlanStatus::Refused => &mut counts.refused,
        } += 1;
        self.refused +=
            u64::from(plan.status == PlanStatus::Refused || plan.points.is_empty() || !plan.is_plausible());
        if plan.status == PlanStatus::PoseUncertain {
            self.pose_uncertain_since_s.get_or_insert(seconds(plan.stamp));
        } else {
            self.pose_uncertain_since_s = None;
        }
        if plan.status == PlanStatus::Found {
            self.first_found_s.get_or_insert(seconds(plan.stamp));
        }
        self.comfortable_share = Some(self.counts.comfortable as f64 / self.counts.all() as f64);
    }
}

#[cfg(test)]
mod tests {
    use swerve_core::Time;
    use swerve_msg::PlanPoint;

    use super::*;

    #[test]
    fn plans_are_counted_by_status_and_the_first_path_kept() {
        let mut metrics = PlanMetrics::default();
        for (ms, status) in [
            (0, PlanStatus::Route),
            (50, PlanStatus::GaveUp),
            (100, PlanStatus::Found),
            (150, PlanStatus::Found),
            (200, PlanStatus::Kept),
        ] {
            metrics.take(&Plan { stamp: Time::from_ms(ms), status, ..Plan::default() });
        }
        assert_eq!(
            metrics.counts,
            PlanCounts { route: 1, found: 2, kept: 1, gave_up: 1, ..Default::default() }
        );
        assert_eq!((metrics.first_found_s, metrics.refused), (Some(0.1), 5));
        let stands = PlanPoint::default();
        let full_brake = Plan { status: PlanStatus::Refused, points: vec![stands], ..Plan::default() };
        let mut refusing = PlanMetrics::default();
        refusing.take(&full_brake);
        assert_eq!((refusing.refused, refusing.counts.refused, refusing.counts.all()), (1, 1, 1));
        assert_eq!((metrics.counts.all(), metrics.comfortable_share), (5, Some(0.0)));
        for _ in 0..15 {
            metrics.take(&Plan { status: PlanStatus::Comfortable, ..Plan::default() });
        }
        assert_eq!(metrics.comfortable_share, Some(0.75));
        assert_eq!(PlanMetrics::default().comfortable_share, None);
    }
}
