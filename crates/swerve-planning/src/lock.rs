//! Curvature at full lock of the steering.

use swerve_geom::math;
use swerve_vehicle::{Limits, Shape};

/// Curvature at full lock, 1/m.
pub fn curvature_max_1pm(limits: &Limits, shape: &Shape) -> f64 {
    math::tan(limits.steering_max_rad) / shape.wheelbase_m
}
