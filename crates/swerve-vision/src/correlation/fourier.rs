//! Radix-2 Fourier transform of 32 complex numbers, for many lines in parallel. Twiddle factors come from `libm`, so
//! results are bit-identical on every machine.

use swerve_geom::math;
use swerve_geom::simd::widest;

/// Real and imaginary parts in separate arrays.
#[derive(Clone, Debug, Default)]
pub(super) struct Numbers {
    pub(super) re: Vec<f32>,
    pub(super) im: Vec<f32>,
}

impl Numbers {
    /// Resizes to `count` zeros.
    pub(super) fn clear(&mut self, count: usize) {
        for part in [&mut self.re, &mut self.im] {
            part.clear();
            part.resize(count, 0.0);
        }
    }
}

/// Length of the transform.
pub(super) const COUNT: usize = 32;

/// Roots of unity.
#[derive(Clone, Debug)]
pub(super) struct Fourier([[f32; 2]; COUNT / 2]);

impl Fourier {
    pub(super) fn new() -> Self {
        Self(std::array::from_fn(|at| {
            let (sin, cos) = math::sin_cos(-std::f64::consts::TAU * at as f64 / COUNT as f64);
            [cos as f32, sin as f32]
        }))
    }

    /// Transforms lines of 32 numbers in place; stored interleaved: the first number of each line, then the second,
    /// etc.
    pub(super) fn lines(&self, numbers: &mut Numbers) {
        widest(
            #[inline(always)]
            || self.transform(&mut numbers.re, &mut numbers.im),
        );
    }

    /// Transforms squares of 32 x 32 numbers in place; stored interleaved: the first number of each square, then the
    /// next of its row.
    pub(super) fn squares(&self, numbers: &mut Numbers) {
        let row = numbers.re.len() / COUNT;
        widest(
            #[inline(always)]
            || {
                self.transform(&mut numbers.re, &mut numbers.im);
                for (re, im) in numbers.re.chunks_exact_mut(row).zip(numbers.im.chunks_exact_mut(row)) {
                    self.transform(re, im);
                }
            },
        );
    }

    #[inline(always)]
    fn transform(&self, re: &mut [f32], im: &mut [f32]) {
        let lines = re.len() / COUNT;
        for at in 0..COUNT {
            let other = at.reverse_bits() >> (usize::BITS - COUNT.trailing_zeros());
            if at < other {
                for part in [&mut *re, &mut *im] {
                    let (low, high) = part.split_at_mut(other * lines);
                    low[at * lines..][..lines].swap_with_slice(&mut high[..lines]);
                }
            }
        }
        let mut half = 1;
        while half < COUNT {
            let blocks = re.chunks_exact_mut(2 * half * lines).zip(im.chunks_exact_mut(2 * half * lines));
            for (re, im) in blocks {
                let ((low_re, high_re), (low_im, high_im)) =
                    (re.split_at_mut(half * lines), im.split_at_mut(half * lines));
                let low = low_re.chunks_exact_mut(lines).zip(low_im.chunks_exact_mut(lines));
                let high = high_re.chunks_exact_mut(lines).zip(high_im.chunks_exact_mut(lines));
                for (at, (low, high)) in low.zip(high).enumerate() {
                    butterflies(self.0[at * (COUNT / 2 / half)], low, high);
                }
            }
            half *= 2;
        }
    }
}

/// Real and imaginary parts of one element of each line.
type Parts<'a> = (&'a mut [f32], &'a mut [f32]);

#[inline(always)]
fn butterflies([cos, sin]: [f32; 2], low: Parts<'_>, high: Parts<'_>) {
    let (low, high) = (low.0.iter_mut().zip(low.1), high.0.iter_mut().zip(high.1));
    for ((low_re, low_im), (high_re, high_im)) in low.zip(high) {
        let re = *high_re * cos - *high_im * sin;
        let im = *high_re * sin + *high_im * cos;
        (*high_re, *high_im) = (*low_re - re, *low_im - im);
        (*low_re, *low_im) = (*low_re + re, *low_im + im);
    }
}
