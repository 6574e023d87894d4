//! Tyre slip of a single-track model in steady turns.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;
use swerve_geom::{Pose2, math};

/// Smallest effective wheelbase under braking, as a fraction of the wheelbase: beyond that the tyres' limit applies.
const WHEELBASE_SHARE_MIN: f64 = 0.7;

/// Tyre slip, added to the geometric steering.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct SlipParams {
    /// Slip angle of the rear tyres per lateral acceleration, rad s²/m: in a turn the nose points further inwards than
    /// the course of the rear axle by this angle. Close to the inverse of the tyres' stiffness per load and of gravity.
    #[schemars(range(min = -1.0, max = 1.0))]
    pub rear_s2pm: f64,
    /// Understeer gradient, rad s²/m: steering beyond the geometric angle per lateral acceleration.
    #[schemars(range(min = -1.0, max = 1.0))]
    pub understeer_s2pm: f64,
    /// Reduction of the understeer gradient per deceleration, rad s⁴/m²: braking loads the front tyres and unloads the
    /// rear ones, so that the same angle turns the car more. About `rear_s2pm h/g (1/a + 1/b)`, with the height `h` of
    /// the centre of gravity and its distances `a` and `b` from the axles.
    #[schemars(range(min = -1.0, max = 1.0))]
    pub braking_s4pm2: f64,
}

impl Default for SlipParams {
    fn default() -> Self {
        Self { rear_s2pm: 0.0055, understeer_s2pm: 0.0005, braking_s4pm2: 0.00045 }
    }
}

impl SlipParams {
    /// Parameters of a car without tyre slip.
    #[cfg(test)]
    pub(crate) const NONE: Self = Self { rear_s2pm: 0.0, understeer_s2pm: 0.0, braking_s4pm2: 0.0 };

    /// Effective wheelbase added by slip, metres; negative if it turns the car more.
    pub(crate) fn added_m(&self, wheelbase_m: f64, speed_mps: f64, decel_mps2: f64) -> f64 {
        let gradient_s2pm = self.understeer_s2pm - self.braking_s4pm2 * decel_mps2.max(0.0);
        (gradient_s2pm * speed_mps * speed_mps).max((WHEELBASE_SHARE_MIN - 1.0) * wheelbase_m)
    }

    /// Curvature of the heading for a steering angle, 1/m.
    pub(crate) fn curvature_1pm(
        &self,
        steering_rad: f64,
        wheelbase_m: f64,
        speed_mps: f64,
        decel_mps2: f64,
    ) -> f64 {
        math::tan(steering_rad) / (wheelbase_m + self.added_m(wheelbase_m, speed_mps, decel_mps2))
    }

    /// Course of the rear axle for a heading curvature, radians.
    pub(crate) fn course_rad(&self, heading_rad: f64, curvature_1pm: f64, speed_mps: f64) -> f64 {
        heading_rad - self.rear_s2pm * (speed_mps * speed_mps * curvature_1pm)
    }

    /// Pose after driving `way_m` metres with a heading curvature.
    pub(crate) fn moved<F>(
        &self,
        pose: Pose2<F>,
        curvature_1pm: f64,
        speed_mps: f64,
        way_m: f64,
    ) -> Pose2<F> {
        let turn_rad = curvature_1pm * way_m;
        let course_rad = self.course_rad(pose.heading_rad + 0.5 * turn_rad, curvature_1pm, speed_mps);
        let there = Pose2::<F>::new(pose.x_m, pose.y_m, course_rad).ahead(way_m);
        Pose2::new(there.x_m, there.y_m, pose.heading_rad + turn_rad)
    }
}
