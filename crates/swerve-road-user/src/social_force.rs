//! Social forces between pedestrians.
//! Source: Helbing and Molnár, "Social force model for pedestrian dynamics", Physical Review E 51 (1995), equations 2 to 6.

use swerve_geom::{Vector2, math};

/// Time constant with which the desired velocity is approached, seconds.
pub const RELAXATION_S: f64 = 0.5;
/// Largest speed of a pedestrian, as a ratio to the desired speed.
pub const SPEED_SHARE_MAX: f64 = 1.3;
/// Distance of the centres of two pedestrians in contact, metres.
pub const TOUCH_M: f64 = 0.6;
/// Range of the force, metres: beyond, less than a hundred-thousandth is left.
pub const REACH_M: f64 = 5.0;
/// Potential at zero distance, m²/s², and distance over which it falls to 1/e, metres.
const POTENTIAL_M2PS2: f64 = 2.1;
const RANGE_M: f64 = 0.3;
/// Look-ahead for the others' next step, seconds.
const NEXT_STEP_S: f64 = 2.0;
/// Weight of forces from outside the field of view, and half of its angle as a cosine (100°).
const UNSEEN_SHARE: f64 = 0.5;
const SIGHT_COS: f64 = -0.173_648;

/// Acceleration towards the desired velocity, m/s² (equation 2).
pub fn drive(velocity_mps: Vector2, wanted_mps: Vector2) -> Vector2 {
    (wanted_mps - velocity_mps) * (1.0 / RELAXATION_S)
}

/// A velocity, limited to the largest speed of a pedestrian with this desired velocity.
pub fn limited(velocity_mps: Vector2, wanted_mps: Vector2) -> Vector2 {
    let (speed, most) = (velocity_mps.norm(), SPEED_SHARE_MAX * wanted_mps.norm());
    if speed > most { velocity_mps * (most / speed) } else { velocity_mps }
}

/// Force of another road user, m/s² (equations 3 to 6): equipotential lines are ellipses that extend ahead of the other
/// by its next step. `away` leads from its centre to the pedestrian's; `extra_radius_m` is its radius in excess of a
/// pedestrian's.
pub fn push(away: Vector2, wanted_mps: Vector2, other_mps: Vector2, extra_radius_m: f64) -> Vector2 {
    let apart_m = away.norm();
    let step: Vector2 = other_mps * NEXT_STEP_S;
    let away_next = away - step;
    let apart_next_m = away_next.norm();
    if apart_m < 1e-9 || apart_next_m < 1e-9 || apart_m.min(apart_next_m) > REACH_M {
        return Vector2::default();
    }
    let both_m = apart_m + apart_next_m;
    let half_axis_m = 0.5 * (both_m * both_m - step.norm_squared()).max(1e-6).sqrt();
    let slope = (away * (1.0 / apart_m) + away_next * (1.0 / apart_next_m)) * (both_m / (4.0 * half_axis_m));
    let gap_m = (half_axis_m - extra_radius_m).max(0.0);
    let force = slope * (POTENTIAL_M2PS2 / RANGE_M * math::exp(-gap_m / RANGE_M));
    // Forces from ahead are within the field of view.
    let ahead = -wanted_mps.dot(force) >= SIGHT_COS * force.norm() * wanted_mps.norm();
    force * if ahead { 1.0 } else { UNSEEN_SHARE }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forces_repel_and_are_weaker_from_behind() {
        let (wanted_mps, still) = (Vector2::new(1.3, 0.0), Vector2::default());
        let from_ahead = push(Vector2::new(-1.0, 0.0), wanted_mps, still, 0.0);
        let from_behind = push(Vector2::new(1.0, 0.0), wanted_mps, still, 0.0);
        // At 1 m from someone at rest the ellipse is a circle: 2.1 / 0.3 * exp(-1 / 0.3) m/s².
        assert!((from_ahead.x + 7.0 * math::exp(-1.0 / 0.3)).abs() < 1e-12 && from_ahead.y == 0.0);
        assert!((from_behind.x + 0.5 * from_ahead.x).abs() < 1e-12);
        assert_eq!(push(Vector2::new(-6.0, 0.0), wanted_mps, still, 0.0), still);
    }

    #[test]
    fn speeds_are_limited_to_a_share_of_the_desired_one() {
        let wanted_mps = Vector2::new(1.0, 0.0);
        assert_eq!(limited(Vector2::new(0.0, 2.0), wanted_mps), Vector2::new(0.0, 1.3));
        assert_eq!(limited(Vector2::new(0.0, 1.2), wanted_mps), Vector2::new(0.0, 1.2));
        assert_eq!(drive(Vector2::new(0.0, 1.0), wanted_mps), Vector2::new(2.0, -2.0));
    }
}
