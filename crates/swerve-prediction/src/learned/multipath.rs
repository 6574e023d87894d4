//! Net after MultiPath: each mode is an anchor (a path, by k-means over the training paths) with an offset and a
//! normal distribution at each step, all from a single pass.
//!
//! Reduced: no image of the scene, but the past and a max-pooled encoding of nearby actors; anchors are relative to
//! the baseline.

use super::example::Example;
use super::shape::{Shape, Weights};
use super::{NEAR, PAST, Sight, Way, ln_sigma, minded_near, pasts, straight_on};
use crate::net::{Layer, Matrix, Node, Normal, Shapes, Tape, distance, ln_sum};

/// Width of the encoding of nearby actors.
const MINDED: usize = 24;
/// Weight of the mode's classification loss relative to the path loss.
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

    /// One row per actor: five numbers per mode and step, then the logit of each mode.
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

/// Distribution of a mode at a step.
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

/// Loss of a batch, and gradients of the weights. `by_distance` is the weight of distance rather than density in the
/// gradient of the nearest anchor's path; `mixed` is the weight of the density under all modes rather than that of
/// the nearest anchor.
pub(super) fn loss(
    layers: &Layers,
    (shape, anchors): (&Shape, &[Vec<f32>]),
    matrices: &[Matrix],
    (batch, [by_distance, mixed]): (&[Example], [f32; 2]),
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
        if mixed < 1.0 {
            let by = each * (1.0 - mixed);
            sum += by * of_nearest((shape, anchors), (example, by_distance), row, (to, by));
        }
        if mixed > 0.0 {
            let by = each * mixed;
            sum += by * of_all((shape, anchors), example, row, (to, by));
        }
    }
    (sum, tape.back(vec![(out, gradient)]))
}

/// Loss of the anchor nearest to the observed path, with its classification; adds `by` times the gradient to `to`.
fn of_nearest(
    (shape, anchors): (&Shape, &[Vec<f32>]),
    (example, by_distance): (&Example, f32),
    row: &[f32],
    (to, by): (&mut [f32], f32),
) -> f32 {
    let chosen = nearest(anchors, example);
    let logits = 5 * shape.modes * shape.steps;
    let (total, shares) = ln_sum(&row[logits..]);
    let mut sum = CHOICE * (total - row[logits + chosen]);
    for (mode, share) in shares.iter().enumerate() {
        to[logits + mode] += by * CHOICE * (share - f32::from(u8::from(mode == chosen)));
    }
    let (one, each) = (1.0 / shape.steps as f32, by / shape.steps as f32);
    for (step, truth) in example.truth.iter().enumerate() {
        let normal = normal(row, (shape, anchors), &example.sight, [chosen, step]);
        let (off, way) = distance(normal.mean, *truth);
        sum += one * (by_distance * off + normal.nats(*truth));
        let mut numbers = normal.gradient(*truth);
        for (number, way) in numbers.iter_mut().zip(way) {
            *number = by_distance * way + (1.0 - by_distance) * *number;
        }
        let to = &mut to[5 * (chosen * shape.steps + step)..][..5];
        to.iter_mut().zip(numbers).for_each(|(to, number)| *to += each * number);
    }
    sum
}

/// Mean negative log-likelihood of the observed path under all modes, per step; adds `by` times the gradient to `to`.
fn of_all(
    (shape, anchors): (&Shape, &[Vec<f32>]),
    example: &Example,
    row: &[f32],
    (to, by): (&mut [f32], f32),
) -> f32 {
    let logits = 5 * shape.modes * shape.steps;
    let (total, shares) = ln_sum(&row[logits..]);
    let (mut sum, one) = (0.0, 1.0 / shape.steps as f32);
    for (step, truth) in example.truth.iter().enumerate() {
        let normals: Vec<Normal> = (0..shape.modes)
            .map(|mode| normal(row, (shape, anchors), &example.sight, [mode, step]))
            .collect();
        let ln = |(mode, normal): (usize, &Normal)| row[logits + mode] - total - normal.nats(*truth);
        let (likely, posterior) = ln_sum(&normals.iter().enumerate().map(ln).collect::<Vec<_>>());
        sum -= one * likely;
        for (mode, normal) in normals.iter().enumerate() {
            to[logits + mode] += by * one * (shares[mode] - posterior[mode]);
            let to = &mut to[5 * (mode * shape.steps + step)..][..5];
            let numbers = normal.gradient(*truth);
            to.iter_mut().zip(numbers).for_each(|(to, number)| *to += by * one * posterior[mode] * number);
        }
    }
    sum
}

/// Shrinks the means by a share: the anchors, and the first two of each five numbers of the last layer.
pub(super) fn shrink(anchors: &mut [Vec<f32>], matrices: &mut [Matrix], share: f32) {
    anchors.iter_mut().flatten().for_each(|one| *one *= 1.0 - share);
    let logits = anchors.iter().map(|anchor| anchor.len() / 2 * 5).sum::<usize>();
    let last = matrices.len().saturating_sub(2);
    for matrix in &mut matrices[last..] {
        for row in matrix.values.chunks_exact_mut(matrix.columns) {
            let means = row[..logits].iter_mut().enumerate().filter(|(k, _)| k % 5 < 2);
            means.for_each(|(_, one)| *one *= 1.0 - share);
        }
    }
}

/// Index of the anchor nearest to the observed path.
fn nearest(anchors: &[Vec<f32>], example: &Example) -> usize {
    let beside = example.beside();
    let off = |anchor: &Vec<f32>| {
        let steps = anchor.chunks_exact(2).zip(beside.chunks_exact(2));
        steps.map(|(a, b)| distance([a[0], a[1]], [b[0], b[1]]).0).sum::<f32>()
    };
    let all = anchors.iter().map(off).enumerate();
    all.reduce(|best, one| if one.1 < best.1 { one } else { best }).map_or(0, |(k, _)| k)
}

/// Anchors of these examples: Lloyd's k-means, initialised by k-means++ (Arthur and Vassilvitskii 2007).
pub(super) fn anchors(shape: &Shape, examples: &[Example], seed: u64) -> Vec<Vec<f32>> {
    /// Number of iterations of k-means, and largest number of examples used.
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
