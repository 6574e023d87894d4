//! Net after R2P2: a one-step policy. The next position is the previous step repeated, plus an offset and normally
//! distributed noise from the net given all earlier positions. The mapping from noise to paths is invertible, so the
//! density of a path is known.
//!
//! Trained by the density of slightly perturbed observed paths. Reduced: instead of an image, the proximity of other
//! actors in eight directions around the moving position, assuming straight motion.

use swerve_core::Rng;

use super::example::Example;
use super::shape::{Shape, Weights};
use super::{NEAR, Sight, Way, minded_near, remembered};
use crate::net::{Gru, Layer, Matrix, Node, Normal, Shapes, Tape};

/// Width of the encoding of nearby actors at the start.
const MINDED: usize = 16;
/// Number of directions around the moving position.
const AROUND: usize = 8;
/// Logarithm of the initial standard deviation of one step: 5 cm for pedestrians.
const LN_SIGMA: f32 = -3.0;
/// Weight of the path without noise, in samples.
const CALM: f32 = 2.0;
/// Smallest reported standard deviation, in scaled units.
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

    /// Initial state of a path.
    fn start(&self, tape: &mut Tape<'_>, sights: &[&Sight]) -> Node {
        let memory = remembered(tape, sights, &self.past);
        let near = minded_near(tape, sights, self.near);
        let both = tape.beside(&[memory, near]);
        let start = tape.linear(both, self.start);
        tape.tanh(start)
    }

    /// Advances by one step; each row is an actor with its position and last step.
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

/// Proximity of the closest actor in each direction around a position after `step` steps: 1 for contact, 0 far away.
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

/// Distribution of the next position.
fn next(numbers: &[f32], at: [f32; 2], pace: [f32; 2]) -> Normal {
    Normal::of(numbers, [at[0] + pace[0], at[1] + pace[1]], LN_SIGMA)
}

pub(super) fn ways(layers: &Layers, weights: &Weights, sights: &[Sight]) -> Vec<Vec<Way>> {
    let shape = &weights.shape;
    // The first path of each actor has no noise.
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

/// Converts samples to modes, with kernel widths by Silverman's rule.
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

/// Loss of a batch (mean negative log-likelihood per step), and gradients of the weights.
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
