//! Maximum-weight matching of rows to columns.

/// Pairs (row, column) with the largest possible sum of weights, in increasing order of rows.
///
/// `edges` are (row, column, weight > 0), each pair once; rows and columns without an edge between them are never
/// paired. Optimal in `f64` without rounding of weights, and the same on every machine. Connected components are
/// solved separately by shortest augmenting paths (Jonker and Volgenant 1987), cubic in the size of the component.
pub fn heaviest_pairs(rows: usize, columns: usize, edges: &[(usize, usize, f64)]) -> Vec<(usize, usize)> {
    let mut parts = Parts((0..rows + columns).collect());
    for &(row, column, _) in edges {
        parts.join(row, rows + column);
    }
    let mut order: Vec<(usize, usize)> = (0..edges.len()).map(|e| (parts.root(edges[e].0), e)).collect();
    order.sort_unstable();
    let mut pairs = Vec::with_capacity(rows.min(columns));
    for part in order.chunk_by(|a, b| a.0 == b.0) {
        match part {
            [(_, e)] => pairs.push((edges[*e].0, edges[*e].1)),
            _ => solve(&part.iter().map(|(_, e)| edges[*e]).collect::<Vec<_>>(), &mut pairs),
        }
    }
    pairs.sort_unstable();
    pairs
}

/// Disjoint sets: the parent of each member; a root is its own parent.
struct Parts(Vec<usize>);

impl Parts {
    fn root(&mut self, mut of: usize) -> usize {
        while self.0[of] != of {
            self.0[of] = self.0[self.0[of]];
            of = self.0[of];
        }
        of
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b)] = a.min(b);
    }
}

/// Solves one component as a dense cost matrix in which a missing edge costs zero.
fn solve(edges: &[(usize, usize, f64)], pairs: &mut Vec<(usize, usize)>) {
    let sorted = |of: fn(&(usize, usize, f64)) -> usize| {
        let mut ids: Vec<usize> = edges.iter().map(of).collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    };
    let (rows, columns) = (sorted(|e| e.0), sorted(|e| e.1));
    let is_tall = rows.len() > columns.len();
    let (short, long) = if is_tall { (&columns, &rows) } else { (&rows, &columns) };
    let mut cost = vec![0.0; short.len() * long.len()];
    let place = |ids: &[usize], id: usize| ids.partition_point(|x| *x < id);
    for &(row, column, weight) in edges {
        let (s, l) = if is_tall { (column, row) } else { (row, column) };
        cost[place(short, s) * long.len() + place(long, l)] = -weight;
    }
    for (l, s) in cheapest(&cost, short.len(), long.len()).into_iter().enumerate() {
        if let Some(s) = s.filter(|s| cost[s * long.len() + l] < 0.0) {
            pairs.push(if is_tall { (long[l], short[s]) } else { (short[s], long[l]) });
        }
    }
}

/// Row of each column in the cheapest assignment of all rows; requires at most as many rows as columns.
fn cheapest(cost: &[f64], rows: usize, columns: usize) -> Vec<Option<usize>> {
    // The extra last column is the start of each augmenting path: it holds the row to be assigned.
    let mut row_of: Vec<Option<usize>> = vec![None; columns + 1];
    let (mut row_price, mut column_price) = (vec![0.0; rows], vec![0.0; columns + 1]);
    let mut before = vec![columns; columns];
    for row in 0..rows {
        row_of[columns] = Some(row);
        let mut distance = vec![f64::INFINITY; columns];
        let mut is_reached = vec![false; columns + 1];
        let mut at = columns;
        while let Some(from) = row_of[at] {
            is_reached[at] = true;
            let (mut step, mut next) = (f64::INFINITY, at);
            for column in (0..columns).filter(|c| !is_reached[*c]) {
                let reduced = cost[from * columns + column] - row_price[from] - column_price[column];
                if reduced < distance[column] {
                    (distance[column], before[column]) = (reduced, at);
                }
                if distance[column] < step {
                    (step, next) = (distance[column], column);
                }
            }
            for column in 0..=columns {
                match row_of[column].filter(|_| is_reached[column]) {
                    Some(r) => {
                        row_price[r] += step;
                        column_price[column] -= step;
                    }
                    None if column < columns => distance[column] -= step,
                    None => {}
                }
            }
            at = next;
        }
        while at != columns {
            row_of[at] = row_of[before[at]];
            at = before[at];
        }
    }
    row_of.truncate(columns);
    row_of
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest weight over all pairings, by brute force.
    fn most(weights: &[Vec<f64>], row: usize, taken: &mut Vec<bool>) -> f64 {
        let Some(own) = weights.get(row) else { return 0.0 };
        let mut best = most(weights, row + 1, taken);
        for (column, weight) in own.iter().enumerate() {
            if !taken[column] && *weight > 0.0 {
                taken[column] = true;
                best = best.max(weight + most(weights, row + 1, taken));
                taken[column] = false;
            }
        }
        best
    }

    #[test]
    fn heaviest_pairs_match_brute_force() {
        // A linear congruential generator (Knuth's constants): this crate does not depend on one.
        let mut state = 7_u64;
        let mut next = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / (1_u64 << 31) as f64
        };
        for k in 0..600 {
            let (rows, columns) = ((next() * 6.0) as usize, (next() * 6.0) as usize);
            let mut weight =
                || if next() < 0.5 { 0.0 } else { next() + if k % 3 == 0 { 1000.0 } else { 0.0 } };
            let weights: Vec<Vec<f64>> =
                (0..rows).map(|_| (0..columns).map(|_| weight()).collect()).collect();
            let cells = (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c)));
            let edges: Vec<_> =
                cells.map(|(r, c)| (r, c, weights[r][c])).filter(|(_, _, w)| *w > 0.0).collect();
            let pairs = heaviest_pairs(rows, columns, &edges);
            let mut taken = vec![false; columns];
            for &(_, c) in &pairs {
                assert!(!std::mem::replace(&mut taken[c], true), "{k}: {pairs:?}");
            }
            assert!(pairs.windows(2).all(|w| w[0].0 < w[1].0), "{k}: {pairs:?}");
            let sum: f64 = pairs.iter().map(|&(r, c)| weights[r][c]).sum();
            let best = most(&weights, 0, &mut vec![false; columns]);
            assert!((sum - best).abs() < 1e-9, "{k}: {sum} {best} {weights:?}");
            assert!(pairs.iter().all(|&(r, c)| weights[r][c] > 0.0));
        }
    }
}
