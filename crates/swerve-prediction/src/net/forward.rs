//! Inference of recurrent units without gradients: one fused operation per unit, without intermediate nodes.
//!
//! The exponential is a polynomial instead of `libm`'s, so that the compiler can vectorise it by four: only sums,
//! products and bit operations in a fixed order, the same on every machine. It differs from the one used in training
//! only by rounding.

use super::Matrix;

/// Limit of the exponent, beyond which the exponential is practically zero or infinite.
const FAR: f32 = 87.0;

/// Exponential function, with a relative error of at most 2e-7.
fn exp(x: f32) -> f32 {
    // Cody and Waite: x = k ln 2 + r, ln 2 in two parts.
    const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
    // Adding this rounds to a whole number.
    const ROUND: f32 = 12_582_912.0;
    let x = x.clamp(-FAR, FAR);
    let shifted = x * core::f32::consts::LOG2_E + ROUND;
    let k = shifted - ROUND;
    let r = (x - k * LN_2[0]) - k * LN_2[1];
    // Taylor series, economised as in Cephes.
    let mut sum = 1.987_569_1e-4;
    for factor in [1.398_2e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 5e-1] {
        sum = sum * r + factor;
    }
    let part = sum * (r * r) + r + 1.0;
    let power = f32::from_bits(((shifted.to_bits() as i32) << 23).wrapping_add(127 << 23) as u32);
    part * power
}

/// The logistic function.
fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

/// Hyperbolic tangent, with an error of at most 3e-7.
fn tanh(x: f32) -> f32 {
    2.0 / (1.0 + exp(-2.0 * x)) - 1.0
}

/// Weights and bias of a layer.
pub(super) type Weighed<'a> = [&'a Matrix; 2];

/// State of a recurrent unit after the input `x`.
pub(super) fn gru(x: &Matrix, memory: &Matrix, [gates, new]: [Weighed<'_>; 2]) -> Matrix {
    let (size, told) = (memory.columns, x.columns);
    let mut both = Matrix::zeros(x.rows, told + size);
    for k in 0..x.rows {
        let row = both.row_mut(k);
        row[..told].copy_from_slice(x.row(k));
        row[told..].copy_from_slice(memory.row(k));
    }
    let mut opened = both.times(gates[0]);
    biased(&mut opened, gates[1], sigmoid);
    for k in 0..x.rows {
        let reset = &opened.row(k)[size..];
        both.row_mut(k)[told..].iter_mut().zip(reset).for_each(|(old, reset)| *old *= reset);
    }
    let mut next = both.times(new[0]);
    biased(&mut next, new[1], tanh);
    for k in 0..x.rows {
        let (keep, old) = (&opened.row(k)[..size], memory.row(k));
        let row = next.row_mut(k).iter_mut().zip(keep).zip(old);
        row.for_each(|((next, keep), old)| *next = keep * old + (1.0 - keep) * *next);
    }
    next
}

fn biased(of: &mut Matrix, bias: &Matrix, bent: impl Fn(f32) -> f32) {
    for row in of.values.chunks_exact_mut(bias.values.len().max(1)) {
        row.iter_mut().zip(&bias.values).for_each(|(sum, bias)| *sum = bent(*sum + bias));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_match_libm_up_to_rounding() {
        for k in -8_700..=8_700 {
            let x = k as f32 * 0.01;
            let off = (f64::from(exp(x)) / libm::exp(f64::from(x)) - 1.0).abs();
            assert!(off < 2e-7, "{x}: {off}");
            assert!((tanh(x) - libm::tanhf(x)).abs() < 3e-7, "{x}");
            assert!((sigmoid(x) - 1.0 / (1.0 + libm::expf(-x))).abs() < 3e-7, "{x}");
        }
        for x in [f32::INFINITY, 1e30, f32::MAX] {
            assert_eq!((tanh(x), sigmoid(x), tanh(-x)), (1.0, 1.0, -1.0));
            assert!(sigmoid(-x) < 1e-37);
        }
        assert!(tanh(f32::NAN).is_nan() && sigmoid(f32::NAN).is_nan());
    }

    #[test]
    fn unit_without_gradients_matches_the_tape() {
        let mut shapes = super::super::Shapes::default();
        let unit = shapes.gru(3, 20);
        let weights = super::super::drawn(&shapes.list(), 5);
        let told = |seed: usize, rows: usize, columns: usize| {
            let value = |k: usize| libm::sinf((k * 7 + seed) as f32);
            Matrix::new(rows, columns, (0..rows * columns).map(value).collect())
        };
        let run = |mut tape: super::super::Tape<'_>| {
            let mut memory = tape.given(told(1, 5, 20));
            for step in 0..8 {
                let x = tape.given(told(step, 5, 3));
                memory = tape.gru(x, memory, &unit);
            }
            tape.value(memory).clone()
        };
        let (taped, forward) =
            (run(super::super::Tape::new(&weights)), run(super::super::Tape::forward(&weights)));
        for (a, b) in taped.values.iter().zip(&forward.values) {
            assert!((a - b).abs() < 1e-5, "{a} {b}");
        }
    }
}
