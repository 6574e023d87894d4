//! Adam (Kingma and Ba 2015) with gradient clipping.

use super::Matrix;

/// Largest norm of the gradient of all weights.
const NORM_MAX: f32 = 5.0;
const FIRST: f32 = 0.9;
const SECOND: f32 = 0.999;

/// State of the optimiser: moments of the gradients.
pub(crate) struct Adam {
    first: Vec<Matrix>,
    second: Vec<Matrix>,
    /// Remaining weight of the initial zeros in both moments.
    left: [f32; 2],
}

impl Adam {
    /// Initial state.
    pub(crate) fn new(weights: &[Matrix]) -> Self {
        let zeros: Vec<Matrix> = weights.iter().map(|one| Matrix::zeros(one.rows, one.columns)).collect();
        Self { first: zeros.clone(), second: zeros, left: [1.0; 2] }
    }

    /// Takes a step with this learning rate.
    pub(crate) fn step(&mut self, weights: &mut [Matrix], gradients: &[Matrix], rate: f32) {
        let squared: f32 = gradients.iter().flat_map(|one| &one.values).map(|one| one * one).sum();
        let by = if squared > NORM_MAX * NORM_MAX { NORM_MAX / squared.sqrt() } else { 1.0 };
        self.left = [self.left[0] * FIRST, self.left[1] * SECOND];
        let [first_share, second_share] = self.left.map(|left| 1.0 - left);
        let means = self.first.iter_mut().zip(&mut self.second);
        for ((weights, gradients), (first, second)) in weights.iter_mut().zip(gradients).zip(means) {
            let means = first.values.iter_mut().zip(&mut second.values);
            for ((weight, gradient), (first, second)) in
                weights.values.iter_mut().zip(&gradients.values).zip(means)
            {
                let gradient = by * gradient;
                *first = FIRST * *first + (1.0 - FIRST) * gradient;
                *second = SECOND * *second + (1.0 - SECOND) * gradient * gradient;
                *weight -= rate * (*first / first_share) / ((*second / second_share).sqrt() + 1e-8);
            }
        }
    }
}
