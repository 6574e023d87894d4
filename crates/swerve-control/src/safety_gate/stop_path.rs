//! Path and deceleration of a stop: steers along the last plan by dead reckoning from a plausible pose.

use swerve_core::Time;
use swerve_geom::Pose2;
use swerve_msg::Plan;

use super::pose_check::{Anchor, PoseCheck};
use crate::SlipParams;
use crate::lateral::{OnPath, StanleyParams, stanley};
use crate::reference::Reference;

/// Path of a stop, with the starting pose of dead reckoning if one is known.
#[derive(Clone, Debug)]
pub(super) struct StopPath {
    reference: Reference,
    anchor: Option<Anchor>,
    /// Running maximum of the plan's decelerations, m/s².
    decels: Vec<(Time, f64)>,
}

impl StopPath {
    /// Creates the path along `plan`, if a car can follow it.
    pub(super) fn new(plan: Option<&Plan>, check: &PoseCheck) -> Option<Self> {
        let plan = plan.filter(|plan| plan.is_plausible() && !plan.points.is_empty())?;
        let mut reference = Reference::default();
        reference.load_plan(plan);
        let hardest = plan.points.iter().scan(0.0_f64, |hardest, point| {
            *hardest = hardest.max(-point.accel_mps2);
            Some((point.at, *hardest))
        });
        Some(Self { reference, anchor: check.anchor(), decels: hardest.collect() })
    }

    /// The largest deceleration of the plan up to an instant, m/s².
    pub(super) fn planned_mps2(&self, now: Time) -> f64 {
        let until = self.decels.partition_point(|(at, _)| *at <= now);
        until.checked_sub(1).map_or(0.0, |newest| self.decels[newest].1)
    }

    /// Angle of the front road wheels at a deceleration, radians, by Stanley's law; `None` if reports or an earlier
    /// pose are missing.
    pub(super) fn steering_rad(
        &self,
        check: &PoseCheck,
        now: Time,
        decel_mps2: f64,
        wheelbase_m: f64,
    ) -> Option<f64> {
        let (pose, motion) = check.place_since(self.anchor.as_ref()?, now)?;
        let slip = SlipParams::default();
        // Yaw rate damping would pass the noise of a reported angle to the wheels.
        let params = StanleyParams { yaw_damping_s: 0.0, ..StanleyParams::default() };
        let speed_mps = motion.speed_mps.max(0.0);
        let s_m = self.reference.project(pose.point());
        let beside = self.reference.at(s_m)?;
        let curvature_1pm = self.reference.at(s_m + params.preview_s * speed_mps)?.curvature_1pm;
        let on_path = OnPath { pose: beside.pose, curvature_1pm };
        let course_rad = slip.course_rad(pose.heading_rad, beside.curvature_1pm, speed_mps);
        let course = Pose2::new(pose.x_m, pose.y_m, course_rad);
        let yaw_rate_radps = motion.curvature_1pm * motion.speed_mps;
        let angle_rad = stanley(course, motion.speed_mps, yaw_rate_radps, on_path, wheelbase_m, &params)
            + slip.added_m(wheelbase_m, speed_mps, decel_mps2) * curvature_1pm;
        angle_rad.is_finite().then_some(angle_rad)
    }
}

#[cfg(test)]
mod tests;
