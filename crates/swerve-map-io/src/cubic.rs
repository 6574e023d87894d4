//! Piecewise cubic polynomials over arc length.

/// A cubic polynomial from a position on: `a + b ds + c ds² + d ds³`.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) struct Cubic {
    /// Begin of the record along the road, metres.
    pub s_m: f64,
    /// Coefficients a, b, c, d; metres (or radians) and metres of `ds`.
    pub coefficients: [f64; 4],
}

impl Cubic {
    /// Value, first and second derivative at `ds` from the begin.
    pub(crate) fn at(&self, ds: f64) -> [f64; 3] {
        polynomial(&self.coefficients, ds)
    }
}

/// Value, first and second derivative of a cubic polynomial.
pub(crate) fn polynomial(&[a, b, c, d]: &[f64; 4], p: f64) -> [f64; 3] {
    [a + p * (b + p * (c + p * d)), b + p * (2.0 * c + p * 3.0 * d), 2.0 * c + 6.0 * d * p]
}

/// Records in ascending order, each up to the next; zero before the first.
#[derive(Clone, PartialEq, Debug, Default)]
pub(crate) struct Cubics(pub Vec<Cubic>);

/// Positions this close to a record's begin belong to it, metres.
pub(crate) const SAME_M: f64 = 1e-12;

impl Cubics {
    /// Value, first and second derivative at `s_m`.
    pub(crate) fn at(&self, s_m: f64) -> [f64; 3] {
        let next = self.0.partition_point(|record| record.s_m <= s_m + SAME_M);
        let record = next.checked_sub(1).map(|k| &self.0[k]);
        record.map_or([0.0; 3], |record| record.at(s_m - record.s_m))
    }

    /// Value at `s_m`.
    pub(crate) fn value(&self, s_m: f64) -> f64 {
        self.at(s_m)[0]
    }

    /// Begins of the records, metres.
    pub(crate) fn begins(&self) -> impl Iterator<Item = f64> + '_ {
        self.0.iter().map(|record| record.s_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_hold_up_to_the_next_and_nothing_before_the_first() {
        let record = |s_m, coefficients| Cubic { s_m, coefficients };
        let cubics = Cubics(vec![
            record(2.0, [1.0, 2.0, 3.0, 4.0]),
            record(4.0, [7.0, 0.0, 0.0, 0.0]),
            record(4.0, [8.0, 0.5, 0.0, 0.0]),
        ]);
        assert_eq!(cubics.at(1.9), [0.0; 3]);
        assert_eq!(cubics.at(3.0), [10.0, 20.0, 30.0]);
        assert_eq!((cubics.value(4.0), cubics.value(6.0)), (8.0, 9.0));
    }
}
