//! A quadratic program for Clarabel: sparse, and condensed to rates and slacks.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SupportedConeT};
use swerve_control::mpc::Problem;

/// Variables of a step: rates, deviations of the state after it, slack.
const STEP: usize = 9;
const INPUTS: usize = 2;
const STATES: usize = 6;

/// `1/2 x' P x + q' x` with `A x = b` in the first rows and `A x <= b` in the others; dense.
pub(crate) struct Posed {
    cost: Vec<Vec<f64>>,
    q: Vec<f64>,
    a: Vec<Vec<f64>>,
    b: Vec<f64>,
    equalities: usize,
}

impl Posed {
    /// The problem in its original form.
    pub(crate) fn sparse(problem: &Problem) -> Self {
        let n = problem.q.len();
        let mut a = vec![vec![0.0; n]; problem.b.len()];
        for col in 0..n {
            for place in problem.columns[col]..problem.columns[col + 1] {
                a[problem.rows[place]][col] = problem.values[place];
            }
        }
        let mut cost = vec![vec![0.0; n]; n];
        for (k, &value) in problem.cost.iter().enumerate() {
            cost[k][k] = value;
        }
        let (q, b, equalities) = (problem.q.clone(), problem.b.clone(), problem.equalities);
        Self { cost, q, a, b, equalities }
    }

    /// The problem with the states eliminated: only rates and slacks remain, without equalities.
    pub(crate) fn condensed(problem: &Problem) -> Self {
        let whole = Self::sparse(problem);
        let horizon = problem.q.len() / STEP;
        let free = INPUTS + 1;
        // x = x0 + T y.
        let mut x0 = vec![0.0; STEP * horizon];
        let mut t = vec![vec![0.0; free * horizon]; STEP * horizon];
        for k in 0..horizon {
            for (i, own) in [0, 1, STEP - 1].into_iter().enumerate() {
                t[STEP * k + own][free * k + i] = 1.0;
            }
            for i in 0..STATES {
                // -z + a z_before + b u = right side
                let (row, at) = (&whole.a[STATES * k + i], STEP * k + INPUTS + i);
                let mut constant = -whole.b[STATES * k + i];
                let mut by = vec![0.0; free * horizon];
                let before = STEP * k.saturating_sub(1)..STEP * k + INPUTS;
                for col in before.filter(|&col| row[col] != 0.0) {
                    constant += row[col] * x0[col];
                    by.iter_mut().zip(&t[col]).for_each(|(to, from)| *to += row[col] * from);
                }
                (x0[at], t[at]) = (constant, by);
            }
        }
        let columns = free * horizon;
        let through = |row: &[f64]| -> Vec<f64> {
            let mut out = vec![0.0; columns];
            for (value, by) in row.iter().zip(&t).filter(|(value, _)| **value != 0.0) {
                out.iter_mut().zip(by).for_each(|(to, from)| *to += value * from);
            }
            out
        };
        let mut cost = vec![vec![0.0; columns]; columns];
        let mut slope = whole.q.clone();
        for (k, by) in t.iter().enumerate() {
            slope[k] += problem.cost[k] * x0[k];
            for i in 0..columns {
                for j in 0..columns {
                    cost[i][j] += problem.cost[k] * by[i] * by[j];
                }
            }
        }
        let inequalities = whole.a[whole.equalities..].iter().zip(&whole.b[whole.equalities..]);
        let (a, b) = inequalities
            .map(|(row, b)| (through(row), b - row.iter().zip(&x0).map(|(value, x)| value * x).sum::<f64>()))
            .unzip();
        Self { cost, q: through(&slope), a, b, equalities: 0 }
    }
}

/// Union of the sparsity patterns of several matrices, by columns; `upper` leaves out the part below the diagonal.
fn pattern<'a>(matrices: impl Iterator<Item = &'a Vec<Vec<f64>>>, upper: bool) -> Vec<Vec<usize>> {
    let mut columns: Vec<Vec<bool>> = Vec::new();
    for matrix in matrices {
        columns.resize(matrix[0].len(), vec![false; matrix.len()]);
        for (i, row) in matrix.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                columns[j][i] |= *value != 0.0 && (!upper || i <= j);
            }
        }
    }
    let rows = |column: Vec<bool>| (0..column.len()).filter(|&i| column[i]).collect();
    columns.into_iter().map(rows).collect()
}

fn values(matrix: &[Vec<f64>], pattern: &[Vec<usize>]) -> Vec<f64> {
    pattern.iter().enumerate().flat_map(|(j, rows)| rows.iter().map(move |&i| matrix[i][j])).collect()
}

fn matrix(nrows: usize, pattern: &[Vec<usize>], values: Vec<f64>) -> CscMatrix<f64> {
    let mut columns = vec![0];
    columns.extend(pattern.iter().scan(0, |sum, rows| {
        *sum += rows.len();
        Some(*sum)
    }));
    CscMatrix::new(nrows, pattern.len(), columns, pattern.concat(), values)
}

/// Numbers of one problem in the order of a solver's sparsity pattern.
pub(crate) struct Data {
    cost: Vec<f64>,
    q: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
}

/// A solver that keeps its symbolic factorisation, and its inputs in order.
pub(crate) struct Kept {
    solver: DefaultSolver<f64>,
    pub(crate) data: Vec<Data>,
}

impl Kept {
    /// Creates a solver for problems of one size, at the controller's tolerances.
    pub(crate) fn new(problems: &[Posed]) -> Self {
        let first = &problems[0];
        let cost = pattern(problems.iter().map(|problem| &problem.cost), true);
        let a = pattern(problems.iter().map(|problem| &problem.a), false);
        let data: Vec<Data> = problems
            .iter()
            .map(|problem| Data {
                cost: values(&problem.cost, &cost),
                q: problem.q.clone(),
                a: values(&problem.a, &a),
                b: problem.b.clone(),
            })
            .collect();
        let settings = DefaultSettings {
            verbose: false,
            max_iter: 50,
            presolve_enable: false,
            input_sparse_dropzeros: false,
            max_threads: 1,
            direct_solve_method: "qdldl".to_string(),
            tol_gap_abs: 1e-5,
            tol_gap_rel: 1e-5,
            tol_feas: 1e-6,
            iterative_refinement_reltol: 1e-8,
            iterative_refinement_abstol: 1e-8,
            ..DefaultSettings::default()
        };
        let (n, m) = (first.q.len(), first.b.len());
        let mut cones = vec![SupportedConeT::NonnegativeConeT(m - first.equalities)];
        if first.equalities > 0 {
            cones.insert(0, SupportedConeT::ZeroConeT(first.equalities));
        }
        let cost_matrix = matrix(n, &cost, data[0].cost.clone());
        let a_matrix = matrix(m, &a, data[0].a.clone());
        let solver = DefaultSolver::new(&cost_matrix, &data[0].q, &a_matrix, &data[0].b, &cones, settings)
            .expect("sizes agree");
        Self { solver, data }
    }

    /// Solves problem `k`; returns the steering rate of its first step.
    pub(crate) fn solve(&mut self, k: usize) -> f64 {
        let Data { cost, q, a, b } = &self.data[k];
        self.solver.update_P(cost).expect("presolve is off");
        self.solver.update_q(q).expect("presolve is off");
        self.solver.update_A(a).expect("presolve is off");
        self.solver.update_b(b).expect("presolve is off");
        self.solver.solve();
        self.solver.solution.x[0]
    }
}
