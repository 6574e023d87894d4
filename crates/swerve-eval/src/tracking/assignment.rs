//! Assignment of boxes to tracks in the order of SciPy, on which TrackEval's choice among equal boxes depends.

/// Pairs (row, column) with the largest sum of weights, in increasing order of rows.
///
/// `edges` are (row, column, weight > 0), each pair once; all other pairs have the weight 0 and are not returned. Of
/// several best assignments it is the one that `scipy.optimize.linear_sum_assignment(-weights)` returns: shortest
/// augmenting paths (Crouse 2016), with SciPy's order of rows and columns and its rounding.
pub(super) fn heaviest_pairs(
    rows: usize,
    columns: usize,
    edges: &[(usize, usize, f64)],
) -> Vec<(usize, usize)> {
    let is_tall = columns < rows;
    let (short, long) = if is_tall { (columns, rows) } else { (rows, columns) };
    let mut costs = vec![Vec::new(); short];
    for &(row, column, weight) in edges {
        let (s, l) = if is_tall { (column, row) } else { (row, column) };
        costs[s].push((l, -weight));
    }
    let mut paths = Paths::new(costs, long);
    (0..short).for_each(|row| paths.augment(row));
    let assigned = paths.column_of.iter().enumerate();
    let with_weight = assigned.filter_map(|(s, l)| l.filter(|l| paths.has_edge(s, *l)).map(|l| (s, l)));
    let mut pairs: Vec<_> = with_weight.map(|(s, l)| if is_tall { (l, s) } else { (s, l) }).collect();
    pairs.sort_unstable();
    pairs
}

/// State of the solver; at most as many rows as columns.
struct Paths {
    /// Columns and costs of each row; other costs are 0.
    costs: Vec<Vec<(usize, f64)>>,
    /// Costs of the row at hand.
    row_costs: Vec<f64>,
    row_price: Vec<f64>,
    column_price: Vec<f64>,
    column_of: Vec<Option<usize>>,
    row_of: Vec<Option<usize>>,
    /// Length of the shortest path to each column.
    distance: Vec<f64>,
    /// Row before each column on its shortest path.
    before: Vec<usize>,
}

impl Paths {
    fn new(costs: Vec<Vec<(usize, f64)>>, columns: usize) -> Self {
        let rows = costs.len();
        Self {
            costs,
            row_costs: vec![0.0; columns],
            row_price: vec![0.0; rows],
            column_price: vec![0.0; columns],
            column_of: vec![None; rows],
            row_of: vec![None; columns],
            distance: vec![f64::INFINITY; columns],
            before: vec![0; columns],
        }
    }

    fn has_edge(&self, row: usize, column: usize) -> bool {
        self.costs[row].iter().any(|(c, _)| *c == column)
    }

    /// Assigns one more row along the shortest augmenting path from it.
    fn augment(&mut self, start: usize) {
        self.distance.fill(f64::INFINITY);
        // In this order, a matrix of equal costs is solved by its diagonal.
        let mut open: Vec<usize> = (0..self.row_of.len()).rev().collect();
        let mut reached = Vec::new();
        let (mut row, mut length) = (start, 0.0);
        let sink = loop {
            let nearest = self.relax(row, length, &open);
            let column = open.swap_remove(nearest);
            length = self.distance[column];
            reached.push(column);
            match self.row_of[column] {
                Some(next) => row = next,
                None => break column,
            }
        };
        self.row_price[start] += length;
        for &column in &reached {
            if let Some(row) = self.row_of[column] {
                self.row_price[row] += length - self.distance[column];
            }
            self.column_price[column] -= length - self.distance[column];
        }
        let mut column = sink;
        loop {
            let row = self.before[column];
            self.row_of[column] = Some(row);
            let previous = self.column_of[row].replace(column);
            match previous {
                Some(previous) if row != start => column = previous,
                _ => break,
            }
        }
    }

    /// Shortens the paths to the open columns by way of `row`, at `length` from the start. Returns the place in `open`
    /// of the nearest column; of equally near ones the last free one, otherwise the first.
    fn relax(&mut self, row: usize, length: f64, open: &[usize]) -> usize {
        for &(column, cost) in &self.costs[row] {
            self.row_costs[column] = cost;
        }
        let (mut lowest, mut nearest) = (f64::INFINITY, 0);
        for (place, &column) in open.iter().enumerate() {
            let through = length + self.row_costs[column] - self.row_price[row] - self.column_price[column];
            if through < self.distance[column] {
                (self.distance[column], self.before[column]) = (through, row);
            }
            let distance = self.distance[column];
            if distance < lowest || (distance == lowest && self.row_of[column].is_none()) {
                (lowest, nearest) = (distance, place);
            }
        }
        for &(column, _) in &self.costs[row] {
            self.row_costs[column] = 0.0;
        }
        nearest
    }
}
