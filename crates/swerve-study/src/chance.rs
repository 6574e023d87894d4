//! Statistics of rates from few runs: confidence intervals, and tests for a difference.

/// The 95 % interval of a rate (E. B. Wilson, "Probable inference", 1927); also valid if none or all of few runs hit.
pub(crate) fn wilson(hits: usize, runs: usize) -> (f64, f64) {
    if runs == 0 {
        return (0.0, 1.0);
    }
    let (n, z) = (runs as f64, 1.959_963_984_540_054);
    let p = hits as f64 / n;
    let middle = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    ((middle - half).max(0.0), (middle + half).min(1.0))
}

/// The 95 % interval of a rate, as printed behind a count in tables.
pub(crate) fn interval(hits: usize, runs: usize) -> String {
    let (low, high) = wilson(hits, runs);
    format!("({low:.2}-{high:.2})")
}

/// Probability of pairs at least as unequal as these if both sides were equal: the exact test of McNemar, two-sided (Q.
/// McNemar, "Note on the sampling error of the difference between correlated proportions or percentages", 1947). The
/// arguments are the numbers of pairs in which only the one and only the other side hit.
pub(crate) fn mcnemar(one: usize, other: usize) -> f64 {
    let (n, least) = (one + other, one.min(other));
    // Terms of the binomial distribution for one half, each from the previous one.
    let mut term = 0.5_f64.powi(n.min(1000) as i32);
    let mut tail = 0.0;
    for k in 0..=least {
        tail += term;
        term *= (n - k) as f64 / (k + 1) as f64;
    }
    (2.0 * tail).min(1.0)
}

/// Quantile of Student's t distribution for two-sided 95 % intervals; above nine degrees of freedom by the expansion in
/// powers of their inverse (Abramowitz and Stegun 26.7.5).
pub(crate) fn student_95(degrees: usize) -> f64 {
    const FEW: [f64; 9] = [12.7062, 4.3027, 3.1824, 2.7764, 2.5706, 2.4469, 2.3646, 2.3060, 2.2622];
    if let Some(quantile) = FEW.get(degrees.saturating_sub(1)) {
        return *quantile;
    }
    let (n, z) = (degrees as f64, 1.959_963_984_540_054_f64);
    let (z3, z5, z7) = (z.powi(3), z.powi(5), z.powi(7));
    let third = (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / (384.0 * n * n * n);
    z + (z3 + z) / (4.0 * n) + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * n * n) + third
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_match_wilson() {
        // Published values of the interval: 0 of 10, 17 of 30, all of 30.
        for (hits, runs, low, high) in [(0, 10, 0.0, 0.278), (17, 30, 0.392, 0.726), (30, 30, 0.886, 1.0)] {
            let interval = wilson(hits, runs);
            assert!((interval.0 - low).abs() < 1e-3 && (interval.1 - high).abs() < 1e-3, "{interval:?}");
        }
        assert_eq!(wilson(0, 0), (0.0, 1.0));
        assert_eq!(interval(17, 30), "(0.39-0.73)");
    }

    #[test]
    fn p_values_match_mcnemar() {
        // Sums of binomial coefficients over a power of two.
        for (one, other, likelihood) in [
            (0, 0, 1.0),
            (1, 0, 1.0),
            (0, 5, 0.0625),
            (0, 6, 0.031_25),
            (2, 9, 134.0 / 2048.0),
            (10, 10, 1.0),
            (15, 30, 0.035_698),
        ] {
            assert!(
                (mcnemar(one, other) - likelihood).abs() < 1e-6,
                "{one} {other}: {}",
                mcnemar(one, other)
            );
            assert_eq!(mcnemar(other, one), mcnemar(one, other));
        }
    }

    #[test]
    fn quantiles_of_student_are_those_of_its_tables() {
        for (degrees, quantile) in
            [(1, 12.7062), (5, 2.5706), (10, 2.2281), (19, 2.0930), (49, 2.0096), (1000, 1.9623)]
        {
            assert!((student_95(degrees) - quantile).abs() < 5e-4, "{degrees}: {}", student_95(degrees));
        }
    }
}
