//! Plans by status, and when the first path was found.

use serde::{Deserialize, Serialize};
use swerve_msg::{Plan, PlanStatus};

use crate::seconds;

/// Plans by how they came about.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct PlanCounts {
    /// The route was followed, nothing asked for planning.
    pub route: u64,
    /// A path was found.
    pub found: u64,
    /// None found, the previous plan went on.
    pub kept: u64,
    /// None found, full brake along the previous path.
    pub brake: u64,
    /// None found, speed zero along the route.
    pub stop: u64,
    /// None found, the route was followed regardless.
    pub gave_up: u64,
    /// A path within the limits of comfort was found.
    #[serde(default)]
    pub comfortable: u64,
    /// A stop, since the pose was too uncertain for the lane.
    #[serde(default)]
    pub pose_uncertain: u64,
}

impl PlanCounts {
    /// How many there are.
    pub fn all(&self) -> u64 {
        let Self { route, found, kept, brake, stop, gave_up, comfortable, pose_uncertain } = self;
        route + found + kept + brake + stop + gave_up + comfortable + pose_uncertain
    }
}

/// Plan counts, and when the planner itself first found a path.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PlanMetrics {
    /// How many plans came about how.
    pub counts: PlanCounts,
    /// Stamp of the first path found that is not within the limits of comfort, seconds.
    pub first_found_s: Option<f64>,
    /// Share of the plans that the comfortable layer made, 0 to 1; the planner itself made the others. Null without a plan.
    #[serde(default)]
    pub comfortable_share: Option<f64>,
    /// Stamp since which all plans up to the end stop for an uncertain pose, seconds.
    #[serde(default)]
    pub pose_uncertain_since_s: Option<f64>,
    /// Time that the ego stood after it had set off, seconds.
    #[serde(default)]
    pub stood_s: f64,
    /// Part of that time in which the plan stopped for an uncertain pose, seconds.
    #[serde(default)]
    pub stood_uncertain_s: f64,
}

impl PlanMetrics {
    /// The ego, which had set off before, stood for so long under a plan of this status.
    pub fn stood(&mut self, status: PlanStatus, for_s: f64) {
        self.stood_s += for_s;
        self.stood_uncertain_s += if status == PlanStatus::PoseUncertain { for_s } else { 0.0 };
    }

    /// Takes in one plan.
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
        } += 1;
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
        assert_eq!(metrics.first_found_s, Some(0.1));
        assert_eq!((metrics.counts.all(), metrics.comfortable_share), (5, Some(0.0)));
        for _ in 0..15 {
            metrics.take(&Plan { status: PlanStatus::Comfortable, ..Plan::default() });
        }
        assert_eq!(metrics.comfortable_share, Some(0.75));
        assert_eq!(PlanMetrics::default().comfortable_share, None);
    }
}
