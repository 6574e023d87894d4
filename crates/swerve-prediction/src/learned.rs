//! Learned predictors: small nets after MultiPath (Chai et al. 2019), MFP (Tang and Salakhutdinov 2019) and R2P2
//! (Rhinehart et al. 2018), reduced to tens of thousands of weights and to tracks as input, without map or image.

mod example;
mod file;
mod mfp;
mod multipath;
mod r2p2;
mod shape;
mod sight;
#[cfg(test)]
mod tests;
mod train;

pub use example::Example;
pub use file::WeightsError;
pub use shape::{Beside, Model, Shape, Weights};
pub(crate) use sight::{Frame, PAST, Sight, sights};
pub use train::{Learning, LearningError, Progress, examples, train};

use crate::net::{Gru, Layer, Matrix, Node, Shapes, Tape};

/// A predicted path in the actor's frame and scale.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Way {
    pub(crate) probability: f32,
    /// Position and covariance xx, xy, yy after each step.
    pub(crate) places: Vec<([f32; 2], [f32; 3])>,
}

/// Layers of a net.
#[derive(Debug)]
pub(crate) enum Net {
    Multipath(multipath::Layers),
    Mfp(mfp::Layers),
    R2p2(r2p2::Layers),
}

impl Net {
    pub(crate) fn of(shape: &Shape, shapes: &mut Shapes) -> Self {
        match shape.model {
            Model::Multipath => Self::Multipath(multipath::Layers::of(shape, shapes)),
            Model::Mfp => Self::Mfp(mfp::Layers::of(shape, shapes)),
            Model::R2p2 => Self::R2p2(r2p2::Layers::of(shape, shapes)),
        }
    }

    /// Shapes of all matrices.
    pub(crate) fn shapes(shape: &Shape) -> Vec<[usize; 2]> {
        let mut shapes = Shapes::default();
        Self::of(shape, &mut shapes);
        shapes.list()
    }
}

impl Weights {
    /// Predicts paths of all observed actors.
    pub(crate) fn ways(&self, sights: &[Sight]) -> Vec<Vec<Way>> {
        if sights.is_empty() {
            return Vec::new();
        }
        match Net::of(&self.shape, &mut Shapes::default()) {
            Net::Multipath(layers) => multipath::ways(&layers, self, sights),
            Net::Mfp(layers) => mfp::ways(&layers, self, sights),
            Net::R2p2(layers) => r2p2::ways(&layers, self, sights),
        }
    }
}

/// Logarithm of the initial standard deviation after `step` + 1 steps, in scaled units.
fn ln_sigma(step: usize) -> f32 {
    libm::logf(0.03 + 0.06 * (step + 1) as f32)
}

/// Decay of the pace per step for straight motion.
const LEFT: f32 = 0.99;

/// Baseline position after `step` + 1 steps: straight motion, or the filters' prediction.
fn straight_on(sight: &Sight, step: usize) -> [f32; 2] {
    if let Some(at) = sight.expected.get(step) {
        return *at;
    }
    let (mut far, mut pace) = (0.0, 1.0);
    for _ in 0..=step {
        pace *= LEFT;
        far += pace;
    }
    sight.pace().map(|one| one * far)
}

/// Features of the past of each actor, one row each.
fn pasts(sights: &[&Sight]) -> Matrix {
    let rows = sights.iter().flat_map(|sight| sight.own.iter().copied().chain([sight.wheels]));
    Matrix::new(sights.len(), 2 * (PAST - 1) + 1, rows.collect())
}

/// Number of features of a nearby actor: relative position and velocity, on wheels or not, and proximity.
const NEAR: usize = 6;

fn near_row(at: [f32; 2], relative: [f32; 2], wheels: f32) -> [f32; NEAR] {
    let far = (at[0] * at[0] + at[1] * at[1]).sqrt();
    [0.3 * at[0], 0.3 * at[1], 2.0 * relative[0], 2.0 * relative[1], wheels, 1.0 / (0.3 + far)]
}

/// Encodes each actor's past by a recurrent unit.
fn remembered(tape: &mut Tape<'_>, sights: &[&Sight], past: &Gru) -> Node {
    let mut memory = tape.given(Matrix::zeros(sights.len(), past.size()));
    for k in 0..PAST - 1 {
        let told = sights.iter().flat_map(|one| [one.own[2 * k], one.own[2 * k + 1], one.wheels]);
        let told = tape.given(Matrix::new(sights.len(), 3, told.collect()));
        memory = tape.gru(told, memory, past);
    }
    memory
}

/// Encodes the nearby actors of each actor: maximum over the outputs of a layer.
fn minded_near(tape: &mut Tape<'_>, sights: &[&Sight], layer: Layer) -> Node {
    let (near, groups) = nears(sights);
    let near = tape.given(near);
    let near = tape.linear(near, layer);
    let near = tape.relu(near);
    tape.largest(near, &groups)
}

/// Features of all nearby actors, one row each, and the range of rows of each actor.
fn nears(sights: &[&Sight]) -> (Matrix, Vec<core::ops::Range<usize>>) {
    let (mut values, mut groups, mut rows) = (Vec::new(), Vec::new(), 0);
    for sight in sights {
        let pace = sight.pace();
        for near in &sight.near {
            let relative = [near.pace[0] - pace[0], near.pace[1] - pace[1]];
            values.extend(near_row(near.at, relative, near.wheels));
        }
        groups.push(rows..rows + sight.near.len());
        rows += sight.near.len();
    }
    (Matrix::new(rows, NEAR, values), groups)
}
