//! Training of the score's trees by gradient boosting (Friedman 2001, algorithm 5: two classes, logistic loss, with
//! Newton steps in the leaves as in Chen and Guestrin 2016).
//!
//! Deterministic for the same samples in the same order: sums follow the order of the samples; ties go to the lower
//! feature, then the lower threshold.

use swerve_geom::math;

use super::score::{Ensemble, FEATURES, LEAVES, SPLITS, Tree};

/// Training candidate.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sample {
    /// Features of the candidate.
    pub features: [f32; FEATURES],
    /// Label, 0 to 1; fractions for partial matches.
    pub truth: f32,
}

/// Parameters of the boosting.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Recipe {
    /// Number of trees.
    pub trees: usize,
    /// Learning rate: share of each tree's Newton step.
    pub rate: f64,
    /// Smallest sum of second derivatives of the loss in a leaf; larger values require more samples.
    pub weight_min: f64,
}

impl Default for Recipe {
    fn default() -> Self {
        Self { trees: 80, rate: 0.15, weight_min: 3.0 }
    }
}

/// Largest number of thresholds tried per feature.
const THRESHOLDS: usize = 48;
/// Regularisation added to the weight of a leaf.
const RIDGE: f64 = 1.0;

/// Trains an ensemble on samples.
pub fn boost(samples: &[Sample], recipe: Recipe) -> Ensemble {
    let total: f64 = samples.iter().map(|sample| f64::from(sample.truth)).sum();
    let share = (total / samples.len().max(1) as f64).clamp(1e-3, 1.0 - 1e-3);
    let mut ensemble = Ensemble { bias: math::ln(share / (1.0 - share)) as f32, trees: Vec::new() };
    let thresholds = thresholds(samples);
    let bins: Vec<[u8; FEATURES]> = samples.iter().map(|sample| binned(sample, &thresholds)).collect();
    let mut sums = vec![f64::from(ensemble.bias); samples.len()];
    let mut slopes = vec![[0.0; 2]; samples.len()];
    for _ in 0..recipe.trees {
        for ((slope, sum), sample) in slopes.iter_mut().zip(&sums).zip(samples) {
            let score = 1.0 / (1.0 + math::exp(-sum));
            *slope = [f64::from(sample.truth) - score, score * (1.0 - score)];
        }
        let tree = grow(&bins, &slopes, &thresholds, recipe);
        for (sum, sample) in sums.iter_mut().zip(samples) {
            *sum += f64::from(tree.leaves[tree.leaf(&sample.features)]);
        }
        ensemble.trees.push(tree);
    }
    ensemble
}

/// Thresholds of each feature: quantiles.
fn thresholds(samples: &[Sample]) -> Vec<Vec<f32>> {
    let of = |feature: usize| {
        let mut values: Vec<f32> = samples.iter().map(|sample| sample.features[feature]).collect();
        values.sort_by(f32::total_cmp);
        let at = |k: usize| values.get(k * values.len() / (THRESHOLDS + 1)).copied();
        let mut chosen: Vec<f32> = (1..=THRESHOLDS).filter_map(at).collect();
        chosen.dedup();
        chosen
    };
    (0..FEATURES).map(of).collect()
}

/// Bin of each feature: the number of thresholds that a sample is not below.
fn binned(sample: &Sample, thresholds: &[Vec<f32>]) -> [u8; FEATURES] {
    core::array::from_fn(|f| thresholds[f].partition_point(|t| sample.features[f] >= *t) as u8)
}

/// Grows a complete tree from the best splits; without a gain, all samples go left.
fn grow(bins: &[[u8; FEATURES]], slopes: &[[f64; 2]], thresholds: &[Vec<f32>], recipe: Recipe) -> Tree {
    let mut tree = Tree { splits: [(0, f32::MAX); SPLITS], leaves: [0.0; LEAVES] };
    let mut at = vec![0_usize; bins.len()];
    for (level, first) in [0, 1, 3].into_iter().enumerate() {
        let chosen: Vec<Option<(usize, usize)>> = (first..first + (1 << level))
            .map(|node| best_split(bins, slopes, thresholds, recipe, |k| at[k] == node))
            .collect();
        for (node, split) in chosen.iter().enumerate() {
            if let Some((feature, threshold)) = *split {
                tree.splits[first + node] = (feature as u8, thresholds[feature][threshold]);
            }
        }
        for (node, bins) in at.iter_mut().zip(bins) {
            let right = chosen[*node - first].is_some_and(|(f, t)| usize::from(bins[f]) > t);
            *node = 2 * *node + if right { 2 } else { 1 };
        }
    }
    let mut sums = [[0.0; 2]; LEAVES];
    for (node, slope) in at.iter().zip(slopes) {
        let sum = &mut sums[node - SPLITS];
        *sum = [sum[0] + slope[0], sum[1] + slope[1]];
    }
    tree.leaves = sums.map(|[slope, weight]| (recipe.rate * slope / (weight + RIDGE)) as f32);
    tree
}

/// Feature and threshold with the largest gain for the samples of a node.
fn best_split(
    bins: &[[u8; FEATURES]],
    slopes: &[[f64; 2]],
    thresholds: &[Vec<f32>],
    recipe: Recipe,
    is_here: impl Fn(usize) -> bool,
) -> Option<(usize, usize)> {
    let mut sums = vec![[[0.0; 2]; THRESHOLDS + 1]; FEATURES];
    let mut all = [0.0; 2];
    for (_, (bins, slope)) in bins.iter().zip(slopes).enumerate().filter(|(k, _)| is_here(*k)) {
        all = [all[0] + slope[0], all[1] + slope[1]];
        for (sums, bin) in sums.iter_mut().zip(bins) {
            let sum = &mut sums[usize::from(*bin)];
            *sum = [sum[0] + slope[0], sum[1] + slope[1]];
        }
    }
    let gain = |[slope, weight]: [f64; 2]| slope * slope / (weight + RIDGE);
    let mut best = (1e-9, None);
    for (feature, sums) in sums.iter().enumerate() {
        let mut left = [0.0; 2];
        for (threshold, sum) in sums.iter().enumerate().take(thresholds[feature].len()) {
            left = [left[0] + sum[0], left[1] + sum[1]];
            let right = [all[0] - left[0], all[1] - left[1]];
            let gained = gain(left) + gain(right) - gain(all);
            if left[1].min(right[1]) >= recipe.weight_min && gained > best.0 {
                best = (gained, Some((feature, threshold)));
            }
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_core::Rng;

    #[test]
    fn boosting_learns_an_interaction_of_two_features() {
        let mut rng = Rng::keyed(1, "boost", &[]);
        let mut draw = || {
            let features: [f32; FEATURES] = core::array::from_fn(|_| rng.uniform(0.0, 1.0) as f32);
            let (a, b) = (features[0], features[1]);
            Sample { features, truth: f32::from((a > 0.5) != (b > 0.3)) }
        };
        let [learned, fresh] = [2000, 500].map(|count| (0..count).map(|_| draw()).collect::<Vec<_>>());
        let ensemble = boost(&learned, Recipe::default());
        let right = |sample: &&Sample| (ensemble.score(&sample.features) > 0.5) == (sample.truth > 0.5);
        assert!(fresh.iter().filter(right).count() >= 480);
        assert_eq!(boost(&learned, Recipe::default()), ensemble);
    }

    #[test]
    fn boosting_without_samples_or_differences_has_no_effect() {
        let empty = boost(&[], Recipe::default());
        let one = boost(&[Sample { features: [1.0; FEATURES], truth: 0.0 }; 50], Recipe::default());
        for ensemble in [empty, one] {
            assert!(ensemble.score(&[1.0; FEATURES]) < 0.01, "{ensemble:?}");
        }
    }
}
