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

    /// Begins of the records within a range, metres.
    pub(crate) fn begins(&self, range_m: [f64; 2]) -> impl Iterator<Item = f64> + '_ {
        begins(&self.0, |record| record.s_m, range_m)
    }
}

/// Begins of sorted records that are within a range, without its ends.
pub(crate) fn begins<T>(
    records: &[T],
    begin: fn(&T) -> f64,
    [from, to]: [f64; 2],
) -> impl Iterator<Item = f64> + '_ {
    let first = records.partition_point(|record| begin(record) <= from);
    records[first..].iter().map(begin).take_while(move |s_m| *s_m < to)
}

/// Sorted records that hold somewhere within a range: that at its begin, and those that begin in it.
pub(crate) fn holding<T>(records: &[T], begin: fn(&T) -> f64, [from, to]: [f64; 2]) -> &[T] {
    let first = records.partition_point(|record| begin(record) <= from).saturating_sub(1);
    let last = records.partition_point(|record| begin(record) < to);
    records.get(first..last).unwrap_or_default()
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
        assert_eq!(cubics.begins([2.0, 9.0]).collect::<Vec<_>>(), [4.0, 4.0]);
    }

    #[test]
    fn records_that_hold_within_a_range_begin_before_its_end() {
        let held = |from, to| holding(&[0.0, 10.0, 20.0], |s_m| *s_m, [from, to]).to_vec();
        assert_eq!(held(0.0, 10.0), [0.0]);
        assert_eq!(held(5.0, 15.0), [0.0, 10.0]);
        assert_eq!(held(10.0, 99.0), [10.0, 20.0]);
        assert_eq!(held(-9.0, -5.0), [0.0; 0]);
    }
}
