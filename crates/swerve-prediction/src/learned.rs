//! Predictors that are learnt: small nets after MultiPath (Chai et al. 2019), MFP (Tang and Salakhutdinov 2019) and R2P2
//! (Rhinehart et al. 2018), reduced to tens of thousands of weights and to what tracks tell: no map, no image.

mod mfp;
mod multipath;
mod r2p2;
mod sight;
#[cfg(test)]
mod tests;
mod train;

use serde::{Deserialize, Serialize};

pub use crate::net::{Weights, WeightsError};
pub(crate) use sight::{Frame, PAST, Sight, sights};
pub use train::{Example, Learning, LearningError, Progress, examples, train};

use crate::net::{Gru, Layer, Matrix, Node, Shapes, Tape};

/// Which net.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Model {
    /// Anchors with offsets and spreads, all at once.
    Multipath,
    /// Hidden modes, unrolled step by step, everybody minding the others of the same mode.
    Mfp,
    /// A policy of one step, whose noise makes samples of known density.
    R2p2,
}

/// What a net's paths are told beside.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Beside {
    /// Going straight on with the last steps' pace.
    #[default]
    Straight,
    /// The likeliest path of the three filters of [`PredictorName::Imm`](crate::PredictorName::Imm).
    Imm,
}

/// What a net is made of.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shape {
    /// Which net.
    pub model: Model,
    /// Modes; of `r2p2` the samples beside the path without noise.
    pub modes: usize,
    /// Numbers of a hidden layer.
    pub hidden: usize,
    /// Steps ahead.
    pub steps: usize,
    /// Between two steps, of the past and ahead, ms.
    pub step_ms: u32,
    /// What paths are told beside; not of `r2p2`, whose steps go on from the one before.
    #[serde(default)]
    pub beside: Beside,
}

impl Shape {
    /// What is out of range.
    pub(crate) fn check(&self) -> Result<(), String> {
        let within = |name: &str, found: usize, [low, high]: [usize; 2]| {
            let fits = (low..=high).contains(&found);
            fits.then_some(()).ok_or_else(|| format!("`{name}` is {found}, expected {low} to {high}"))
        };
        if self.model == Model::R2p2 && self.beside != Beside::Straight {
            return Err("`beside`: `r2p2` goes on step by step, expected `straight`".to_owned());
        }
        within("modes", self.modes, [1, 32])?;
        within("hidden", self.hidden, [4, 256])?;
        within("steps", self.steps, [1, 64])?;
        within("step_ms", self.step_ms as usize, [50, 2000])
    }

    /// How many anchors, of how many numbers each.
    pub(crate) fn anchors(&self) -> [usize; 2] {
        match self.model {
            Model::Multipath => [self.modes, 2 * self.steps],
            _ => [0, 0],
        }
    }

    pub(crate) fn step_s(&self) -> f64 {
        f64::from(self.step_ms) * 1e-3
    }
}

/// One way on, in the actor's own frame and scale.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Way {
    pub(crate) probability: f32,
    /// Place and covariance xx, xy, yy after each step.
    pub(crate) places: Vec<([f32; 2], [f32; 3])>,
}

/// The layers of a net.
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
    /// How everybody who is seen may go on.
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

/// A deviation that is expected of a net before it has learnt, after so many steps: its logarithm, in the scale.
fn ln_sigma(step: usize) -> f32 {
    libm::logf(0.03 + 0.06 * (step + 1) as f32)
}

/// What is left of a pace after a step: nobody goes straight on for ever.
const LEFT: f32 = 0.99;

/// Where who goes on as was expected is after so many steps: straight, or as filters have it.
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

/// Numbers of the past of each, a row each.
fn pasts(sights: &[&Sight]) -> Matrix {
    let rows = sights.iter().flat_map(|sight| sight.own.iter().copied().chain([sight.wheels]));
    Matrix::new(sights.len(), 2 * (PAST - 1) + 1, rows.collect())
}

/// What is told of somebody near: how far away, how fast relative to oneself, whether on wheels, and how close.
const NEAR: usize = 6;

fn near_row(at: [f32; 2], relative: [f32; 2], wheels: f32) -> [f32; NEAR] {
    let far = (at[0] * at[0] + at[1] * at[1]).sqrt();
    [0.3 * at[0], 0.3 * at[1], 2.0 * relative[0], 2.0 * relative[1], wheels, 1.0 / (0.3 + far)]
}

/// What a unit remembers of each one's past.
fn remembered(tape: &mut Tape<'_>, sights: &[&Sight], past: &Gru) -> Node {
    let mut memory = tape.given(Matrix::zeros(sights.len(), past.size()));
    for k in 0..PAST - 1 {
        let told = sights.iter().flat_map(|one| [one.own[2 * k], one.own[2 * k + 1], one.wheels]);
        let told = tape.given(Matrix::new(sights.len(), 3, told.collect()));
        memory = tape.gru(told, memory, past);
    }
    memory
}

/// The largest answers of a layer about those who are near each.
fn minded_near(tape: &mut Tape<'_>, sights: &[&Sight], layer: Layer) -> Node {
    let (near, groups) = nears(sights);
    let near = tape.given(near);
    let near = tape.linear(near, layer);
    let near = tape.relu(near);
    tape.largest(near, &groups)
}

/// Everybody near, a row each, and whose rows are whose.
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
