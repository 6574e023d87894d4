//! Training of a forest over features of a byte each.
//!
//! Breiman: "Random forests", 2001: each tree sees a random share of the samples, each node a random share of the
//! features, and splits where the classes part best (Gini). Weights are whole numbers and histograms their sums, so that
//! no order of adding shows; of equal splits the lower feature's is taken, then the lower threshold.

use std::collections::VecDeque;

use swerve_core::Rng;

use super::weights::Tree;
use super::{CLASSES, FEATURES};

/// How trees are grown.
#[derive(Clone, PartialEq, Debug)]
pub struct ForestParams {
    /// Levels of nodes.
    pub depth: usize,
    /// A node with less than this share of all weight is not split.
    pub least: f64,
    /// A node is offered one of so many features.
    pub one_of: usize,
    /// Of all that is drawn.
    pub seed: u64,
}

/// Cells to learn from.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Samples {
    /// Of each feature the bytes of all.
    columns: Vec<u8>,
    /// Of each its class.
    labels: Vec<u8>,
    /// Of each how much it counts.
    weights: Vec<u32>,
}

/// Thresholds that a byte can be compared with.
const BINS: usize = 256;
/// Weight of each class.
type Mass = [u64; CLASSES];

/// A node whose samples are still together.
struct Open {
    samples: Vec<u32>,
    depth: usize,
}

/// The best split so far.
#[derive(Clone, Copy)]
struct Split {
    purity: f64,
    feature: usize,
    threshold: u8,
}

/// Grows one tree of a forest, with leaves of so many classes; the number tells it from the others.
pub fn grow(samples: &Samples, classes: usize, params: &ForestParams, number: usize) -> Tree {
    let mut rng = Rng::keyed(params.seed, "tree", &[number as i64]);
    // As many different ones as drawing with replacement brings.
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
        // Two nodes for each that is split, and they are counted in two bytes.
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

/// The sum of the squares over the sum: highest where one class has all.
fn purity(mass: &Mass) -> f64 {
    let total: u64 = mass.iter().sum();
    let squares: f64 = mass.iter().map(|mass| *mass as f64 * *mass as f64).sum();
    squares / total.max(1) as f64
}

impl Samples {
    /// Of rows of [`FEATURES`] bytes, one for each label; labels are below [`CLASSES`].
    ///
    /// # Panics
    /// Where they are not as many, or a label is none.
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

    /// How many there are.
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// Whether there are none.
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

    /// The best split by a random choice of features.
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

/// The threshold that parts the classes best, and how pure both sides are then.
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
