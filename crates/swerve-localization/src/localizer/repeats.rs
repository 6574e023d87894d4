//! Wheels that repeat their readings although the car accelerates.
//!
//! Encoders count ticks, so that readings may repeat at constant speed: they then differ by whole ticks per period. They
//! do not repeat while the inertial unit measures a change of speed by more than a tick.

use swerve_core::Time;

/// Change of speed beyond a tick without a change of the reading, m/s, and per second of repetitions, m/s².
const GAINED_MPS: f64 = 0.3;
const GAINED_MPS2: f64 = 0.2;

/// Readings of a moving car that repeat for longer are doubted where positions contradict the filter, seconds.
const LONG_S: f64 = 0.5;

/// Repetitions of the wheels' speed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Repeats {
    last_mps: f64,
    /// Smallest difference of consecutive readings that differ, m/s.
    tick_mps: Option<f64>,
    /// Instant of the first of the equal readings, and the change of speed since then by the inertial unit, m/s.
    since: Time,
    gained_mps: f64,
    /// Latest forward acceleration by the inertial unit, m/s².
    accel_mps2: f64,
    /// True if positions contradict the filter while the readings repeat.
    is_doubted: bool,
}

impl Repeats {
    /// Takes a reading.
    pub(super) fn take(&mut self, stamp: Time, speed_mps: f64) {
        if speed_mps == self.last_mps {
            return;
        }
        let step_mps = (speed_mps - self.last_mps).abs();
        self.tick_mps = Some(self.tick_mps.map_or(step_mps, |tick_mps| tick_mps.min(step_mps)));
        (self.last_mps, self.since, self.gained_mps, self.is_doubted) = (speed_mps, stamp, 0.0, false);
    }

    /// Takes a forward acceleration of the inertial unit, m/s².
    pub(super) fn accelerate(&mut self, accel_mps2: f64) {
        self.accel_mps2 = accel_mps2;
    }

    /// Advances by a time with the latest acceleration.
    pub(super) fn advance(&mut self, dt_s: f64) {
        self.gained_mps += self.accel_mps2 * dt_s;
    }

    /// Excludes readings that have repeated for long, until they change: positions contradict the filter.
    pub(super) fn doubt(&mut self, now: Time) {
        self.is_doubted |= self.last_mps != 0.0 && (now - self.since).as_secs() > LONG_S;
    }

    /// Returns true if the readings repeat while the speed changes or positions contradict the filter.
    pub(super) fn is_frozen(&self, now: Time) -> bool {
        if self.is_doubted {
            return true;
        }
        let doubt_mps = GAINED_MPS + GAINED_MPS2 * (now - self.since).as_secs();
        self.tick_mps.is_some_and(|tick_mps| self.gained_mps.abs() > tick_mps + doubt_mps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_core::Span;

    /// Seconds of braking, m/s², until repeated readings after 1 s of readings with ticks, m/s, count as frozen.
    fn found_after_s(tick_mps: f64, brake_mps2: f64) -> Option<f64> {
        let (mut repeats, period) = (Repeats::default(), Span::from_ms(20));
        let mut now = Time::ZERO;
        for k in 0..50 {
            now += period;
            repeats.take(now, 10.0 + tick_mps * f64::from(k % 2));
        }
        repeats.accelerate(-brake_mps2);
        let begun = now;
        (0..500).find_map(|_| {
            now += period;
            repeats.advance(period.as_secs());
            repeats.take(now, 10.0 + tick_mps);
            repeats.is_frozen(now).then(|| (now - begun).as_secs())
        })
    }

    #[test]
    fn wheels_that_repeat_while_the_car_brakes_are_frozen() {
        // A tick, 0.3 m/s and 0.2 m/s² of doubt: (tick + 0.3) / (brake - 0.2) s.
        for (tick_mps, brake_mps2, expected_s) in [(0.01, 2.0, 0.172), (1.0, 2.0, 0.722), (0.01, 0.5, 1.033)]
        {
            let found_s = found_after_s(tick_mps, brake_mps2).unwrap();
            assert!((found_s - expected_s).abs() < 0.05, "{tick_mps} {brake_mps2}: {found_s}");
        }
        assert_eq!(found_after_s(0.01, 0.15), None, "within the error of the unit");
    }
}
