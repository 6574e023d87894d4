//! Fourier transform of 32 complex numbers, radix 2: twiddles by `libm`, so the same bits on every machine.

use swerve_geom::math;

/// Real and imaginary part.
pub(super) type Complex = [f32; 2];

/// How many numbers are transformed.
pub(super) const COUNT: usize = 32;

pub(super) fn times(a: Complex, b: Complex) -> Complex {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

pub(super) fn conjugate(a: Complex) -> Complex {
    [a[0], -a[1]]
}

/// The roots of unity.
#[derive(Clone, Debug)]
pub(super) struct Fourier([Complex; COUNT / 2]);

impl Fourier {
    pub(super) fn new() -> Self {
        Self(std::array::from_fn(|at| {
            let (sin, cos) = math::sin_cos(-std::f64::consts::TAU * at as f64 / COUNT as f64);
            [cos as f32, sin as f32]
        }))
    }

    /// Transforms 32 numbers in place.
    pub(super) fn line(&self, line: &mut [Complex]) {
        for at in 0..COUNT {
            let other = at.reverse_bits() >> (usize::BITS - COUNT.trailing_zeros());
            if at < other {
                line.swap(at, other);
            }
        }
        let mut half = 1;
        while half < COUNT {
            for block in line.chunks_exact_mut(2 * half) {
                let (low, high) = block.split_at_mut(half);
                for (at, (a, b)) in low.iter_mut().zip(high).enumerate() {
                    let turned = times(*b, self.0[at * (COUNT / 2 / half)]);
                    *b = [a[0] - turned[0], a[1] - turned[1]];
                    *a = [a[0] + turned[0], a[1] + turned[1]];
                }
            }
            half *= 2;
        }
    }

    /// Transforms 32 x 32 numbers in place.
    pub(super) fn square(&self, square: &mut [Complex]) {
        for _ in 0..2 {
            square.chunks_exact_mut(COUNT).for_each(|line| self.line(line));
            for y in 0..COUNT {
                for x in 0..y {
                    square.swap(y * COUNT + x, x * COUNT + y);
                }
            }
        }
    }
}
