//! Hyperparameters and weights of nets.

use serde::{Deserialize, Serialize};

use crate::net::Matrix;

/// Architecture of a net.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Model {
    /// Anchors with offsets and covariances, in a single pass.
    Multipath,
    /// Latent modes, unrolled step by step, with attention to the other actors of the same mode.
    Mfp,
    /// A one-step policy whose noise yields samples of known density.
    R2p2,
}

/// Baseline to which the paths of a net are relative.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Beside {
    /// Straight motion at the pace of the last steps.
    #[default]
    Straight,
    /// Likeliest path of the three filters of [`PredictorName::Imm`](crate::PredictorName::Imm).
    Imm,
}

/// Hyperparameters of a net.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shape {
    /// Architecture.
    pub model: Model,
    /// Number of modes; for `r2p2` the samples beside the path without noise.
    pub modes: usize,
    /// Width of the hidden layers.
    pub hidden: usize,
    /// Number of predicted steps.
    pub steps: usize,
    /// Step of the past and of the prediction, ms.
    pub step_ms: u32,
    /// Baseline of the paths; unused by `r2p2`, whose steps are relative to the previous one.
    #[serde(default)]
    pub beside: Beside,
}

impl Shape {
    /// Checks the ranges; the error names the first invalid number.
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

    /// Number of anchors, and numbers per anchor.
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

/// A trained predictor.
#[derive(Clone, PartialEq, Debug)]
pub struct Weights {
    /// Description of its origin.
    pub source: String,
    /// Hyperparameters.
    pub shape: Shape,
    /// Initial paths of the modes: position at each step relative to the baseline, x before y, in scaled units.
    pub(crate) anchors: Vec<Vec<f32>>,
    /// Matrices layer by layer, as given by the shape.
    pub(crate) matrices: Vec<Matrix>,
}

impl Weights {
    /// Number of weights.
    pub fn count(&self) -> usize {
        self.matrices.iter().map(|one| one.values.len()).sum()
    }
}
