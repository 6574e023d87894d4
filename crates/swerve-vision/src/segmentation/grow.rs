//! Training of a random forest over byte-valued features.
//!
//! Breiman: "Random forests", 2001: each tree sees a random share of the samples, each node a random share of the
//! features, and splits by the Gini criterion. Weights and histograms are integers, so the result does not depend on
//! the order of summation; ties go to the lower feature, then the lower threshold.

use std::collections::VecDeque;

use swerve_core::Rng;

use super::weights::Tree;
use super::{CLASSES, FEATURES};

/// Parameters of tree growing.
#[derive(Clone, PartialEq, Debug)]
pub struct ForestParams {
    /// Levels of nodes.
    pub depth: usize,
    /// Share of the total weight below which a node is not split.
    pub least: f64,
    /// One of this many features is offered to each node.
    pub one_of: usize,
    /// Seed of all random choices.
    pub seed: u64,
}

/// Training cells.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Samples {
    /// Bytes of all cells, feature by feature.
    columns: Vec<u8>,
    /// Class of each cell.
    labels: Vec<u8>,
    /// Weight of each cell.
    weights: Vec<u32>,
}

/// Number of values of a byte.
const BINS: usize = 256;
/// Weight of each class.
type Mass = [u64; CLASSES];

/// Node that is not yet split.
struct Open {
    samples: Vec<u32>,
    depth: usize,
}

/// Best split so far.
#[derive(Clone, Copy)]
struct Split {
    purity: f64,
    feature: usize,
    threshold: u8,
}

/// Grows one tree of a forest with this number of classes; `number` is the tree's index and seeds its randomness.
pub fn grow(samples: &Samples, classes: usize, params: &ForestParams, number: usize) -> Tree {
    let mut rng = Rng::keyed(params.seed, "tree", &[number as i64]);
    // Expected share of distinct samples when drawing with replacement.
    let seen: Vec<u32> = (0..samples.labels.len() as u32).filter(|_| rng.unit() < 0.632).collect();
    let all: u64 = samples.mass(&seen).iter().sum();
    let least = (params.least * all as f64) as u64;
    let mut tree = Tree::default();
    let mut open = VecDeque::from([Open { samples: seen, depth: 0 }]);
    while let Some(node) = open.pop_front() {
        let mass = samples.mass(&node.samples);
        let total: u64 = mass.iter().sum();
        let may_split = node.depth < params.depth && total >= least.max(1);
        let split = may_split.then(|| samples.split(&node.samples, params.one_of, &mut rng)).flatten();
        // Each split adds two nodes, and node indices have two bytes.
        match split.filter(|split| split.purity > purity(&mass) && tree.thresholds.len() < 1 << 14) {
            Some(split) => {
                let column = samples.column(split.feature);
                let parts: (Vec<u32>, Vec<u32>) =
                    node.samples.into_iter().partition(|k| column[*k as usize] < split.threshold);
                for samples in [parts.0, parts.1] {
                    open.push_back(Open { samples, depth: node.depth + 1 });
                }
                tree.features.push(split.feature as u16 + 1);
                tree.thresholds.push(split.threshold);
            }
            None => {
                tree.features.push(0);
                let share = |mass: &u64| (*mass * 255 + total / 2).checked_div(total).unwrap_or(0) as u8;
                tree.leaves.extend(mass[..classes].iter().map(share));
            }
        }
    }
    tree
}

/// Sum of squares over the sum: highest if one class has all the weight.
fn purity(mass: &Mass) -> f64 {
    let total: u64 = mass.iter().sum();
    let squares: f64 = mass.iter().map(|mass| *mass as f64 * *mass as f64).sum();
    squares / total.max(1) as f64
}

impl Samples {
    /// Samples from rows of [`FEATURES`] bytes, one per label; labels are below [`CLASSES`].
    ///
    /// # Panics
    /// If the numbers of rows, labels and weights differ, or a label is out of range.
    pub fn new(rows: &[u8], labels: Vec<u8>, weights: Vec<u32>) -> Self {
        let count = labels.len();
        assert_eq!(
            [rows.len(), weights.len()],
            [count * FEATURES, count],
            "rows and weights of {count} samples"
        );
        assert!(labels.iter().all(|label| usize::from(*label) < CLASSES), "labels below {CLASSES}");
        let mut columns = vec![0; rows.len()];
        for (k, row) in rows.chunks_exact(FEATURES).enumerate() {
            row.iter().enumerate().for_each(|(feature, byte)| columns[feature * count + k] = *byte);
        }
        Self { columns, labels, weights }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// Returns true if there are no samples.
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    fn column(&self, feature: usize) -> &[u8] {
        &self.columns[feature * self.labels.len()..][..self.labels.len()]
    }

    fn mass(&self, of: &[u32]) -> Mass {
        let mut mass = [0; CLASSES];
        of.iter().for_each(|k| {
            mass[usize::from(self.labels[*k as usize])] += u64::from(self.weights[*k as usize])
        });
        mass
    }

    /// Best split over a random choice of features.
    fn split(&self, of: &[u32], one_of: usize, rng: &mut Rng) -> Option<Split> {
        let mut best: Option<Split> = None;
        let mut histogram = vec![[0; CLASSES]; BINS];
        for feature in (0..FEATURES).filter(|_| rng.below(one_of.max(1)) == 0) {
            histogram.fill([0; CLASSES]);
            let column = self.column(feature);
            for k in of {
                let k = *k as usize;
                let bin = &mut histogram[usize::from(column[k])];
                bin[usize::from(self.labels[k])] += u64::from(self.weights[k]);
            }
            let (purity, threshold) = purest(&histogram);
            if best.is_none_or(|best| purity > best.purity) {
                best = Some(Split { purity, feature, threshold });
            }
        }
        best
    }
}

/// Purity and threshold of the split that separates the classes best.
fn purest(histogram: &[Mass]) -> (f64, u8) {
    let mut above = [0; CLASSES];
    histogram.iter().for_each(|bin| above.iter_mut().zip(bin).for_each(|(sum, mass)| *sum += mass));
    let (mut below, mut best) = ([0; CLASSES], (0.0, 1));
    for (threshold, bin) in (1..BINS).zip(histogram) {
        if bin.iter().all(|mass| *mass == 0) {
            continue;
        }
        for class in 0..CLASSES {
            below[class] += bin[class];
            above[class] -= bin[class];
        }
        let pure = purity(&below) + purity(&above);
        if pure > best.0 {
            best = (pure, threshold as u8);
        }
    }
    best
}
