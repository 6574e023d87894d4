//! Steering of a stop: along the last plan, by dead reckoning from a pose that was plausible. And how hard that plan braked.

use swerve_core::Time;
use swerve_msg::Plan;

use super::pose_check::{Anchor, PoseCheck};
use crate::lateral::{OnPath, StanleyParams, stanley};
use crate::reference::Reference;

/// The path of a stop, and the pose that dead reckoning starts from, where one is known.
#[derive(Clone, Debug)]
pub(super) struct StopPath {
    reference: Reference,
    anchor: Option<Anchor>,
    /// Decelerations of the plan, m/s², each the largest until then.
    decels: Vec<(Time, f64)>,
}

impl StopPath {
    /// Along `plan`, if a car can follow it.
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

    /// The largest deceleration that the plan had until an instant, m/s².
    pub(super) fn planned_mps2(&self, now: Time) -> f64 {
        let until = self.decels.partition_point(|(at, _)| *at <= now);
        until.checked_sub(1).map_or(0.0, |newest| self.decels[newest].1)
    }

    /// Angle of the front road wheels, radians: that of Stanley's law. `None` where reports or a pose from before are missing.
    pub(super) fn steering_rad(&self, check: &PoseCheck, now: Time, wheelbase_m: f64) -> Option<f64> {
        let (pose, motion) = check.place_since(self.anchor.as_ref()?, now)?;
        // Damping by the yaw rate would carry the noise of a reported angle to the wheels.
        let params = StanleyParams { yaw_damping_s: 0.0, ..StanleyParams::default() };
        let s_m = self.reference.project(pose.point());
        let beside = self.reference.at(s_m)?;
        let ahead = self.reference.at(s_m + params.preview_s * motion.speed_mps.max(0.0))?;
        let on_path = OnPath { pose: beside.pose, curvature_1pm: ahead.curvature_1pm };
        let angle_rad = stanley(pose, motion.speed_mps, motion.yaw_rate_radps, on_path, wheelbase_m, &params);
        angle_rad.is_finite().then_some(angle_rad)
    }
}

#[cfg(test)]
mod tests;
