//! Examples for training.

use super::sight::Sight;
use super::straight_on;

/// An actor at one instant, with its observed future.
#[derive(Clone, PartialEq, Debug)]
pub struct Example {
    pub(crate) sight: Sight,
    /// Observed positions after each step, in the actor's frame.
    pub(crate) truth: Vec<[f32; 2]>,
    /// Observed positions of the nearby actors.
    pub(crate) others: Vec<Vec<[f32; 2]>>,
}

impl Example {
    /// Observed path relative to the baseline, x before y.
    pub(crate) fn beside(&self) -> Vec<f32> {
        let beside = |(step, at): (usize, &[f32; 2])| {
            let on = straight_on(&self.sight, step);
            [at[0] - on[0], at[1] - on[1]]
        };
        self.truth.iter().enumerate().flat_map(beside).collect()
    }
}
