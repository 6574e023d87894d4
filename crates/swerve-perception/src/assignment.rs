//! Assignment at the least total cost.

use swerve_geom::heaviest_pairs;

/// Resolution of costs; sums of integers are exact.
const PART: f64 = 1e-6;

/// Upper limit of a cost, in parts: sums of a thousand such costs are still exact in `f64`.
const PARTS_MAX: f64 = 1e12;

/// Pairs (row, column), rows increasing, with the least sum of costs, where an unpaired row or column costs half of
/// `gate`: no pair costs `gate` or more (Kuhn 1955, Munkres 1957; gated as in Blackman and Popoli 1999, section 6.4).
///
/// `cost` is called for every row and column; non-finite costs are out of reach. Any shape is allowed.
pub fn assign(
    rows: usize,
    columns: usize,
    gate: f64,
    cost: impl Fn(usize, usize) -> f64,
) -> Vec<(usize, usize)> {
    let parts = |x: f64| (x / PART).clamp(-PARTS_MAX, PARTS_MAX).round();
    let far = parts(gate);
    let all = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
    let saved = |(row, column)| {
        let cost = cost(row, column);
        (row, column, if cost.is_finite() { far - parts(cost) } else { 0.0 })
    };
    // Minimising the cost is maximising the savings; an unpaired row or column saves nothing.
    let near: Vec<(usize, usize, f64)> = all.map(saved).filter(|(_, _, saved)| *saved > 0.0).collect();
    heaviest_pairs(rows, columns, &near)
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_core::Rng;

    /// Least cost over all assignments, by exhaustive search.
    fn least(costs: &[Vec<f64>], gate: f64, row: usize, taken: &mut Vec<bool>) -> f64 {
        if row == costs.len() {
            return 0.5 * gate * taken.iter().filter(|t| !**t).count() as f64;
        }
        let mut best = 0.5 * gate + least(costs, gate, row + 1, taken);
        for column in 0..taken.len() {
            if !taken[column] && costs[row][column] < gate {
                taken[column] = true;
                best = best.min(costs[row][column] + least(costs, gate, row + 1, taken));
                taken[column] = false;
            }
        }
        best
    }

    #[test]
    fn assign_finds_the_least_cost() {
        let mut rng = Rng::keyed(5, "assignment", &[]);
        for k in 0..300 {
            let (rows, columns) = (rng.below(5), rng.below(5));
            let gate = if k % 2 == 0 { 0.6 } else { 2.0 };
            let costs: Vec<Vec<f64>> =
                (0..rows).map(|_| (0..columns).map(|_| rng.uniform(-0.5, 1.5)).collect()).collect();
            let pairs = assign(rows, columns, gate, |r, c| costs[r][c]);
            let alone = (rows + columns - 2 * pairs.len()) as f64;
            let cost: f64 = pairs.iter().map(|&(r, c)| costs[r][c]).sum::<f64>() + 0.5 * gate * alone;
            let best = least(&costs, gate, 0, &mut vec![false; columns]);
            assert!((cost - best).abs() < 1e-5, "{k}: {cost} {best} {costs:?}");
            assert!(pairs.iter().all(|&(r, c)| costs[r][c] < gate));
        }
    }

    #[test]
    fn assign_leaves_non_finite_and_distant_costs_unpaired() {
        let costs = [[f64::NAN, 0.5, f64::INFINITY], [f64::NAN, f64::NEG_INFINITY, 7.0]];
        assert_eq!(assign(2, 3, 1.0, |r, c| costs[r][c]), [(0, 1)]);
        assert_eq!(assign(3, 2, 1.0, |r, c| costs[c][r]), [(1, 0)]);
        assert_eq!(assign(0, 3, 1.0, |_, _| 0.0), []);
    }
}
