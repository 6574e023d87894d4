//! Filter consistency: squared errors (NEES) or innovations (NIS), normalized by their covariance, whose mean over
//! independent runs has known bounds (Bar-Shalom, Li and Kirubarajan 2001, section 5.4).

use serde::Serialize;
use swerve_geom::math;

/// Mean of the normalized squares, one per run.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize)]
pub struct Consistency {
    /// Dimension of the error.
    dof: u32,
    runs: u32,
    sum: f64,
}

impl Consistency {
    /// Creates an accumulator for errors of dimension `dof`.
    pub fn new(dof: u32) -> Self {
        Self { dof, ..Self::default() }
    }

    /// Adds the normalized square of one run.
    pub fn add(&mut self, square: f64) {
        self.runs += 1;
        self.sum += square;
    }

    /// Mean; `dof` for a consistent filter. `None` without runs.
    pub fn mean(&self) -> Option<f64> {
        (self.runs > 0).then(|| self.sum / f64::from(self.runs))
    }

    /// 95 % interval of the mean for a consistent filter: quantiles of chi-square over the number of runs, by Wilson
    /// and Hilferty (1931), accurate to 0.2 % from 30 degrees of freedom in total.
    pub fn bounds(&self) -> [f64; 2] {
        let (runs, k) = (f64::from(self.runs.max(1)), f64::from(self.dof) * f64::from(self.runs.max(1)));
        let spread = 2.0 / (9.0 * k);
        [-1.959_964, 1.959_964]
            .map(|z| k * math::pow((1.0 - spread + z * spread.sqrt()).max(0.0), 3.0) / runs)
    }

    /// True if the mean is within its bounds.
    pub fn holds(&self) -> bool {
        let [low, high] = self.bounds();
        self.mean().is_some_and(|mean| (low..=high).contains(&mean))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tables of chi-square, e.g. 74.22 to 129.56 at 100 degrees of freedom.
    #[test]
    fn bounds_match_chi_square_tables() {
        for (dof, low, high) in [(2, 1.484, 2.591), (3, 2.360, 3.716), (15, 13.52, 16.56)] {
            let mut consistency = Consistency::new(dof);
            (0..50).for_each(|_| consistency.add(f64::from(dof)));
            let [ours_low, ours_high] = consistency.bounds();
            assert!(
                (ours_low - low).abs() < 5e-3 && (ours_high - high).abs() < 5e-3,
                "{dof}: {ours_low} {ours_high}"
            );
            assert!(consistency.holds());
            (0..50).for_each(|_| consistency.add(3.0 * f64::from(dof)));
            assert!(!consistency.holds());
        }
        assert!(!Consistency::new(2).holds(), "no estimate yet");
    }
}
