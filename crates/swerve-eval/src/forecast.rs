//! Metrics of motion prediction: displacement errors of the best of several modes, joint over actors, likelihoods, and
//! calibration of the predicted spread.
//!
//! Distances as in Argoverse 2's evaluation (`av2.datasets.motion_forecasting.eval.metrics`); other definitions are
//! noted at the field.

mod calibration;

use serde::Serialize;
use swerve_geom::{Obb, Point2, math};

pub use calibration::{Coverage, LEVELS, Recalibration};

/// Final distance above which a prediction is a miss, metres (Argoverse 1 and 2).
pub const MISS_M: f64 = 2.0;

/// Position at one instant as a normal distribution on the ground.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Gaussian {
    /// Weight in a mixture, 0 to 1.
    pub weight: f64,
    /// Mean.
    pub mean: Point2,
    /// Covariance: xx, xy, yy, m².
    pub covariance_m2: [f64; 3],
}

/// Errors of one mode.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize)]
pub struct ModeErrors {
    /// Probability of the mode, 0 to 1.
    pub probability: f64,
    /// Mean distance over all instants, metres.
    pub ade_m: f64,
    /// Distance at the last instant, metres.
    pub fde_m: f64,
    /// Largest distance, metres.
    pub largest_m: f64,
}

impl ModeErrors {
    /// Errors of a path with as many points as `truth`; `None` without points.
    pub fn of(probability: f64, path: &[Point2], truth: &[Point2]) -> Option<Self> {
        let distances = path.iter().zip(truth).map(|(p, g)| p.distance(*g));
        let fde_m = distances.clone().next_back()?;
        let largest_m = distances.clone().fold(0.0, f64::max);
        let ade_m = distances.sum::<f64>() / path.len().min(truth.len()) as f64;
        Some(Self { probability, ade_m, fde_m, largest_m })
    }

    /// Final distance plus the squared complement of the probability, as in the Brier score.
    pub fn brier_fde_m(&self) -> f64 {
        let lacks = 1.0 - self.probability;
        self.fde_m + lacks * lacks
    }

    /// True if the final distance exceeds [`MISS_M`].
    pub fn missed(&self) -> bool {
        self.fde_m > MISS_M
    }
}

/// Probabilities of the joint modes of a scene: the product of the actors' probabilities, normalized. `actors[m][k]`,
/// with equal numbers of modes.
///
/// The actors' probabilities are assumed to rest on independent evidence, so that logarithms add up.
pub fn joint_probabilities(actors: &[Vec<ModeErrors>]) -> Vec<f64> {
    let modes = actors.iter().map(Vec::len).min().unwrap_or(0);
    let sum = |k: usize| actors.iter().map(|modes| math::ln(modes[k].probability.max(1e-12))).sum::<f64>();
    let sums: Vec<f64> = (0..modes).map(sum).collect();
    let largest = sums.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let shares: Vec<f64> = sums.iter().map(|sum| math::exp(sum - largest)).collect();
    let total = shares.iter().sum::<f64>();
    shares.into_iter().map(|share| share / total).collect()
}

/// Errors of the joint modes of all actors: means over actors. `actors[m][k]`, with equal numbers of modes;
/// `probabilities[k]` of the scene.
pub fn joint(actors: &[Vec<ModeErrors>], probabilities: &[f64]) -> Vec<ModeErrors> {
    let modes = actors.iter().map(Vec::len).min().unwrap_or(0).min(probabilities.len());
    let mean = |k: usize, of: fn(&ModeErrors) -> f64| {
        actors.iter().map(|modes| of(&modes[k])).sum::<f64>() / actors.len() as f64
    };
    let mode = |k: usize| ModeErrors {
        probability: probabilities[k],
        ade_m: mean(k, |mode| mode.ade_m),
        fde_m: mean(k, |mode| mode.fde_m),
        largest_m: actors.iter().map(|modes| modes[k].largest_m).fold(0.0, f64::max),
    };
    (0..modes).map(mode).collect()
}

/// Errors of the best of the `K` most probable modes.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize)]
pub struct BestOf {
    /// Mean distance of the most probable mode, metres.
    pub ade_m: f64,
    /// Final distance of the most probable mode, metres.
    pub fde_m: f64,
    /// Smallest mean distance, metres (nuScenes, Waymo).
    pub min_ade_m: f64,
    /// Smallest final distance, metres.
    pub min_fde_m: f64,
    /// Mean distance of the mode with the smallest final distance, metres (Argoverse 1).
    pub ade_of_min_fde_m: f64,
    /// Final distance of that mode plus the Brier score of its probability (Argoverse 2).
    pub brier_min_fde_m: f64,
    /// Final distance of that mode minus the logarithm of its probability, limited to that of 1/20 (Argoverse 1's
    /// p-minFDE).
    pub p_min_fde_m: f64,
    /// True if the final distance of every mode exceeds [`MISS_M`].
    pub missed: bool,
    /// True if every mode is at least [`MISS_M`] off at some instant (nuScenes).
    pub missed_anywhere: bool,
}

impl BestOf {
    /// Errors of the best of the `k` most probable modes; of equals the first. `None` without modes.
    pub fn of(modes: &[ModeErrors], k: usize) -> Option<Self> {
        let mut order: Vec<_> = modes.iter().collect();
        order.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        order.truncate(k);
        let likeliest = order.first()?;
        let nearest = order.iter().min_by(|a, b| a.fde_m.total_cmp(&b.fde_m))?;
        Some(Self {
            ade_m: likeliest.ade_m,
            fde_m: likeliest.fde_m,
            min_ade_m: order.iter().map(|mode| mode.ade_m).fold(f64::INFINITY, f64::min),
            min_fde_m: nearest.fde_m,
            ade_of_min_fde_m: nearest.ade_m,
            brier_min_fde_m: nearest.brier_fde_m(),
            p_min_fde_m: nearest.fde_m - math::ln(nearest.probability.max(0.05)),
            missed: order.iter().all(|mode| mode.missed()),
            missed_anywhere: order.iter().all(|mode| mode.largest_m >= MISS_M),
        })
    }
}

impl Gaussian {
    fn determinant(&self) -> f64 {
        let [xx, xy, yy] = self.covariance_m2;
        xx * yy - xy * xy
    }

    /// Squared Mahalanobis distance of `point` from the mean.
    pub fn mahalanobis_squared(&self, point: Point2) -> f64 {
        let ([xx, xy, yy], off) = (self.covariance_m2, point - self.mean);
        (yy * off.x * off.x - 2.0 * xy * off.x * off.y + xx * off.y * off.y) / self.determinant()
    }

    /// Logarithm of weight times density, nats, with metres.
    fn ln_density(&self, point: Point2) -> f64 {
        let ln_norm = math::ln(core::f64::consts::TAU) + 0.5 * math::ln(self.determinant());
        math::ln(self.weight) - 0.5 * self.mahalanobis_squared(point) - ln_norm
    }

    /// Normal distribution with the mean and covariance of a mixture; `None` for an empty one.
    pub fn of_mixture(parts: &[Self]) -> Option<Self> {
        let weight = parts.iter().map(|part| part.weight).sum::<f64>();
        let mean_of =
            |of: &dyn Fn(&Self) -> f64| parts.iter().map(|part| part.weight * of(part)).sum::<f64>() / weight;
        let mean = Point2::new(mean_of(&|part| part.mean.x_m), mean_of(&|part| part.mean.y_m));
        let covariance_m2 = [0, 1, 2].map(|k| {
            mean_of(&|part| {
                let off = part.mean - mean;
                part.covariance_m2[k] + [off.x * off.x, off.x * off.y, off.y * off.y][k]
            })
        });
        (weight > 0.0).then_some(Self { weight, mean, covariance_m2 })
    }
}

/// Negative log-likelihood of a position under a mixture, nats, with metres. Infinite for an empty mixture.
pub fn nll(mixture: &[Gaussian], place: Point2) -> f64 {
    let parts = mixture.iter().map(|part| part.ln_density(place));
    let largest = parts.clone().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return f64::INFINITY;
    }
    -largest - math::ln(parts.map(|part| math::exp(part - largest)).sum())
}

/// True if two outlines overlap at any common instant.
pub fn collide(a: &[Obb], b: &[Obb]) -> bool {
    a.iter().zip(b).any(|(a, b)| a.overlaps(b))
}

#[cfg(test)]
mod tests;
