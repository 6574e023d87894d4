//! A car whose tyres slip, as a single track in steady turns.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_geom::{Pose2, math};

/// Least share of the wheelbase that a car turns by, however hard it brakes: beyond that the tyres' limit counts.
const WHEELBASE_SHARE_MIN: f64 = 0.7;

/// Slip of the tyres, which adds to the geometry of steering.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SlipParams {
    /// Slip angle of the rear tyres per lateral acceleration, rad s²/m: in a turn the nose points that much
    /// further in than the rear axle goes. Near the inverse of the tyres' stiffness per load and of gravity.
    pub rear_s2pm: f64,
    /// Steering beyond the geometric angle per lateral acceleration, rad s²/m: the understeer gradient.
    pub understeer_s2pm: f64,
    /// How much less of that per deceleration, rad s⁴/m²: a brake loads the front tyres and unloads the rear ones, so that
    /// the same angle turns the car more. About `rear_s2pm h/g (1/a + 1/b)`, with the height `h` of the centre of gravity and
    /// its distances `a` and `b` from the axles.
    pub braking_s4pm2: f64,
}

impl Default for SlipParams {
    fn default() -> Self {
        Self { rear_s2pm: 0.0055, understeer_s2pm: 0.0005, braking_s4pm2: 0.00045 }
    }
}

impl SlipParams {
    /// Of a car whose tyres do not slip.
    #[cfg(test)]
    pub(crate) const NONE: Self = Self { rear_s2pm: 0.0, understeer_s2pm: 0.0, braking_s4pm2: 0.0 };

    /// Wheelbase that slip adds for steering, metres; negative where it turns the car more.
    pub(crate) fn added_m(&self, wheelbase_m: f64, speed_mps: f64, decel_mps2: f64) -> f64 {
        let gradient_s2pm = self.understeer_s2pm - self.braking_s4pm2 * decel_mps2.max(0.0);
        (gradient_s2pm * speed_mps * speed_mps).max((WHEELBASE_SHARE_MIN - 1.0) * wheelbase_m)
    }

    /// How the nose turns by an angle of the wheels, 1/m.
    pub(crate) fn curvature_1pm(
        &self,
        steering_rad: f64,
        wheelbase_m: f64,
        speed_mps: f64,
        decel_mps2: f64,
    ) -> f64 {
        math::tan(steering_rad) / (wheelbase_m + self.added_m(wheelbase_m, speed_mps, decel_mps2))
    }

    /// The direction in which the rear axle goes while the nose turns like this, radians.
    pub(crate) fn course_rad(&self, heading_rad: f64, curvature_1pm: f64, speed_mps: f64) -> f64 {
        heading_rad - self.rear_s2pm * (speed_mps * speed_mps * curvature_1pm)
    }

    /// A pose after a way, metres, on which the nose turns like this.
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
