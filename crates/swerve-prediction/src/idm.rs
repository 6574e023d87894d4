//! Intelligent driver model (IDM).
//! Source: Treiber, Hennecke and Helbing, "Congested traffic states", Physical Review E 62 (2000), equations 3 and 4.

/// Gap at standstill, metres.
pub(crate) const STAND_GAP_M: f64 = 2.0;

/// Parameters of a driver.
pub(crate) struct Driver {
    /// Largest acceleration, m/s².
    pub(crate) gain_mps2: f64,
    /// Comfortable deceleration, m/s².
    pub(crate) brake_mps2: f64,
    /// Desired time gap, seconds.
    pub(crate) headway_s: f64,
}

impl Driver {
    /// Acceleration at a speed, m/s². `free_mps` is the desired speed on a free road, `next` the gap to the lead (m)
    /// and its speed (m/s).
    pub(crate) fn acceleration_mps2(&self, speed_mps: f64, free_mps: f64, next: Option<(f64, f64)>) -> f64 {
        let v = speed_mps;
        let ratio = v / free_mps;
        let near = next.map_or(0.0, |(gap_m, next_mps)| {
            let closing = v * (v - next_mps) / (2.0 * (self.gain_mps2 * self.brake_mps2).sqrt());
            let wanted_m = STAND_GAP_M + (v * self.headway_s + closing).max(0.0);
            (wanted_m / gap_m.max(0.1)) * (wanted_m / gap_m.max(0.1))
        });
        self.gain_mps2 * (1.0 - ratio * ratio * ratio * ratio - near)
    }
}
