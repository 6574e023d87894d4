//! Whether what is said to hold nine times of ten does, and how to make it so while predictions go on.

use serde::Serialize;
use swerve_geom::{Point2, math};

use super::Gaussian;

/// Shares of the cases that regions are stated for.
pub const LEVELS: [f64; 4] = [0.5, 0.8, 0.9, 0.95];

/// How often what happened was within the region that is stated for it, at each of [`LEVELS`].
///
/// The region is the ellipse of the mixture's mean and covariance, which for one normal distribution is the smallest.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize)]
pub struct Coverage {
    cases: usize,
    within: [usize; 4],
    areas_m2: [f64; 4],
}

/// Squared deviations that hold a share of a normal distribution on the ground: chi-square with two degrees of freedom.
fn squared_within(share: f64) -> f64 {
    -2.0 * math::ln(1.0 - share)
}

impl Coverage {
    /// One more case.
    pub fn add(&mut self, stated: &Gaussian, place: Point2) {
        self.cases += 1;
        let squared = stated.mahalanobis_squared(place);
        for (k, level) in LEVELS.into_iter().enumerate() {
            let limit = squared_within(level);
            self.within[k] += usize::from(squared <= limit);
            self.areas_m2[k] += core::f64::consts::PI * limit * stated.determinant().sqrt();
        }
    }

    /// Takes in another's cases.
    pub fn join(&mut self, other: &Self) {
        self.cases += other.cases;
        self.within.iter_mut().zip(other.within).for_each(|(sum, one)| *sum += one);
        self.areas_m2.iter_mut().zip(other.areas_m2).for_each(|(sum, one)| *sum += one);
    }

    /// Share of cases within, at each of [`LEVELS`]; none before there is a case.
    pub fn shares(&self) -> Option<[f64; 4]> {
        (self.cases > 0).then(|| self.within.map(|n| n as f64 / self.cases as f64))
    }

    /// Mean area of the regions, m²: the smaller the sharper.
    pub fn areas_m2(&self) -> Option<[f64; 4]> {
        (self.cases > 0).then(|| self.areas_m2.map(|sum| sum / self.cases as f64))
    }
}

/// A region's size learnt from how the last predictions did (adaptive conformal inference: Gibbs and Candès 2021).
///
/// The region holds the quantile of the last scores, at a share that moves up after each miss and down after each hit, so
/// that in the long run the stated share is held whatever the errors do.
#[derive(Clone, PartialEq, Debug)]
pub struct Recalibration {
    share: f64,
    rate: f64,
    /// The share that is aimed at now.
    aimed: f64,
    /// Newest last.
    recent: std::collections::VecDeque<f64>,
}

/// Scores that are kept.
const RECENT_MAX: usize = 500;

impl Recalibration {
    /// For regions that hold `share` of the cases; `rate` is how fast a miss is answered, 0.01 to 0.05 as a rule.
    pub fn new(share: f64, rate: f64) -> Self {
        Self { share, rate, aimed: share, recent: std::collections::VecDeque::new() }
    }

    /// Squared deviations that the next region holds: the normal distribution's before there are twenty scores.
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

    /// Takes in what a prediction's score came to (Mahalanobis, squared), and whether its region held it.
    pub fn learn(&mut self, squared: f64, held: bool) {
        let missed = f64::from(u8::from(!held));
        self.aimed += self.rate * (missed - (1.0 - self.share));
        if self.recent.len() == RECENT_MAX {
            self.recent.pop_front();
        }
        self.recent.push_back(if squared.is_finite() { squared } else { f64::MAX });
    }
}
