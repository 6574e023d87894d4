//! Lateral jerk from the inertial measurement unit.

use core::f64::consts::SQRT_2;

use swerve_core::{Span, Time};
use swerve_geom::math;

/// Corner frequency of the low-pass for the smoothed jerk, Hz: above a driver's steering, below suspension and noise.
pub const CUTOFF_HZ: f64 = 10.0;

/// Second-order Butterworth low-pass, causal (bilinear transform with the corner frequency pre-warped;
/// Oppenheim and Schafer, *Discrete-Time Signal Processing*, 7.1), transposed direct form II.
#[derive(Clone, Debug)]
pub struct LowPass {
    cutoff_hz: f64,
    rate_hz: f64,
    /// Pre-warped corner frequency times half the spacing, rad.
    k: f64,
    b: [f64; 3],
    a: [f64; 2],
    state: [f64; 2],
}

impl LowPass {
    /// Creates a filter in steady state at `value`. `None` unless `0 < cutoff_hz < rate_hz / 2`.
    pub fn new(cutoff_hz: f64, rate_hz: f64, value: f64) -> Option<Self> {
        if !(cutoff_hz > 0.0 && cutoff_hz < 0.5 * rate_hz) {
            return None;
        }
        let k = math::tan(core::f64::consts::PI * cutoff_hz / rate_hz);
        let mut filter = Self::of(cutoff_hz, rate_hz, k);
        let (b, a) = (filter.b, filter.a);
        filter.state = [(b[1] - a[0] + b[2] - a[1]) * value, (b[2] - a[1]) * value];
        Some(filter)
    }

    fn of(cutoff_hz: f64, rate_hz: f64, k: f64) -> Self {
        let scale = 1.0 / (1.0 + SQRT_2 * k + k * k);
        let b0 = k * k * scale;
        let b = [b0, 2.0 * b0, b0];
        let a = [2.0 * (k * k - 1.0) * scale, (1.0 - SQRT_2 * k + k * k) * scale];
        Self { cutoff_hz, rate_hz, k, b, a, state: [0.0; 2] }
    }

    /// Filter at another rate, continued after the sample `x` with the output `y`: the bilinear transform is the
    /// trapezoidal rule, whose state, `y` and its slope, does not depend on the spacing. The corner frequency keeps its
    /// initial pre-warping and so does not change at each step. `None` as for [`new`](Self::new).
    fn at_rate(&self, rate_hz: f64, (x, y): (f64, f64)) -> Option<Self> {
        if self.cutoff_hz >= 0.5 * rate_hz {
            return None;
        }
        let mut other = Self::of(self.cutoff_hz, rate_hz, self.k * self.rate_hz / rate_hz);
        // Half a spacing of the slope is added twice in a step; the rest of a step's sum depends on `x` and `y`.
        let rest = |of: &Self| of.k * of.k * x + (1.0 + SQRT_2 * of.k - of.k * of.k) * y;
        let scale = |of: &Self| 1.0 + SQRT_2 * of.k + of.k * of.k;
        let slope = (self.state[0] * scale(self) - rest(self)) * self.rate_hz;
        other.state = [(slope / rate_hz + rest(&other)) / scale(&other), other.b[2] * x - other.a[1] * y];
        Some(other)
    }

    /// Adds the next sample and returns the next output.
    pub fn next(&mut self, x: f64) -> f64 {
        let y = self.b[0] * x + self.state[0];
        self.state[0] = self.b[1] * x - self.a[0] * y + self.state[1];
        self.state[1] = self.b[2] * x - self.a[1] * y;
        y
    }
}

/// Largest lateral jerk: raw, the difference of two readings over their spacing (as logged by Pylot), and of the
/// readings after a [`LowPass`] at [`CUTOFF_HZ`].
///
/// The filter starts in steady state at the first reading and continues when the spacing of readings changes. Readings
/// slower than twice the cut-off are not filtered, and the filter restarts after them.
#[derive(Clone, Debug, Default)]
pub struct LateralJerk {
    last: Option<Reading>,
    filter: Option<(Span, LowPass)>,
    raw_max: Option<f64>,
    smooth_max: Option<f64>,
}

#[derive(Clone, Copy, Debug)]
struct Reading {
    stamp: Time,
    raw_mps2: f64,
    smooth_mps2: f64,
}

impl LateralJerk {
    /// Adds one reading: lateral specific force at `stamp`, m/s². Ignored unless later than the last one.
    pub fn take(&mut self, stamp: Time, lateral_mps2: f64) {
        let mut smooth_mps2 = lateral_mps2;
        if let Some(last) = self.last {
            let spacing = stamp - last.stamp;
            if spacing <= Span::ZERO {
                return;
            }
            let dt_s = spacing.as_secs();
            let mut before_mps2 = last.smooth_mps2;
            let rate_hz = 1.0 / dt_s;
            self.filter = match self.filter.take() {
                Some((of, filter)) if of == spacing => Some(filter),
                Some((_, filter)) => filter.at_rate(rate_hz, (last.raw_mps2, last.smooth_mps2)),
                None => {
                    before_mps2 = last.raw_mps2;
                    LowPass::new(CUTOFF_HZ, rate_hz, before_mps2)
                }
            }
            .map(|filter| (spacing, filter));
            smooth_mps2 = self.filter.as_mut().map_or(lateral_mps2, |(_, f)| f.next(lateral_mps2));
            raise(&mut self.raw_max, (lateral_mps2 - last.raw_mps2) / dt_s);
            raise(&mut self.smooth_max, (smooth_mps2 - before_mps2) / dt_s);
        }
        self.last = Some(Reading { stamp, raw_mps2: lateral_mps2, smooth_mps2 });
    }

    /// Largest magnitude of the raw difference, m/s³; `None` before two readings.
    pub fn raw_max_mps3(&self) -> Option<f64> {
        self.raw_max
    }

    /// Largest magnitude after the low-pass, m/s³; `None` before two readings.
    pub fn smooth_max_mps3(&self) -> Option<f64> {
        self.smooth_max
    }
}

fn raise(max: &mut Option<f64>, jerk: f64) {
    *max = Some(max.map_or(jerk.abs(), |m| m.max(jerk.abs())));
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Deserialize)]
    struct Oracle {
        input: Vec<f64>,
        output: Vec<f64>,
        raw_jerk_max: f64,
        smooth_jerk_max: f64,
    }

    fn oracle() -> Oracle {
        serde_json::from_str(include_str!("../tests/data/lowpass.json")).unwrap()
    }

    #[test]
    fn low_pass_matches_scipys_butterworth() {
        let o = oracle();
        let mut filter = LowPass::new(CUTOFF_HZ, 100.0, o.input[0]).unwrap();
        for (k, (x, y)) in o.input.iter().zip(&o.output).enumerate() {
            assert!((filter.next(*x) - y).abs() < 1e-12, "sample {k}");
        }
    }

    #[test]
    fn jerk_matches_numpy() {
        let o = oracle();
        let mut jerk = LateralJerk::default();
        for (k, x) in o.input.iter().enumerate() {
            jerk.take(Time::from_ms(10 * k as i64), *x);
        }
        assert!((jerk.raw_max_mps3().unwrap() - o.raw_jerk_max).abs() < 1e-9);
        assert!((jerk.smooth_max_mps3().unwrap() - o.smooth_jerk_max).abs() < 1e-9);
    }

    #[test]
    fn jerk_of_a_ramp_is_its_slope() {
        let mut jerk = LateralJerk::default();
        for k in 0..200_i64 {
            jerk.take(Time::from_ms(10 * k), 0.04 * k as f64);
        }
        assert!((jerk.raw_max_mps3().unwrap() - 4.0).abs() < 1e-9);
        let smooth = jerk.smooth_max_mps3().unwrap();
        assert!(smooth > 4.0 && smooth < 4.0 * 1.05, "a slight overshoot of the filter: {smooth}");
    }

    /// Successive spacings of readings, ms: a period and simulation steps that are not multiples of each other.
    const SPACINGS_MS: [&[i64]; 5] = [&[10], &[8, 12], &[7, 14, 7], &[5, 10], &[10, 10, 10, 20]];

    #[test]
    fn smoothed_jerk_is_independent_of_uneven_spacing() {
        let (amplitude, rate) = (2.0, 2.0 * core::f64::consts::PI * 1.5);
        // Harmonic motion far below the cut-off; gain of the Butterworth filter, 1 / sqrt(1 + (f / fc)^4).
        let expected = amplitude * rate / (1.0 + (1.5 / CUTOFF_HZ).powi(4)).sqrt();
        for spacings in SPACINGS_MS {
            let (mut jerk, mut ms) = (LateralJerk::default(), 0);
            for spacing in spacings.iter().cycle().take(300) {
                let t = Time::from_ms(ms);
                jerk.take(t, amplitude * (1.0 - math::cos(rate * t.as_secs())));
                ms += spacing;
            }
            let smooth = jerk.smooth_max_mps3().unwrap();
            assert!((smooth / expected - 1.0).abs() < 0.02, "{spacings:?}: {smooth}, expected {expected}");
        }
    }

    #[test]
    fn filter_state_is_kept_at_another_rate() {
        let mut filter = LowPass::new(CUTOFF_HZ, 100.0, 1.0).unwrap();
        let x = 3.0;
        let y = filter.next(x);
        let twice = filter.at_rate(73.0, (x, y)).unwrap().at_rate(100.0, (x, y)).unwrap();
        assert!(filter.state.iter().zip(twice.state).all(|(a, b)| (a - b).abs() < 1e-12));
        let settled = LowPass::new(CUTOFF_HZ, 100.0, 4.0).unwrap().at_rate(250.0, (4.0, 4.0));
        assert!((settled.unwrap().next(4.0) - 4.0).abs() < 1e-12);
    }

    #[test]
    fn slow_readings_pass_unfiltered_and_gaps_cause_no_jerk() {
        let mut slow = LateralJerk::default();
        [0.0, 1.0, 0.0].iter().enumerate().for_each(|(k, x)| slow.take(Time::from_ms(100 * k as i64), *x));
        assert_eq!(slow.raw_max_mps3(), slow.smooth_max_mps3());
        let mut gap = LateralJerk::default();
        for (ms, x) in [(0, 0.0), (10, 0.0), (30, 0.0), (40, 0.0), (40, 9.0), (35, 9.0)] {
            gap.take(Time::from_ms(ms), x);
        }
        assert_eq!((gap.raw_max_mps3(), gap.smooth_max_mps3()), (Some(0.0), Some(0.0)));
    }

    #[test]
    fn cut_off_beyond_half_the_rate_is_refused() {
        assert!(LowPass::new(50.0, 100.0, 0.0).is_none());
        assert!(LowPass::new(0.0, 100.0, 0.0).is_none());
        assert!(LowPass::new(f64::NAN, 100.0, 0.0).is_none());
    }
}
