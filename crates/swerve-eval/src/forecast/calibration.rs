//! Coverage of predicted regions, and their online recalibration.

use serde::Serialize;
use swerve_geom::{Point2, math};

use super::Gaussian;

/// Nominal shares of the cases in the regions.
pub const LEVELS: [f64; 4] = [0.5, 0.8, 0.9, 0.95];

/// Empirical coverage of the regions at each of [`LEVELS`].
///
/// The region is the ellipse of the mixture's mean and covariance, which for one normal distribution is the smallest.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize)]
pub struct Coverage {
    cases: usize,
    within: [usize; 4],
    areas_m2: [f64; 4],
}

/// Squared Mahalanobis distance that contains a share of a 2D normal distribution: chi-square with two degrees of
/// freedom.
fn squared_within(share: f64) -> f64 {
    -2.0 * math::ln(1.0 - share)
}

impl Coverage {
    /// Adds one case.
    pub fn add(&mut self, stated: &Gaussian, place: Point2) {
        self.cases += 1;
        let squared = stated.mahalanobis_squared(place);
        for (k, level) in LEVELS.into_iter().enumerate() {
            let limit = squared_within(level);
            self.within[k] += usize::from(squared <= limit);
            self.areas_m2[k] += core::f64::consts::PI * limit * stated.determinant().sqrt();
        }
    }

    /// Adds the cases of another.
    pub fn join(&mut self, other: &Self) {
        self.cases += other.cases;
        self.within.iter_mut().zip(other.within).for_each(|(sum, one)| *sum += one);
        self.areas_m2.iter_mut().zip(other.areas_m2).for_each(|(sum, one)| *sum += one);
    }

    /// Share of cases inside, at each of [`LEVELS`]; `None` without cases.
    pub fn shares(&self) -> Option<[f64; 4]> {
        (self.cases > 0).then(|| self.within.map(|n| n as f64 / self.cases as f64))
    }

    /// Mean area of the regions, m²; smaller is sharper.
    pub fn areas_m2(&self) -> Option<[f64; 4]> {
        (self.cases > 0).then(|| self.areas_m2.map(|sum| sum / self.cases as f64))
    }
}

/// Region size adapted to the errors of recent predictions (adaptive conformal inference: Gibbs and Candès 2021).
///
/// The region is the quantile of recent scores at a share that increases after each miss and decreases after each hit,
/// so that the nominal share is met in the long run for any errors.
#[derive(Clone, PartialEq, Debug)]
pub struct Recalibration {
    share: f64,
    rate: f64,
    /// Current target share.
    aimed: f64,
    /// Recent scores, newest last.
    recent: std::collections::VecDeque<f64>,
}

/// Maximum number of scores kept.
const RECENT_MAX: usize = 500;

impl Recalibration {
    /// Creates a recalibration for regions that contain `share` of the cases. `rate` is the step size of the
    /// adaptation, usually 0.01 to 0.05.
    pub fn new(share: f64, rate: f64) -> Self {
        Self { share, rate, aimed: share, recent: std::collections::VecDeque::new() }
    }

    /// Squared Mahalanobis distance of the next region: the normal distribution's until there are twenty scores.
    pub fn squared(&self) -> f64 {
        if self.aimed >= 1.0 {
            return f64::INFINITY;
        }
        if self.recent.len() < 20 {
            return squared_within(self.share);
        }
        let mut sorted: Vec<f64> = self.recent.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        let rank = (self.aimed.max(0.0) * (sorted.len() + 1) as f64).ceil() as usize;
        sorted.get(rank.max(1) - 1).copied().unwrap_or(f64::INFINITY)
    }

    /// Adds the score of a prediction (squared Mahalanobis distance), and true if its region contained the outcome.
    pub fn learn(&mut self, squared: f64, held: bool) {
        let missed = f64::from(u8::from(!held));
        self.aimed += self.rate * (missed - (1.0 - self.share));
        if self.recent.len() == RECENT_MAX {
            self.recent.pop_front();
        }
        self.recent.push_back(if squared.is_finite() { squared } else { f64::MAX });
    }
}
