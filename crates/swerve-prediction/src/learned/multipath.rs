//! After MultiPath: each mode is an anchor (a path, k-means over those of others) with an offset and a normal distribution
//! at each step, all from one pass.
//!
//! Reduced: no image of the scene, but the past and the largest answers about who is near; anchors beside going straight on.

use super::train::Example;
use super::{NEAR, PAST, Shape, Sight, Way, ln_sigma, minded_near, pasts, straight_on};
use crate::net::{Layer, Matrix, Node, Normal, Shapes, Tape, Weights, distance, ln_sum};

/// Numbers that tell who is near.
const MINDED: usize = 24;
/// What a wrong anchor counts beside a wrong path.
const CHOICE: f32 = 0.3;

#[derive(Debug)]
pub(crate) struct Layers {
    near: Layer,
    first: Layer,
    second: Layer,
    out: Layer,
}

impl Layers {
    pub(super) fn of(shape: &Shape, shapes: &mut Shapes) -> Self {
        let past = 2 * (PAST - 1) + 1;
        Self {
            near: shapes.layer(NEAR, MINDED),
            first: shapes.layer(past + MINDED, shape.hidden),
            second: shapes.layer(shape.hidden, shape.hidden),
            out: shapes.layer(shape.hidden, shape.modes * (5 * shape.steps + 1)),
        }
    }

    /// For each a row: five numbers a step and mode, then how likely each mode is.
    fn forward(&self, tape: &mut Tape<'_>, sights: &[&Sight]) -> Node {
        let near = minded_near(tape, sights, self.near);
        let past = tape.given(pasts(sights));
        let both = tape.beside(&[past, near]);
        let first = tape.linear(both, self.first);
        let first = tape.relu(first);
        let second = tape.linear(first, self.second);
        let second = tape.relu(second);
        tape.linear(second, self.out)
    }
}

/// The distribution of a mode at a step.
fn normal(row: &[f32], (shape, anchors): (&Shape, &[Vec<f32>]), sight: &Sight, at: [usize; 2]) -> Normal {
    let [mode, step] = at;
    let [x, y] = straight_on(sight, step);
    let anchor = &anchors[mode][2 * step..][..2];
    Normal::of(&row[5 * (mode * shape.steps + step)..][..5], [x + anchor[0], y + anchor[1]], ln_sigma(step))
}

pub(super) fn ways(layers: &Layers, weights: &Weights, sights: &[Sight]) -> Vec<Vec<Way>> {
    let shape = &weights.shape;
    let mut tape = Tape::forward(&weights.matrices);
    let out = layers.forward(&mut tape, &sights.iter().collect::<Vec<_>>());
    let of_one = |(k, sight): (usize, &Sight)| {
        let row = tape.value(out).row(k);
        let (_, shares) = ln_sum(&row[5 * shape.modes * shape.steps..]);
        let way = |(mode, probability): (usize, f32)| {
            let place = |step| {
                let normal = normal(row, (shape, &weights.anchors), sight, [mode, step]);
                (normal.mean, normal.covariance())
            };
            Way { probability, places: (0..shape.steps).map(place).collect() }
        };
        shares.into_iter().enumerate().map(way).collect()
    };
    sights.iter().enumerate().map(of_one).collect()
}

/// The loss of a batch, and the gradients of the weights. `by_distance` is the share of distance, not density, in what
/// moves a path.
pub(super) fn loss(
    layers: &Layers,
    (shape, anchors): (&Shape, &[Vec<f32>]),
    matrices: &[Matrix],
    (batch, by_distance): (&[Example], f32),
) -> (f32, Vec<Matrix>) {
    let mut tape = Tape::new(matrices);
    let sights: Vec<&Sight> = batch.iter().map(|one| &one.sight).collect();
    let out = layers.forward(&mut tape, &sights);
    let value = tape.value(out);
    let mut gradient = Matrix::zeros(value.rows, value.columns);
    let mut sum = 0.0;
    let each = 1.0 / batch.len() as f32;
    for (k, example) in batch.iter().enumerate() {
        let (row, to) = (value.row(k), gradient.row_mut(k));
        let chosen = nearest(anchors, example);
        let logits = 5 * shape.modes * shape.steps;
        let (total, shares) = ln_sum(&row[logits..]);
        sum += each * CHOICE * (total - row[logits + chosen]);
        for (mode, share) in shares.iter().enumerate() {
            to[logits + mode] = each * CHOICE * (share - f32::from(u8::from(mode == chosen)));
        }
        let by = each / shape.steps as f32;
        for (step, truth) in example.truth.iter().enumerate() {
            let normal = normal(row, (shape, anchors), &example.sight, [chosen, step]);
            let (off, way) = distance(normal.mean, *truth);
            sum += by * (by_distance * off + normal.nats(*truth));
            let mut numbers = normal.gradient(*truth);
            for (number, way) in numbers.iter_mut().zip(way) {
                *number = by_distance * way + (1.0 - by_distance) * *number;
            }
            let to = &mut to[5 * (chosen * shape.steps + step)..][..5];
            to.iter_mut().zip(numbers).for_each(|(to, one)| *to = by * one);
        }
    }
    (sum, tape.back(vec![(out, gradient)]))
}

/// The anchor that is nearest to what happened.
fn nearest(anchors: &[Vec<f32>], example: &Example) -> usize {
    let beside = example.beside();
    let off = |anchor: &Vec<f32>| {
        let steps = anchor.chunks_exact(2).zip(beside.chunks_exact(2));
        steps.map(|(a, b)| distance([a[0], a[1]], [b[0], b[1]]).0).sum::<f32>()
    };
    let all = anchors.iter().map(off).enumerate();
    all.reduce(|best, one| if one.1 < best.1 { one } else { best }).map_or(0, |(k, _)| k)
}

/// Anchors of these examples: Lloyd's k-means from examples as far from each other as chance has it (Arthur and
/// Vassilvitskii 2007).
pub(super) fn anchors(shape: &Shape, examples: &[Example], seed: u64) -> Vec<Vec<f32>> {
    /// Rounds of k-means, and examples that it looks at.
    const ROUNDS: usize = 20;
    const MOST: usize = 4000;
    let [count, long] = shape.anchors();
    let paths: Vec<Vec<f32>> =
        examples.iter().step_by(examples.len().div_ceil(MOST).max(1)).map(Example::beside).collect();
    let squared = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f32>();
    let nearest = |to: &[f32], of: &[Vec<f32>]| {
        let all = of.iter().map(|one| squared(to, one)).enumerate();
        all.reduce(|best, one| if one.1 < best.1 { one } else { best }).unwrap_or((0, f32::INFINITY))
    };
    let mut rng = swerve_core::Rng::keyed(seed, "anchors", &[]);
    let mut anchors = vec![paths[rng.below(paths.len())].clone()];
    while anchors.len() < count {
        let off: Vec<f32> = paths.iter().map(|path| nearest(path, &anchors).1).collect();
        let mut left = rng.unit() as f32 * off.iter().sum::<f32>();
        let passed = |off: &f32| {
            left -= off;
            left <= 0.0
        };
        let next = off.iter().position(passed).unwrap_or(paths.len() - 1);
        anchors.push(paths[next].clone());
    }
    for _ in 0..ROUNDS {
        let mut sums = vec![(vec![0.0_f32; long], 0_usize); count];
        for path in &paths {
            let (sum, n) = &mut sums[nearest(path, &anchors).0];
            sum.iter_mut().zip(path).for_each(|(sum, one)| *sum += one);
            *n += 1;
        }
        for (anchor, (sum, n)) in anchors.iter_mut().zip(&sums).filter(|(_, (_, n))| *n > 0) {
            anchor.iter_mut().zip(sum).for_each(|(to, sum)| *to = sum / *n as f32);
        }
    }
    anchors
}
