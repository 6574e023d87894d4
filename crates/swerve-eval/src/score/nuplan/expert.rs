//! Progress of an expert where no recorded driver exists.

/// A driver on a free road: the free term of the intelligent driver model (Treiber, Hennecke, Helbing 2000).
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FreeDriver {
    /// Maximum acceleration, m/s².
    pub accel_mps2: f64,
    /// Maximum deceleration, m/s², where the speed is above the limit.
    pub decel_mps2: f64,
}

/// Treiber's values for a car.
impl Default for FreeDriver {
    fn default() -> Self {
        Self { accel_mps2: 1.0, decel_mps2: 1.5 }
    }
}

/// Step of the integration, seconds.
const STEP_S: f64 = 0.01;

impl FreeDriver {
    fn accel(self, speed_mps: f64, limit_mps: f64) -> f64 {
        let ratio = speed_mps / limit_mps;
        (self.accel_mps2 * (1.0 - ratio * ratio * ratio * ratio)).max(-self.decel_mps2)
    }
}

/// Progress of a driver without traffic or lights along a route within `duration_s`, metres, at most the length of the
/// route.
///
/// `limits` are the speed limits from an arc length on, in ascending order: (metres, m/s). The first one also holds
/// before its arc length; without any, or with a limit that is not positive, there is no progress. The driver begins
/// with `speed_mps` and does not slow down ahead of a lower limit. Integrated by Heun's method in steps of 10 ms.
pub fn expert_progress_m(
    route_length_m: f64,
    limits: &[(f64, f64)],
    (speed_mps, duration_s): (f64, f64),
    driver: FreeDriver,
) -> f64 {
    let limit_at = |s_m: f64| {
        let behind = limits.partition_point(|(from_m, _)| *from_m <= s_m);
        limits.get(behind.saturating_sub(1)).map_or(0.0, |(_, limit_mps)| *limit_mps)
    };
    let (mut s_m, mut v_mps, mut left_s) = (0.0, speed_mps, duration_s);
    while left_s > 0.0 && s_m < route_length_m && limit_at(s_m) > 0.0 {
        let (dt_s, limit_mps) = (left_s.min(STEP_S), limit_at(s_m));
        let first = driver.accel(v_mps, limit_mps);
        let second = driver.accel((v_mps + first * dt_s).max(0.0), limit_mps);
        let next_mps = (v_mps + 0.5 * (first + second) * dt_s).max(0.0);
        s_m += 0.5 * (v_mps + next_mps) * dt_s;
        (v_mps, left_s) = (next_mps, left_s - dt_s);
    }
    s_m.clamp(0.0, route_length_m.max(0.0))
}
