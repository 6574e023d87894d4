//! Comfort, as defined by nuPlan's metrics (`ego_is_comfortable` of nuplan-devkit e924167).
//!
//! States are sampled every 100 ms, as in nuPlan's simulation. Each series is smoothed with a Savitzky-Golay filter
//! (Analytical Chemistry 36, 1964; at the ends, the polynomial of the first and last window): accelerations with 8
//! samples and order 2, jerk from these with 15 and 2, yaw rate with 5 and 2, yaw acceleration with 5 and 3.

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_geom::{angle_between, math};
use swerve_msg::EgoState;

/// Sampling interval.
const PERIOD: Span = Span::from_ms(100);
const PERIOD_S: f64 = 0.1;

/// Comfort limits: nuPlan's thresholds.
pub mod limits {
    /// Longitudinal acceleration, minimum and maximum, m/s².
    pub const LON_ACCEL: [f64; 2] = [-4.05, 2.40];
    /// Lateral acceleration, absolute, m/s².
    pub const LAT_ACCEL: f64 = 4.89;
    /// Longitudinal jerk, absolute, m/s³.
    pub const LON_JERK: f64 = 4.13;
    /// Magnitude of the jerk, m/s³.
    pub const JERK: f64 = 8.37;
    /// Yaw rate, rad/s.
    pub const YAW_RATE: f64 = 0.95;
    /// Yaw acceleration, rad/s².
    pub const YAW_ACCEL: f64 = 1.93;
}

/// Comfort of a drive, until its first contact.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ComfortMetrics {
    /// Share of the samples at which all quantities are within nuPlan's limits, 0 to 1.
    pub share_within: f64,
    /// Minimum longitudinal acceleration, m/s² (negative when braking).
    pub lon_accel_min: f64,
    /// Maximum longitudinal acceleration, m/s².
    pub lon_accel_max: f64,
    /// Maximum absolute lateral acceleration, m/s².
    pub lat_accel_max: f64,
    /// Maximum absolute longitudinal jerk, m/s³.
    pub lon_jerk_max: f64,
    /// Maximum rate of change of the acceleration's magnitude, m/s³.
    pub jerk_max: f64,
    /// Maximum absolute yaw rate, rad/s.
    pub yaw_rate_max: f64,
    /// Maximum absolute yaw acceleration, rad/s².
    pub yaw_accel_max: f64,
}

/// Accumulates the states of a drive.
#[derive(Clone, Debug, Default)]
pub(crate) struct Comfort {
    next: Option<Time>,
    along: Vec<f64>,
    across: Vec<f64>,
    /// Unwrapped heading.
    heading: Vec<f64>,
}

impl Comfort {
    /// Adds the next state.
    pub(crate) fn take(&mut self, ego: &EgoState) {
        let next = *self.next.get_or_insert(ego.stamp);
        if ego.stamp >= next {
            self.next = Some(next + PERIOD);
            self.push(ego.accel_mps2, ego.lateral_accel_mps2, ego.pose.heading_rad);
        }
    }

    /// Adds one sample.
    pub(crate) fn push(&mut self, along_mps2: f64, across_mps2: f64, heading_rad: f64) {
        let turned = |before: &f64| before + angle_between(*before, heading_rad);
        self.along.push(along_mps2);
        self.across.push(across_mps2);
        self.heading.push(self.heading.last().map_or(heading_rad, turned));
    }

    /// Metrics; `None` for fewer than four states, too few to fit a polynomial.
    pub(crate) fn metrics(&self) -> Option<ComfortMetrics> {
        let smoothed = self.smoothed()?;
        let Smoothed { along, across, along_jerk, jerk, yaw_rate, yaw_accel } = &smoothed;
        let within = (0..along.len()).filter(|i| smoothed.is_comfortable(*i)).count();
        let largest = |series: &[f64]| series.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        Some(ComfortMetrics {
            share_within: within as f64 / along.len() as f64,
            lon_accel_min: along.iter().copied().fold(f64::INFINITY, f64::min),
            lon_accel_max: along.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            lat_accel_max: largest(across),
            lon_jerk_max: largest(along_jerk),
            jerk_max: largest(jerk),
            yaw_rate_max: largest(yaw_rate),
            yaw_accel_max: largest(yaw_accel),
        })
    }

    /// For each sample, true if all quantities are within nuPlan's limits; `None` as for [`metrics`](Self::metrics).
    pub(crate) fn within(&self) -> Option<Vec<bool>> {
        let smoothed = self.smoothed()?;
        Some((0..smoothed.along.len()).map(|i| smoothed.is_comfortable(i)).collect())
    }

    fn smoothed(&self) -> Option<Smoothed> {
        if self.along.len() < 4 {
            return None;
        }
        let magnitude: Vec<f64> =
            self.along.iter().zip(&self.across).map(|(x, y)| math::hypot(*x, *y)).collect();
        let accel = Filter { window: 8, order: 2, derivative: 0 };
        let jerk = Filter { window: 15, order: 2, derivative: 1 };
        let along = accel.of(&self.along);
        Some(Smoothed {
            across: accel.of(&self.across),
            along_jerk: jerk.of(&along),
            jerk: jerk.of(&accel.of(&magnitude)),
            yaw_rate: Filter { window: 5, order: 2, derivative: 1 }.of(&self.heading),
            yaw_accel: Filter { window: 5, order: 3, derivative: 2 }.of(&self.heading),
            along,
        })
    }
}

/// Smoothed series, with one value per sample.
struct Smoothed {
    along: Vec<f64>,
    across: Vec<f64>,
    along_jerk: Vec<f64>,
    jerk: Vec<f64>,
    yaw_rate: Vec<f64>,
    yaw_accel: Vec<f64>,
}

impl Smoothed {
    /// Returns true if all quantities of a sample are within nuPlan's limits.
    fn is_comfortable(&self, i: usize) -> bool {
        let inside = |x: f64, limit: f64| x.abs() < limit;
        let [low, high] = limits::LON_ACCEL;
        low < self.along[i]
            && self.along[i] < high
            && inside(self.across[i], limits::LAT_ACCEL)
            && inside(self.along_jerk[i], limits::LON_JERK)
            && inside(self.jerk[i], limits::JERK)
            && inside(self.yaw_rate[i], limits::YAW_RATE)
            && inside(self.yaw_accel[i], limits::YAW_ACCEL)
    }
}

/// A Savitzky-Golay filter: at each sample, the value or a derivative of the polynomial fitted to the window.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Filter {
    /// Number of samples.
    pub(crate) window: usize,
    /// Order of the polynomial.
    pub(crate) order: usize,
    /// Order of the derivative; zero for the value.
    pub(crate) derivative: usize,
}

impl Filter {
    /// Filters a series with [`PERIOD_S`] between samples. The window is shortened to the length of a shorter series.
    pub(crate) fn of(self, series: &[f64]) -> Vec<f64> {
        let (n, window) = (series.len(), self.window.min(series.len()));
        let half = window / 2;
        let dot = |weights: &[f64], from: usize| -> f64 {
            weights.iter().zip(&series[from..]).map(|(weight, x)| weight * x).sum()
        };
        // An even window has no centre sample; its polynomial is evaluated at the centre all the same, as in SciPy.
        let before = (window - 1) / 2;
        let inner = self.weights(window, 0.5 * (window - 1) as f64);
        (0..n)
            .map(|i| match i {
                _ if i < half => dot(&self.weights(window, i as f64), 0),
                _ if i + half >= n => dot(&self.weights(window, (i + window - n) as f64), n - window),
                _ => dot(&inner, i - before),
            })
            .collect()
    }

    /// Weights of the samples of a window, for evaluation at `at` samples from its first.
    fn weights(self, window: usize, at: f64) -> Vec<f64> {
        let terms = self.order + 1;
        let middle = 0.5 * (window - 1) as f64;
        let powers = |k: usize| -> Vec<f64> {
            let u = k as f64 - middle;
            (0..terms).scan(1.0, |power, _| Some(core::mem::replace(power, *power * u))).collect()
        };
        let rows: Vec<Vec<f64>> = (0..window).map(powers).collect();
        // Normal equations of the fit, with the derivative at `at` on the right side.
        let mut system: Vec<Vec<f64>> = (0..terms)
            .map(|a| {
                let sums = (0..terms).map(|b| rows.iter().map(|row| row[a] * row[b]).sum());
                sums.chain([self.asked(a, at - middle)]).collect()
            })
            .collect();
        let solved = solve(&mut system);
        rows.iter().map(|row| row.iter().zip(&solved).map(|(x, c)| x * c).sum()).collect()
    }

    /// Derivative of the monomial of power `a` at `u` samples, per second.
    fn asked(self, a: usize, u: f64) -> f64 {
        if a < self.derivative {
            return 0.0;
        }
        let factor: f64 = (0..self.derivative).map(|k| (a - k) as f64 / PERIOD_S).product();
        (self.derivative..a).fold(factor, |value, _| value * u)
    }
}

/// Solves a symmetric positive definite system by elimination, with its right side in the last column.
fn solve(system: &mut [Vec<f64>]) -> Vec<f64> {
    let n = system.len();
    for pivot in 0..n {
        let row = system[pivot].clone();
        for below in system.iter_mut().skip(pivot + 1) {
            let factor = below[pivot] / row[pivot];
            below.iter_mut().zip(&row).skip(pivot).for_each(|(x, above)| *x -= factor * above);
        }
    }
    let mut solved = vec![0.0; n];
    for row in (0..n).rev() {
        let known: f64 = (row + 1..n).map(|column| system[row][column] * solved[column]).sum();
        solved[row] = (system[row][n] - known) / system[row][row];
    }
    solved
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Deserialize)]
    struct Case {
        lon_accel_mps2: Vec<f64>,
        lat_accel_mps2: Vec<f64>,
        heading_rad: Vec<f64>,
        #[serde(flatten)]
        wanted: ComfortMetrics,
    }

    #[test]
    fn comfort_metrics_match_scipys_filter() {
        let text = include_str!("../../../tests/reference/comfort/cases.json");
        let cases: Vec<Case> = serde_json::from_str(text).unwrap();
        assert!(cases.len() > 10);
        for case in cases {
            let mut comfort = Comfort::default();
            for (i, along) in case.lon_accel_mps2.iter().enumerate() {
                comfort.push(*along, case.lat_accel_mps2[i], case.heading_rad[i]);
            }
            let (got, wanted) = (comfort.metrics().unwrap(), case.wanted);
            for (a, b) in [
                (got.share_within, wanted.share_within),
                (got.lon_accel_min, wanted.lon_accel_min),
                (got.lon_accel_max, wanted.lon_accel_max),
                (got.lat_accel_max, wanted.lat_accel_max),
                (got.lon_jerk_max, wanted.lon_jerk_max),
                (got.jerk_max, wanted.jerk_max),
                (got.yaw_rate_max, wanted.yaw_rate_max),
                (got.yaw_accel_max, wanted.yaw_accel_max),
            ] {
                assert!((a - b).abs() < 1e-9, "{a} {b} of {} samples", case.heading_rad.len());
            }
        }
    }

    #[test]
    fn states_are_sampled_every_tenth_of_a_second() {
        let mut comfort = Comfort::default();
        for k in 0..=200 {
            comfort.take(&EgoState { stamp: Time::from_ms(5 * k), accel_mps2: -2.0, ..EgoState::default() });
        }
        assert_eq!(comfort.along.len(), 11);
        let metrics = comfort.metrics().unwrap();
        assert_eq!(metrics.share_within, 1.0);
        assert!((metrics.lon_accel_min + 2.0).abs() < 1e-12 && metrics.jerk_max < 1e-9, "{metrics:?}");
    }
}
