//! Net after multiple futures prediction (MFP): latent modes, each unrolled step by step for all actors at once, with
//! attention at every step to the positions of the others in the same mode.
//!
//! Trained by the likelihood of the observed path under all modes. During training, the other actors follow the
//! recorded paths, and the actor itself the predicted one. Reduced: one recurrent layer, no backward pass over time,
//! no image.

use core::ops::Range;

use super::example::Example;
use super::shape::{Shape, Weights};
use super::{NEAR, Sight, Way, ln_sigma, minded_near, near_row, remembered, straight_on};
use crate::net::{Gru, Layer, Matrix, Node, Normal, Shapes, Tape, ln_sum};

/// Widths of the encoding of a nearby actor and of its attention key.
const MINDED: usize = 16;
const KEY: usize = 8;

/// Positions of the actors near each row after a step, given the positions of all rows (actors times modes): for each
/// row those of its `near`, in the actor's frame.
type Others<'a> = &'a mut dyn FnMut(usize, &[[f32; 2]]) -> Vec<[f32; 2]>;

#[derive(Debug)]
pub(crate) struct Layers {
    past: Gru,
    near: Layer,
    prior: Layer,
    start: Layer,
    moved: Layer,
    keys: Layer,
    asked: Layer,
    on: Gru,
    out: Layer,
}

/// Result of unrolling.
struct Rolled {
    /// Logits of the modes of each actor.
    prior: Node,
    /// One node per step, with a row per actor and mode; modes vary fastest.
    steps: Vec<Node>,
    normals: Vec<Vec<Normal>>,
}

impl Layers {
    pub(super) fn of(shape: &Shape, shapes: &mut Shapes) -> Self {
        let &Shape { modes, hidden, .. } = shape;
        Self {
            past: shapes.gru(3, hidden),
            near: shapes.layer(NEAR, MINDED),
            prior: shapes.layer(hidden + MINDED, modes),
            start: shapes.layer(hidden + MINDED + modes, hidden),
            moved: shapes.layer(NEAR, MINDED),
            keys: shapes.layer(MINDED, KEY),
            asked: shapes.layer(hidden, KEY),
            on: shapes.gru(2 + MINDED + modes + 1, hidden),
            out: shapes.layer(hidden, 5),
        }
    }

    /// Unrolls all modes.
    fn roll(&self, tape: &mut Tape<'_>, (shape, sights): (&Shape, &[&Sight]), others: Others<'_>) -> Rolled {
        let modes = shape.modes;
        let rows = sights.len() * modes;
        let past = remembered(tape, sights, &self.past);
        let minded = minded_near(tape, sights, self.near);
        let told = tape.beside(&[past, minded]);
        let prior = tape.linear(told, self.prior);
        let told = tape.rows(told, (0..rows).map(|row| row / modes).collect());
        let one_of = Matrix::new(
            rows,
            modes,
            (0..rows * modes).map(|k| f32::from(u8::from(k % modes == k / modes % modes))).collect(),
        );
        let one_of = tape.given(one_of);
        let start = tape.beside(&[told, one_of]);
        let start = tape.linear(start, self.start);
        let mut memory = tape.tanh(start);
        let mut groups: Vec<Range<usize>> = Vec::with_capacity(rows);
        for row in 0..rows {
            let from = groups.last().map_or(0, |last| last.end);
            groups.push(from..from + sights[row / modes].near.len());
        }
        let near = |row: usize| sights[row / modes].near.iter();
        let mut at = vec![[0.0_f32; 2]; rows];
        let mut pace: Vec<[f32; 2]> = (0..rows).map(|row| sights[row / modes].pace()).collect();
        let mut theirs: Vec<[f32; 2]> = (0..rows).flat_map(near).map(|near| near.at).collect();
        let mut their_pace: Vec<[f32; 2]> = (0..rows).flat_map(near).map(|near| near.pace).collect();
        let wheels: Vec<f32> = (0..rows).flat_map(near).map(|near| near.wheels).collect();
        let (mut steps, mut normals) = (Vec::new(), Vec::new());
        for step in 0..shape.steps {
            let mut told = Vec::with_capacity(theirs.len() * NEAR);
            for (row, group) in groups.iter().enumerate() {
                for j in group.clone() {
                    let to = [0, 1].map(|i| theirs[j][i] - at[row][i]);
                    told.extend(near_row(to, [0, 1].map(|i| their_pace[j][i] - pace[row][i]), wheels[j]));
                }
            }
            let told = tape.given(Matrix::new(theirs.len(), NEAR, told));
            let minded = self.minded(tape, (told, memory), groups.clone());
            let own = (0..rows).flat_map(|row| {
                let from = if step == 0 { [0.0; 2] } else { straight_on(sights[row / modes], step - 1) };
                let before = sights[row / modes].pace();
                [pace[row][0] - before[0], pace[row][1] - before[1], 0.1 * (at[row][1] - from[1])]
            });
            let own = tape.given(Matrix::new(rows, 3, own.collect()));
            let input = tape.beside(&[own, minded, one_of]);
            memory = tape.gru(input, memory, &self.on);
            let out = tape.linear(memory, self.out);
            let now: Vec<Normal> = (0..rows)
                .map(|row| {
                    let base = straight_on(sights[row / modes], step);
                    Normal::of(tape.value(out).row(row), base, ln_sigma(step))
                })
                .collect();
            for (row, normal) in now.iter().enumerate() {
                pace[row] = [0, 1].map(|i| normal.mean[i] - at[row][i]);
                at[row] = normal.mean;
            }
            let next = others(step, &at);
            let moved = |(before, after): (&[f32; 2], &[f32; 2])| [0, 1].map(|i| after[i] - before[i]);
            their_pace = theirs.iter().zip(&next).map(moved).collect();
            theirs = next;
            steps.push(out);
            normals.push(now);
        }
        Rolled { prior, steps, normals }
    }

    fn minded(&self, tape: &mut Tape<'_>, (told, memory): (Node, Node), groups: Vec<Range<usize>>) -> Node {
        let values = tape.linear(told, self.moved);
        let values = tape.relu(values);
        let keys = tape.linear(values, self.keys);
        let asked = tape.linear(memory, self.asked);
        tape.attended(asked, [keys, values], groups)
    }
}

pub(super) fn ways(layers: &Layers, weights: &Weights, sights: &[Sight]) -> Vec<Vec<Way>> {
    let (shape, modes) = (&weights.shape, weights.shape.modes);
    let mut tape = Tape::forward(&weights.matrices);
    let all: Vec<&Sight> = sights.iter().collect();
    let mut others = |_: usize, at: &[[f32; 2]]| {
        let points: Vec<_> =
            at.iter().enumerate().map(|(row, at)| sights[row / modes].frame.point(*at)).collect();
        let of_row = |row: usize| {
            let sight = &sights[row / modes];
            let of = |near: &super::sight::Near| sight.frame.place(points[near.who * modes + row % modes]);
            sight.near.iter().map(of).collect::<Vec<_>>()
        };
        (0..at.len()).flat_map(of_row).collect()
    };
    let rolled = layers.roll(&mut tape, (shape, &all), &mut others);
    let of_one = |k: usize| {
        let (_, shares) = ln_sum(tape.value(rolled.prior).row(k));
        let way = |(mode, probability): (usize, f32)| {
            let place = |now: &Vec<Normal>| (now[k * modes + mode].mean, now[k * modes + mode].covariance());
            Way { probability, places: rolled.normals.iter().map(place).collect() }
        };
        shares.into_iter().enumerate().map(way).collect()
    };
    (0..sights.len()).map(of_one).collect()
}

/// Loss of a batch, and gradients of the weights; no gradients flow through the predicted positions.
pub(super) fn loss(
    layers: &Layers,
    shape: &Shape,
    matrices: &[Matrix],
    batch: &[Example],
) -> (f32, Vec<Matrix>) {
    let modes = shape.modes;
    let mut tape = Tape::new(matrices);
    let sights: Vec<&Sight> = batch.iter().map(|one| &one.sight).collect();
    let mut others = |step: usize, _: &[[f32; 2]]| {
        let of_row = |row: usize| batch[row / modes].others.iter().map(move |path| path[step]);
        (0..batch.len() * modes).flat_map(of_row).collect()
    };
    let rolled = layers.roll(&mut tape, (shape, &sights), &mut others);
    let each = 1.0 / (batch.len() * shape.steps) as f32;
    let mut sum = 0.0;
    let mut prior = Matrix::zeros(batch.len(), modes);
    let mut steps = vec![Matrix::zeros(batch.len() * modes, 5); shape.steps];
    for (k, example) in batch.iter().enumerate() {
        let logits = tape.value(rolled.prior).row(k);
        let (total, shares) = ln_sum(logits);
        let ln = |mode: usize| {
            let truth = rolled.normals.iter().zip(&example.truth);
            logits[mode] - total - truth.map(|(now, at)| now[k * modes + mode].nats(*at)).sum::<f32>()
        };
        let (likely, posterior) = ln_sum(&(0..modes).map(ln).collect::<Vec<_>>());
        sum -= each * likely;
        for mode in 0..modes {
            prior.row_mut(k)[mode] = each * (shares[mode] - posterior[mode]);
            for ((now, to), at) in rolled.normals.iter().zip(&mut steps).zip(&example.truth) {
                let numbers = now[k * modes + mode].gradient(*at);
                let to = to.row_mut(k * modes + mode);
                to.iter_mut().zip(numbers).for_each(|(to, one)| *to = each * posterior[mode] * one);
            }
        }
    }
    let mut from = vec![(rolled.prior, prior)];
    from.extend(rolled.steps.into_iter().zip(steps));
    (sum, tape.back(from))
}
