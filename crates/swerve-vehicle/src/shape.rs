//! Outline and limits of the car.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;
use swerve_geom::{Obb, Point2, Pose2};

/// Outline of a car around its origin, the centre of the rear axle on the ground.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Shape {
    /// Overall length, metres.
    #[schemars(range(min = 0.5, max = 30.0))]
    pub length_m: f64,
    /// Overall width without mirrors, metres.
    #[schemars(range(min = 0.3, max = 5.0))]
    pub width_m: f64,
    /// Overall height, metres.
    #[schemars(range(min = 0.3, max = 6.0))]
    pub height_m: f64,
    /// Distance between the axles, metres.
    #[schemars(range(min = 0.3, max = 20.0))]
    pub wheelbase_m: f64,
    /// Distance from the rear axle to the rear end, metres.
    #[schemars(range(min = 0.0, max = 15.0))]
    pub rear_overhang_m: f64,
}

impl Default for Shape {
    /// Dimensions of a Lincoln MKZ.
    fn default() -> Self {
        Self { length_m: 4.93, width_m: 1.86, height_m: 1.48, wheelbase_m: 2.85, rear_overhang_m: 1.04 }
    }
}

impl Shape {
    /// Distance from the rear axle forward to the centre of the outline, metres.
    pub fn center_ahead_m(&self) -> f64 {
        0.5 * self.length_m - self.rear_overhang_m
    }

    /// The outline with the ego origin at `pose`.
    pub fn footprint(&self, pose: Pose2) -> Obb {
        Obb::new(pose.ahead(self.center_ahead_m()), self.length_m, self.width_m)
    }

    /// The centre of the outline with the ego origin at `pose`.
    pub fn center(&self, pose: Pose2) -> Point2 {
        pose.ahead(self.center_ahead_m()).point()
    }
}

/// Limits of the vehicle, respected by planners and controllers.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Largest angle of the front road wheels, radians.
    #[schemars(range(min = 0.01, max = 1.25))]
    pub steering_max_rad: f64,
    /// Largest steering rate of the front road wheels, rad/s.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub steering_rate_max_radps: f64,
    /// Largest acceleration, m/s².
    #[schemars(range(min = 0.1, max = 50.0))]
    pub accel_max_mps2: f64,
    /// Largest deceleration on dry ground, m/s² (positive).
    #[schemars(range(min = 0.1, max = 50.0))]
    pub brake_max_mps2: f64,
    /// Largest lateral acceleration of plans, m/s².
    #[schemars(range(min = 0.1, max = 50.0))]
    pub lateral_accel_max_mps2: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            steering_max_rad: 0.61,
            steering_rate_max_radps: 0.7,
            accel_max_mps2: 3.0,
            brake_max_mps2: 8.0,
            lateral_accel_max_mps2: 7.85,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outline_is_placed_around_the_rear_axle() {
        let obb = Shape::default().footprint(Pose2::new(0.0, 0.0, 0.0));
        let front = obb.corners()[0].x_m;
        let rear = obb.corners()[1].x_m;
        assert!((rear + 1.04).abs() < 1e-12 && (front - 3.89).abs() < 1e-12);
    }
}
