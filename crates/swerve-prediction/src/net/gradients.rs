//! Comparison of gradients with central differences.

use super::Matrix;

/// A loss as a function of weights, with its gradients.
type Loss<'a> = &'a dyn Fn(&[Matrix]) -> (f32, Vec<Matrix>);

/// Compares the gradients of a loss with central differences by a sample of the weights.
pub(crate) fn check(weights: &[Matrix], of: Loss<'_>) {
    const STEP: f32 = 1e-3;
    let (_, gradients) = of(weights);
    let mut checked = 0;
    for k in 0..weights.len() {
        for j in (0..weights[k].values.len()).step_by(1 + weights[k].values.len() / 40) {
            let at = |by: f32| {
                let mut moved = weights.to_vec();
                moved[k].values[j] += by;
                of(&moved).0
            };
            let slope = (at(STEP) - at(-STEP)) / (2.0 * STEP);
            let found = gradients[k].values[j];
            let off = (slope - found).abs();
            assert!(
                off < 1e-2 + 0.03 * found.abs(),
                "matrix {k}, number {j}: {found}, by differences {slope}"
            );
            checked += usize::from(found.abs() > 1e-3);
        }
    }
    assert!(checked > weights.len(), "most gradients are not zero: {checked}");
}
