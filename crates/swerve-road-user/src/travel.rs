//! Times of travel with constant acceleration.

/// Time for a distance with an acceleration up to a cruising speed, seconds; a faster vehicle adapts its speed on the
/// way.
pub fn time_s(distance_m: f64, speed_mps: f64, cruise_mps: f64, gain_mps2: f64) -> f64 {
    let (d, v, c) = (distance_m.max(0.0), speed_mps, cruise_mps.max(0.5));
    if v >= c {
        return d / (0.5 * (v + c));
    }
    let rise_m = (c * c - v * v) / (2.0 * gain_mps2);
    if d <= rise_m {
        return ((v * v + 2.0 * gain_mps2 * d).sqrt() - v) / gain_mps2;
    }
    (c - v) / gain_mps2 + (d - rise_m) / c
}

#[cfg(test)]
mod tests {
    use super::time_s;

    #[test]
    fn times_are_those_of_constant_acceleration() {
        assert_eq!(time_s(8.0, 0.0, 10.0, 1.0), 4.0);
        assert_eq!(time_s(70.0, 0.0, 10.0, 1.0), 12.0);
        assert_eq!(time_s(30.0, 10.0, 5.0, 1.0), 4.0);
        assert_eq!(time_s(-3.0, 4.0, 5.0, 1.0), 0.0);
    }
}
