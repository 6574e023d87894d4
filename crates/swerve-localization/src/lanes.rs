//! Vectors of four numbers, with operations whose bits are the same on every processor.

use core::ops::{Add, AddAssign, Mul, Sub};

/// Number of lanes.
pub(crate) const LANES: usize = 4;

/// A vector of four numbers.
#[derive(Clone, Copy, Default, Debug)]
pub(crate) struct Lanes([f64; LANES]);

impl Lanes {
    /// The same number in each lane.
    #[inline(always)]
    pub(crate) fn all(x: f64) -> Self {
        Self([x; LANES])
    }

    /// Loads four numbers of a row from an index on.
    #[inline(always)]
    pub(crate) fn of<const N: usize>(row: &[f64; N], from: usize) -> Self {
        Self([row[from], row[from + 1], row[from + 2], row[from + 3]])
    }

    /// Stores the lanes to a row.
    #[inline(always)]
    pub(crate) fn put<const N: usize>(self, row: &mut [f64; N], from: usize) {
        row[from..from + LANES].copy_from_slice(&self.0);
    }

    /// Sum of all lanes, added pairwise.
    #[inline(always)]
    pub(crate) fn sum(self) -> f64 {
        let [a, b, c, d] = self.0;
        (a + b) + (c + d)
    }

    /// Exponential function for numbers up to 0, with a relative error of at most 1e-11; 0 for numbers up to `least`,
    /// which must be above -700, and for NaN.
    ///
    /// `x = k ln 2 + f` with a whole `k`; `exp f` is a polynomial, and `2^k` is added to the exponent's bits.
    #[inline(always)]
    pub(crate) fn exp_above(self, least: f64) -> Self {
        // Adding this rounds to a whole number, which is then in the last bits of the mantissa.
        const ROUND: f64 = 6_755_399_441_055_744.0;
        const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];
        // 1/n! for n from 9 down to 0.
        const TAYLOR: [f64; 10] = [
            1.0 / 362_880.0,
            1.0 / 40_320.0,
            1.0 / 5_040.0,
            1.0 / 720.0,
            1.0 / 120.0,
            1.0 / 24.0,
            1.0 / 6.0,
            0.5,
            1.0,
            1.0,
        ];
        let rounded = self * Self::all(core::f64::consts::LOG2_E) + Self::all(ROUND);
        let whole = rounded - Self::all(ROUND);
        let rest = self - whole * Self::all(LN_2[0]) - whole * Self::all(LN_2[1]);
        let mut series = Self::all(TAYLOR[0]);
        for term in &TAYLOR[1..] {
            series = series * rest + Self::all(*term);
        }
        let scaled = |l: usize| series.0[l].to_bits().wrapping_add(rounded.0[l].to_bits() << 52);
        let mask = |l: usize| if self.0[l] > least { u64::MAX } else { 0 };
        let (scaled, mask) =
            ([scaled(0), scaled(1), scaled(2), scaled(3)], [mask(0), mask(1), mask(2), mask(3)]);
        let of = |l: usize| f64::from_bits(scaled[l] & mask[l]);
        Self([of(0), of(1), of(2), of(3)])
    }
}

impl Add for Lanes {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        Self([a + e, b + f, c + g, d + h])
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Lanes {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        Self([a - e, b - f, c - g, d - h])
    }
}

impl Mul for Lanes {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        Self([a * e, b * f, c * g, d * h])
    }
}

#[cfg(test)]
mod tests {
    use swerve_geom::math;

    use super::*;

    #[test]
    fn exponential_agrees_with_libm_and_is_zero_below_its_least() {
        for k in 0..20_000 {
            let x = [0.0, 0.3, 0.5, 0.9].map(|part| -0.001 * (f64::from(k) + part));
            let found = Lanes(x).exp_above(-20.0);
            for (x, found) in x.into_iter().zip(found.0) {
                let exact = math::exp(x);
                assert!(((found - exact) / exact).abs() < 1e-11, "{x}: {found} {exact}");
            }
        }
        let nothing = Lanes([-20.0, f64::NAN, -1e300, f64::NEG_INFINITY]).exp_above(-20.0);
        assert_eq!(nothing.0, [0.0; LANES]);
        assert_eq!(Lanes([0.0, -0.0, -1e-300, 0.0]).exp_above(-20.0).0, [1.0; LANES]);
    }
}
