//! Training of boosted trees over byte-valued features.
//!
//! Real AdaBoost (Friedman, Hastie, Tibshirani: "Additive logistic regression", 2000, algorithm 2) over full trees of a
//! fixed depth; each tree is offered a random share of the features and the samples that carry 99 % of the weight
//! (Friedman et al., section 9). Weights and histograms are integers, so the result does not depend on the order of
//! summation; ties go to the lower feature, then the lower threshold.

use swerve_core::Rng;
use swerve_geom::math;

use crate::acf::{Trees, leaf_step};

/// Parameters of tree growing.
#[derive(Clone, PartialEq, Debug)]
pub struct BoostParams {
    /// Levels of nodes, 1 to 6.
    pub depth: usize,
    /// Largest number of trees.
    pub trees: usize,
    /// One of this many features is offered to each tree.
    pub one_of: usize,
    /// Seed of the feature selection.
    pub seed: u64,
}

/// Training samples: one byte per feature, sample by sample.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Samples<'a> {
    /// Features per sample.
    pub features: usize,
    /// Features of the positive samples.
    pub positive: &'a [u8],
    /// Features of the negative samples.
    pub negative: &'a [u8],
}

/// Number of values of a byte.
const BINS: usize = 256;
/// Approximate sum of all weights.
const MASS: f64 = (1_u64 << 30) as f64;
/// Largest magnitude of a leaf.
const LEAF_MAX: f64 = 4.0;
/// Mean loss at which training stops.
const LOSS_MIN: f64 = 1e-40;

/// Trains trees with byte thresholds (a feature below goes left) and leaves in integer units of [`leaf_step`].
///
/// Returns no trees without features or without samples of both kinds.
pub fn boost(samples: Samples<'_>, params: &BoostParams) -> Trees {
    let mut trees = Trees { depth: params.depth, ..Trees::default() };
    let n = samples.features.max(1);
    if samples.positive.len() < n || samples.negative.len() < n {
        return trees;
    }
    let mut state = State::new(samples);
    for tree in 0..params.trees {
        let loss = state.weigh();
        if loss < LOSS_MIN {
            break;
        }
        let mut rng = Rng::keyed(params.seed, "features", &[tree as i64]);
        let offered = offered(&mut rng, n, params.one_of);
        state.grow(&offered, &mut trees);
    }
    trees
}

/// Random selection of one in `one_of` features, in ascending order.
fn offered(rng: &mut Rng, features: usize, one_of: usize) -> Vec<usize> {
    let count = (features / one_of.max(1)).max(1);
    let mut all: Vec<usize> = (0..features).collect();
    for k in 0..count {
        let other = k + rng.below(features - k);
        all.swap(k, other);
    }
    all.truncate(count);
    all.sort_unstable();
    all
}

/// Boosting state of the samples; positives come first.
struct State {
    positives: usize,
    /// Bytes of all samples, feature by feature.
    columns: Vec<Vec<u8>>,
    /// Scores in units of a leaf.
    scores: Vec<i32>,
    weights: Vec<u32>,
    /// Samples used for this tree, in ascending order.
    used: Vec<u32>,
    /// Node of the current level that holds each used sample.
    nodes: Vec<u8>,
}

/// Best split of one node so far.
#[derive(Clone, Copy)]
struct Split {
    cost: f64,
    feature: usize,
    threshold: usize,
}

impl State {
    fn new(samples: Samples<'_>) -> Self {
        let n = samples.features;
        let rows = || samples.positive.chunks_exact(n).chain(samples.negative.chunks_exact(n));
        let count = rows().count();
        Self {
            positives: samples.positive.len() / n,
            columns: (0..n).map(|f| rows().map(|row| row[f]).collect()).collect(),
            scores: vec![0; count],
            weights: vec![0; count],
            used: Vec::new(),
            nodes: Vec::new(),
        }
    }

    /// Sets each sample's weight to its loss, with equal initial weight of both kinds, and drops the lightest samples,
    /// 1 % of the total weight. Returns the mean loss.
    fn weigh(&mut self) -> f64 {
        let count = self.scores.len();
        let share = |k: usize| {
            0.5 / (if k < self.positives { self.positives } else { count - self.positives }) as f64
        };
        let loss = |k: usize| {
            let score = f64::from(self.scores[k]) * f64::from(leaf_step());
            share(k) * math::exp(if k < self.positives { -score } else { score })
        };
        let losses: Vec<f64> = (0..count).map(loss).collect();
        let total: f64 = losses.iter().sum();
        for (weight, loss) in self.weights.iter_mut().zip(&losses) {
            *weight = (loss / total * MASS) as u32;
        }
        let mut order: Vec<u32> = (0..count as u32).collect();
        order.sort_unstable_by_key(|k| (self.weights[*k as usize], *k));
        let mut light = MASS * 0.01;
        let heavy = order.iter().position(|k| {
            light -= f64::from(self.weights[*k as usize]);
            light < 0.0
        });
        self.used.clear();
        self.used.extend_from_slice(&order[heavy.unwrap_or(0)..]);
        self.used.sort_unstable();
        total
    }

    /// Adds a tree and updates the scores.
    fn grow(&mut self, offered: &[usize], trees: &mut Trees) {
        self.nodes.clear();
        self.nodes.resize(self.used.len(), 0);
        let first = trees.features.len();
        for level in 0..trees.depth {
            for split in self.splits(offered, 1 << level) {
                trees.features.push(split.feature as u16);
                trees.thresholds.push(split.threshold as f32);
            }
            let start = first + (1 << level) - 1;
            for (node, k) in self.nodes.iter_mut().zip(&self.used) {
                let split = start + usize::from(*node);
                let byte = self.columns[usize::from(trees.features[split])][*k as usize];
                *node = 2 * *node + u8::from(f32::from(byte) >= trees.thresholds[split]);
            }
        }
        let mut mass = vec![[1.0; 2]; 1 << trees.depth];
        for (node, k) in self.nodes.iter().zip(&self.used) {
            let kind = usize::from(*k as usize >= self.positives);
            mass[usize::from(*node)][kind] += f64::from(self.weights[*k as usize]);
        }
        // A floor of one millionth of the mass: a leaf that saw one kind only may still receive the other.
        let leaf = |[p, n]: &[f64; 2]| 0.5 * math::ln((p + MASS * 1e-6) / (n + MASS * 1e-6));
        let units: Vec<i32> = mass
            .iter()
            .map(|mass| (leaf(mass).clamp(-LEAF_MAX, LEAF_MAX) / f64::from(leaf_step())).round() as i32)
            .collect();
        for k in 0..self.scores.len() {
            let mut node = 0;
            for _ in 0..trees.depth {
                let split = first + node;
                let byte = self.columns[usize::from(trees.features[split])][k];
                node = 2 * node + if f32::from(byte) < trees.thresholds[split] { 1 } else { 2 };
            }
            self.scores[k] += units[node + 1 - (1 << trees.depth)];
        }
        trees.leaves.extend(units.iter().map(|units| *units as f32 * leaf_step()));
    }

    /// Best split of each node of a level.
    fn splits(&self, offered: &[usize], nodes: usize) -> Vec<Split> {
        let mut best = vec![Split { cost: f64::INFINITY, feature: offered[0], threshold: 1 }; nodes];
        let mut histogram = vec![[0_u32; BINS]; 2 * nodes];
        for &feature in offered {
            histogram.iter_mut().for_each(|bins| bins.fill(0));
            let column = &self.columns[feature];
            for (node, k) in self.nodes.iter().zip(&self.used) {
                let k = *k as usize;
                let kind = usize::from(k >= self.positives);
                histogram[2 * usize::from(*node) + kind][usize::from(column[k])] += self.weights[k];
            }
            for (best, bins) in best.iter_mut().zip(histogram.chunks_exact(2)) {
                let (cost, threshold) = cheapest(&bins[0], &bins[1]);
                if cost < best.cost {
                    *best = Split { cost, feature, threshold };
                }
            }
        }
        best
    }
}

/// Smallest loss and its threshold; the loss is the sum over both sides of the square root of positive times negative
/// mass.
fn cheapest(positive: &[u32; BINS], negative: &[u32; BINS]) -> (f64, usize) {
    let total = |bins: &[u32; BINS]| bins.iter().map(|n| u64::from(*n)).sum::<u64>();
    let (all, others) = (total(positive), total(negative));
    let (mut p, mut n) = (0, 0);
    let mut best = (f64::INFINITY, 1);
    for threshold in 1..BINS {
        let (more_p, more_n) = (positive[threshold - 1], negative[threshold - 1]);
        if more_p == 0 && more_n == 0 {
            continue;
        }
        (p, n) = (p + u64::from(more_p), n + u64::from(more_n));
        let root = |p: u64, n: u64| (p as f64 * n as f64).sqrt();
        let cost = root(p, n) + root(all - p, others - n);
        if cost < best.0 {
            best = (cost, threshold);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of eight bytes; the kind depends on a circle in the first two.
    fn ring(count: usize, seed: u64) -> [Vec<u8>; 2] {
        let mut rng = Rng::keyed(seed, "ring", &[]);
        let mut kinds = [Vec::new(), Vec::new()];
        for _ in 0..count {
            let bytes: [u8; 8] = core::array::from_fn(|_| rng.below(256) as u8);
            let [x, y] = [bytes[0], bytes[1]].map(|b| f64::from(b) - 128.0);
            kinds[usize::from(x * x + y * y > 80.0 * 80.0)].extend(bytes);
        }
        kinds
    }

    fn score(trees: &Trees, bytes: &[u8]) -> f32 {
        let inner = (1 << trees.depth) - 1;
        let tree = |t: usize| {
            let mut node = 0;
            while node < inner {
                let k = t * inner + node;
                let left = f32::from(bytes[usize::from(trees.features[k])]) < trees.thresholds[k];
                node = 2 * node + if left { 1 } else { 2 };
            }
            trees.leaves[t * (inner + 1) + node - inner]
        };
        (0..trees.len()).map(tree).sum()
    }

    #[test]
    fn boosting_learns_a_ring_at_every_depth() {
        let ([inside, outside], [seen, unseen]) = (ring(4000, 1), ring(2000, 2));
        let samples = Samples { features: 8, positive: &inside, negative: &outside };
        for depth in 2..=5 {
            let trees = boost(samples, &BoostParams { depth, trees: 60, one_of: 1, seed: 3 });
            let right = |bytes: &[u8], positive| (score(&trees, bytes) > 0.0) == positive;
            let good = seen.chunks(8).filter(|b| right(b, true)).count()
                + unseen.chunks(8).filter(|b| right(b, false)).count();
            assert!(good > 1930, "depth {depth}: {good} of 2000");
        }
    }

    #[test]
    fn boosting_is_deterministic() {
        let [inside, outside] = ring(1500, 4);
        let samples = Samples { features: 8, positive: &inside, negative: &outside };
        let trees = boost(samples, &BoostParams { depth: 3, trees: 20, one_of: 2, seed: 5 });
        let mut hasher = swerve_core::Hasher::new();
        hasher.value(&trees);
        assert_eq!(hasher.digest().to_string(), "1d1717ee37c84b92", "other trees than on other machines");
        assert_ne!(trees, boost(samples, &BoostParams { depth: 3, trees: 20, one_of: 2, seed: 6 }));
    }

    #[test]
    fn boosting_without_samples_grows_no_tree() {
        let params = BoostParams { depth: 2, trees: 5, one_of: 1, seed: 1 };
        for (positive, negative) in [(&[][..], &[][..]), (&[1, 2], &[]), (&[], &[1, 2])] {
            assert!(boost(Samples { features: 2, positive, negative }, &params).is_empty());
        }
        // Identical samples: trees are grown, but all leaves are zero.
        let same = boost(Samples { features: 2, positive: &[1, 2], negative: &[1, 2] }, &params);
        assert!(same.leaves.iter().all(|leaf| *leaf == 0.0));
    }
}
