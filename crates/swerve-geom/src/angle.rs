//! Wrapping of angles.

use core::f64::consts::{PI, TAU};

/// Wraps an angle to `(-pi, pi]`.
pub fn wrap_angle(angle_rad: f64) -> f64 {
    if -PI < angle_rad && angle_rad <= PI {
        return angle_rad;
    }
    let wrapped = angle_rad - TAU * (angle_rad / TAU).round();
    if wrapped <= -PI { wrapped + TAU } else { wrapped }
}

/// Turn in `(-pi, pi]` from heading `from_rad` to heading `to_rad`; positive to the left.
pub fn angle_between(from_rad: f64, to_rad: f64) -> f64 {
    wrap_angle(to_rad - from_rad)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_wrap_to_the_half_open_circle() {
        for (angle, want) in
            [(0.0, 0.0), (PI, PI), (-PI, PI), (3.0 * PI, PI), (TAU, 0.0), (-0.5 * PI, -0.5 * PI)]
        {
            assert!((wrap_angle(angle) - want).abs() < 1e-12, "{angle}");
        }
    }

    #[test]
    fn turns_take_the_short_way() {
        assert!((angle_between(3.0, -3.0) - (TAU - 6.0)).abs() < 1e-12);
    }
}
