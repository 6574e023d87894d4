//! Training of linear support vector machines.
//!
//! Dual coordinate descent (Hsieh, Chang, Lin, Keerthi, Sundararajan: "A dual coordinate descent method for large-scale
//! linear SVM", ICML 2008, algorithm 1) for the hinge loss or its square; the offset is the weight of an additional
//! constant feature of 1.

use swerve_core::Rng;

/// Training parameters.
#[derive(Clone, PartialEq, Debug)]
pub struct SvmParams {
    /// Cost of a margin violation relative to the regularisation term (half the squared norm of the weights).
    pub cost: f64,
    /// True for the squared hinge loss.
    pub squared: bool,
    /// Largest number of passes over all samples.
    pub passes: usize,
    /// Spread of the projected gradient at which training stops.
    pub tolerance: f64,
    /// Seed of the order of samples.
    pub seed: u64,
}

impl Default for SvmParams {
    fn default() -> Self {
        Self { cost: 0.01, squared: false, passes: 1000, tolerance: 0.01, seed: 1 }
    }
}

/// Linear classifier; scores above zero are positive.
#[derive(Clone, PartialEq, Debug)]
pub struct Linear {
    /// Weight of each feature.
    pub weights: Vec<f64>,
    /// Added to the weighted sum.
    pub offset: f64,
}

impl Linear {
    /// Score of a sample.
    pub fn score(&self, sample: &[f32]) -> f64 {
        dot(&self.weights, sample) + self.offset
    }
}

fn dot(weights: &[f64], sample: &[f32]) -> f64 {
    weights.iter().zip(sample).map(|(weight, value)| weight * f64::from(*value)).sum()
}

/// Trains on samples of `features` values each and their labels. All weights are zero without samples.
pub fn train(features: usize, samples: &[f32], positive: &[bool], params: &SvmParams) -> Linear {
    let mut linear = Linear { weights: vec![0.0; features], offset: 0.0 };
    let rows: Vec<&[f32]> = samples.chunks_exact(features.max(1)).zip(positive).map(|(row, _)| row).collect();
    let (most, diagonal) =
        if params.squared { (f64::INFINITY, 0.5 / params.cost) } else { (params.cost, 0.0) };
    let square =
        |row: &&[f32]| row.iter().map(|x| f64::from(*x) * f64::from(*x)).sum::<f64>() + 1.0 + diagonal;
    let squares: Vec<f64> = rows.iter().map(square).collect();
    let (mut alphas, mut order) = (vec![0.0; rows.len()], (0..rows.len()).collect::<Vec<_>>());
    let mut rng = Rng::keyed(params.seed, "order", &[]);
    for _ in 0..params.passes {
        for k in (1..order.len()).rev() {
            order.swap(k, rng.below(k + 1));
        }
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for &k in &order {
            let (row, sign) = (rows[k], if positive[k] { 1.0 } else { -1.0 });
            let gradient = sign * linear.score(row) - 1.0 + diagonal * alphas[k];
            let projected = if alphas[k] <= 0.0 {
                gradient.min(0.0)
            } else if alphas[k] >= most {
                gradient.max(0.0)
            } else {
                gradient
            };
            (low, high) = (low.min(projected), high.max(projected));
            if projected == 0.0 {
                continue;
            }
            let alpha = (alphas[k] - gradient / squares[k]).clamp(0.0, most);
            let step = (alpha - alphas[k]) * sign;
            alphas[k] = alpha;
            linear.weights.iter_mut().zip(row).for_each(|(weight, x)| *weight += step * f64::from(*x));
            linear.offset += step;
        }
        if high - low <= params.tolerance {
            break;
        }
    }
    linear
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two clouds of three features; every tenth sample is mislabelled.
    fn clouds(count: usize) -> (Vec<f32>, Vec<bool>) {
        let mut rng = Rng::keyed(7, "clouds", &[]);
        let (mut samples, mut positive) = (Vec::new(), Vec::new());
        for k in 0..count {
            let kind = k % 2 == 0;
            let side = if kind != (k % 10 == 0) { 1.0 } else { -1.0 };
            samples.extend([side + rng.normal(), 0.5 * side + rng.normal(), rng.normal()].map(|x| x as f32));
            positive.push(kind);
        }
        (samples, positive)
    }

    /// Primal objective: half the squared norm of all weights plus the cost of the samples.
    fn objective(linear: &Linear, samples: &[f32], positive: &[bool], params: &SvmParams) -> f64 {
        let own: f64 = linear.weights.iter().chain([&linear.offset]).map(|w| 0.5 * w * w).sum();
        let wrong = |(row, positive): (&[f32], &bool)| {
            let short = (1.0 - if *positive { 1.0 } else { -1.0 } * linear.score(row)).max(0.0);
            params.cost * if params.squared { short * short } else { short }
        };
        own + samples.chunks_exact(3).zip(positive).map(wrong).sum::<f64>()
    }

    #[test]
    fn training_ends_at_the_optimum() {
        let (samples, positive) = clouds(400);
        for squared in [false, true] {
            let params = SvmParams { cost: 0.1, squared, tolerance: 1e-8, passes: 5000, seed: 1 };
            let linear = train(3, &samples, &positive, &params);
            let best = objective(&linear, &samples, &positive, &params);
            for k in 0..8 {
                let mut other = linear.clone();
                let step = if k % 2 == 0 { 1e-3 } else { -1e-3 };
                if k < 6 {
                    other.weights[k / 2] += step
                } else {
                    other.offset += step
                }
                assert!(objective(&other, &samples, &positive, &params) > best - 1e-9, "{squared} {k}");
            }
        }
    }

    #[test]
    fn training_is_independent_of_the_sample_order() {
        let (samples, positive) = clouds(300);
        let of = |seed| {
            train(
                3,
                &samples,
                &positive,
                &SvmParams { cost: 0.1, tolerance: 1e-9, passes: 20000, seed, ..SvmParams::default() },
            )
        };
        let (one, other) = (of(1), of(2));
        for (a, b) in one.weights.iter().zip(&other.weights) {
            assert!((a - b).abs() < 1e-5, "{a} {b}");
        }
        assert_eq!(of(1), one);
    }

    #[test]
    fn training_without_samples_gives_zero_weights() {
        assert_eq!(train(2, &[], &[], &SvmParams::default()), Linear { weights: vec![0.0; 2], offset: 0.0 });
    }
}
