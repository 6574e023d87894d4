//! Slowly varying random numbers.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Ranges, Span, Time};

/// Temporal correlation of a standard normal number.
///
/// `sqrt(correlation) * slow + sqrt(1 - correlation) * new`: `new` is drawn for each instant; `slow` is drawn at
/// multiples of `period_s`, interpolated linearly and scaled to unit variance. The number is standard normal at each
/// instant; numbers at least two periods apart are independent.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields)]
pub struct Drift {
    /// Correlation of neighbouring instants: their shared fraction of the variance, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub correlation: f64,
    /// Period of the slow draws, seconds.
    #[schemars(range(min = 1e-3, max = 1e3))]
    pub period_s: f64,
}

/// Keys of the draws for an instant and for a slow instant.
const NEW: i64 = 0;
const SLOW: i64 = 1;

impl Drift {
    /// Number at an instant; `draw(index, which)` returns the standard normal number of a key.
    pub(super) fn at(&self, at: Time, draw: impl Fn(i64, i64) -> f64) -> f64 {
        let (before, part) = self.block(at);
        let slow = (1.0 - part) * draw(before, SLOW) + part * draw(before + 1, SLOW);
        let deviation = ((1.0 - part) * (1.0 - part) + part * part).sqrt();
        self.correlation.sqrt() * slow / deviation + (1.0 - self.correlation).sqrt() * draw(at.ns(), NEW)
    }

    /// Index of the latest slow instant, counted from time zero, and the fraction of the period elapsed since, 0 to 1.
    pub(super) fn block(&self, at: Time) -> (i64, f64) {
        let period = Span::from_secs(self.period_s).ns().max(1);
        let before = at.ns().div_euclid(period);
        (before, at.ns().rem_euclid(period) as f64 / period as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_core::Rng;

    const DRIFT: Drift = Drift { correlation: 0.8, period_s: 0.5 };

    fn number(k: i64, ms: i64) -> f64 {
        DRIFT.at(Time::from_ms(ms), |when, which| Rng::keyed(3, "drift", &[k, when, which]).normal())
    }

    /// Correlation of the numbers at two instants, over many keys.
    fn correlation(a_ms: i64, b_ms: i64) -> f64 {
        const N: i64 = 20_000;
        (0..N).map(|k| number(k, a_ms) * number(k, b_ms)).sum::<f64>() / N as f64
    }

    #[test]
    fn drift_is_standard_normal_at_every_instant() {
        for ms in [0, 100, 250, 400, 730] {
            let variance = correlation(ms, ms);
            assert!((variance - 1.0).abs() < 0.03, "{ms}: {variance}");
        }
    }

    #[test]
    fn drift_correlates_neighbouring_but_not_distant_instants() {
        let near = correlation(200, 250);
        assert!((0.7..0.82).contains(&near), "{near}");
        assert!(correlation(250, 700) < 0.5);
        assert!(correlation(100, 1100).abs() < 0.03);
    }
}
