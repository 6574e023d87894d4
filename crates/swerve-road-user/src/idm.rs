//! Intelligent driver model (IDM).
//! Source: Treiber, Hennecke and Helbing, "Congested traffic states", Physical Review E 62 (2000), equations 3 and 4.

/// Usual gap at standstill, metres.
pub const STAND_GAP_M: f64 = 2.0;

/// Parameters of a driver.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Idm {
    /// Largest acceleration, m/s².
    pub gain_mps2: f64,
    /// Comfortable deceleration, m/s².
    pub brake_mps2: f64,
    /// Desired time gap, seconds.
    pub headway_s: f64,
    /// Gap at standstill, metres.
    pub stand_gap_m: f64,
}

impl Idm {
    /// Acceleration at a speed, m/s². `free_mps` is the desired speed on a free road, `next` the gap to the lead (m)
    /// and its speed (m/s).
    pub fn acceleration_mps2(&self, speed_mps: f64, free_mps: f64, next: Option<(f64, f64)>) -> f64 {
        let v = speed_mps;
        let ratio = v / free_mps;
        let near = next.map_or(0.0, |(gap_m, next_mps)| {
            let closing = v * (v - next_mps) / (2.0 * (self.gain_mps2 * self.brake_mps2).sqrt());
            let wanted_m = self.stand_gap_m + (v * self.headway_s + closing).max(0.0);
            (wanted_m / gap_m.max(0.1)) * (wanted_m / gap_m.max(0.1))
        });
        self.gain_mps2 * (1.0 - ratio * ratio * ratio * ratio - near)
    }

    /// Gap at which a driver follows at a steady speed, metres.
    pub fn equilibrium_gap_m(&self, speed_mps: f64, free_mps: f64) -> f64 {
        let ratio = speed_mps / free_mps;
        let free = 1.0 - ratio * ratio * ratio * ratio;
        (self.stand_gap_m + speed_mps * self.headway_s) / free.max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVER: Idm = Idm { gain_mps2: 1.0, brake_mps2: 1.5, headway_s: 1.2, stand_gap_m: 2.0 };

    #[test]
    fn acceleration_is_that_of_the_formula() {
        for (speed_mps, next, expected_mps2) in [
            (0.0, None, 1.0),
            (15.0, None, 0.0),
            (0.0, Some((2.0, 0.0)), 0.0),
            // Wanted gap: 2 + 12 + 10 * 5 / (2 * sqrt(1.5)) m.
            (10.0, Some((50.0, 5.0)), 1.0 - 16.0 / 81.0 - (34.412_414_523_193_15_f64 / 50.0).powi(2)),
        ] {
            let found_mps2 = DRIVER.acceleration_mps2(speed_mps, 15.0, next);
            assert!((found_mps2 - expected_mps2).abs() < 1e-12, "{speed_mps}: {found_mps2}");
        }
    }

    #[test]
    fn acceleration_is_zero_at_the_equilibrium_gap() {
        for speed_mps in [0.0, 3.0, 10.0, 14.0] {
            let gap_m = DRIVER.equilibrium_gap_m(speed_mps, 15.0);
            let found_mps2 = DRIVER.acceleration_mps2(speed_mps, 15.0, Some((gap_m, speed_mps)));
            assert!(found_mps2.abs() < 1e-12, "{speed_mps}: {found_mps2}");
        }
    }
}
