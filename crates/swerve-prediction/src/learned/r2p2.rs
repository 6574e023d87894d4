//! After R2P2: a policy of one step. The next place is that of who keeps the last step, with an offset and a normal
//! distribution that the net has of all before; noise makes a path, and a path has one noise: its density is known.
//!
//! Learnt by the density of what happened, a little perturbed. Reduced: in the place of an image, how close others are in
//! eight directions around the moving point, if they go straight on.

use swerve_core::Rng;

use super::train::Example;
use super::{NEAR, Shape, Sight, Way, minded_near, remembered};
use crate::net::{Gru, Layer, Matrix, Node, Normal, Shapes, Tape, Weights};

/// Numbers that tell who is near at first.
const MINDED: usize = 16;
/// Directions around the moving point.
const AROUND: usize = 8;
/// The logarithm of what one step is expected to be off by: 5 cm on foot.
const LN_SIGMA: f32 = -3.0;
/// A path without noise counts as so many samples.
const CALM: f32 = 2.0;
/// Least deviation of what is told, in the scale.
const SIGMA_MIN: f32 = 0.03;

#[derive(Debug)]
pub(crate) struct Layers {
    past: Gru,
    near: Layer,
    start: Layer,
    on: Gru,
    out: Layer,
}

impl Layers {
    pub(super) fn of(shape: &Shape, shapes: &mut Shapes) -> Self {
        let hidden = shape.hidden;
        Self {
            past: shapes.gru(3, hidden),
            near: shapes.layer(NEAR, MINDED),
            start: shapes.layer(hidden + MINDED, hidden),
            on: shapes.gru(4 + AROUND, hidden),
            out: shapes.layer(hidden, 5),
        }
    }

    /// What a path starts from.
    fn start(&self, tape: &mut Tape<'_>, sights: &[&Sight]) -> Node {
        let memory = remembered(tape, sights, &self.past);
        let near = minded_near(tape, sights, self.near);
        let both = tape.beside(&[memory, near]);
        let start = tape.linear(both, self.start);
        tape.tanh(start)
    }

    /// One step on, of rows that are at a place by a step.
    fn on(
        &self,
        tape: &mut Tape<'_>,
        memory: Node,
        rows: &[(&Sight, [f32; 2], [f32; 2])],
        step: usize,
    ) -> (Node, Node) {
        let told = rows.iter().flat_map(|(sight, at, pace)| {
            let first = sight.pace();
            let own = [pace[0], pace[1], pace[0] - first[0], pace[1] - first[1]];
            own.into_iter().chain(around(sight, *at, step))
        });
        let told = tape.given(Matrix::new(rows.len(), 4 + AROUND, told.collect()));
        let memory = tape.gru(told, memory, &self.on);
        (memory, tape.linear(memory, self.out))
    }
}

/// How close the closest is in each direction around a place, after so many steps: 1 where they touch, 0 far away.
fn around(sight: &Sight, at: [f32; 2], step: usize) -> [f32; AROUND] {
    let mut close = [0.0_f32; AROUND];
    for near in &sight.near {
        let to = [0, 1].map(|i| near.at[i] + near.pace[i] * step as f32 - at[i]);
        let far = (to[0] * to[0] + to[1] * to[1]).sqrt();
        let of = 1.0 / (1.0 + far);
        let [along, across] = to.map(|one| one.abs());
        let quarter = usize::from(to[0] < 0.0) + 2 * usize::from(to[1] < 0.0);
        let sector = 2 * quarter + usize::from(across > along);
        close[sector] = close[sector].max(of);
    }
    close
}

/// The distribution of the next place.
fn next(numbers: &[f32], at: [f32; 2], pace: [f32; 2]) -> Normal {
    Normal::of(numbers, [at[0] + pace[0], at[1] + pace[1]], LN_SIGMA)
}

pub(super) fn ways(layers: &Layers, weights: &Weights, sights: &[Sight]) -> Vec<Vec<Way>> {
    let shape = &weights.shape;
    // The first path of each has no noise.
    let each = shape.modes + 1;
    let rows = sights.len() * each;
    let mut tape = Tape::forward(&weights.matrices);
    let start = layers.start(&mut tape, &sights.iter().collect::<Vec<_>>());
    let mut memory = tape.rows(start, (0..rows).map(|row| row / each).collect());
    let mut noise: Vec<Rng> = (0..rows)
        .map(|row| Rng::keyed(0, "r2p2", &[i64::from(sights[row / each].id), (row % each) as i64]))
        .collect();
    let mut now: Vec<(&Sight, [f32; 2], [f32; 2])> =
        (0..rows).map(|row| (&sights[row / each], [0.0; 2], sights[row / each].pace())).collect();
    let mut paths: Vec<Vec<[f32; 2]>> = vec![Vec::with_capacity(shape.steps); rows];
    for step in 0..shape.steps {
        let out;
        (memory, out) = layers.on(&mut tape, memory, &now, step);
        for (row, (_, at, pace)) in now.iter_mut().enumerate() {
            let normal = next(tape.value(out).row(row), *at, *pace);
            let drawn = [noise[row].normal() as f32, noise[row].normal() as f32];
            let to = normal.at(if row % each == 0 { [0.0; 2] } else { drawn });
            *pace = [0, 1].map(|i| to[i] - at[i]);
            *at = to;
            paths[row].push(to);
        }
    }
    (0..sights.len()).map(|k| spread(&paths[k * each..(k + 1) * each])).collect()
}

/// Samples as modes, each as wide as so few have to be to tell a density (Silverman's rule).
fn spread(paths: &[Vec<[f32; 2]>]) -> Vec<Way> {
    let samples = (paths.len() - 1) as f32;
    let narrow = libm::powf(samples, -1.0 / 3.0);
    let width = |step: usize| {
        let calm = paths[0][step];
        let mut sums = [0.0_f32; 3];
        for path in &paths[1..] {
            let [x, y] = [0, 1].map(|i| path[step][i] - calm[i]);
            sums.iter_mut().zip([x * x, x * y, y * y]).for_each(|(sum, one)| *sum += one);
        }
        let least = SIGMA_MIN * SIGMA_MIN;
        let [xx, xy, yy] = sums.map(|sum| narrow * sum / samples);
        [xx + least, xy, yy + least]
    };
    let widths: Vec<[f32; 3]> = (0..paths[0].len()).map(width).collect();
    let way = |(k, path): (usize, &Vec<[f32; 2]>)| Way {
        probability: if k == 0 { CALM } else { 1.0 } / (samples + CALM),
        places: path.iter().copied().zip(widths.iter().copied()).collect(),
    };
    paths.iter().enumerate().map(way).collect()
}

/// The loss of a batch (minus the logarithm of the density of what happened, a step), and the gradients of the weights.
pub(super) fn loss(
    layers: &Layers,
    shape: &Shape,
    matrices: &[Matrix],
    batch: &[Example],
) -> (f32, Vec<Matrix>) {
    let mut tape = Tape::new(matrices);
    let mut memory = layers.start(&mut tape, &batch.iter().map(|one| &one.sight).collect::<Vec<_>>());
    let mut now: Vec<(&Sight, [f32; 2], [f32; 2])> =
        batch.iter().map(|one| (&one.sight, [0.0; 2], one.sight.pace())).collect();
    let by = 1.0 / (batch.len() * shape.steps) as f32;
    let mut sum = 0.0;
    let mut from = Vec::with_capacity(shape.steps);
    for step in 0..shape.steps {
        let out;
        (memory, out) = layers.on(&mut tape, memory, &now, step);
        let mut gradient = Matrix::zeros(batch.len(), 5);
        for (row, ((_, at, pace), example)) in now.iter_mut().zip(batch).enumerate() {
            let truth = example.truth[step];
            let normal = next(tape.value(out).row(row), *at, *pace);
            sum += by * normal.nats(truth);
            let to = gradient.row_mut(row).iter_mut();
            to.zip(normal.gradient(truth)).for_each(|(to, one)| *to = by * one);
            *pace = [0, 1].map(|i| truth[i] - at[i]);
            *at = truth;
        }
        from.push((out, gradient));
    }
    (sum, tape.back(from))
}
