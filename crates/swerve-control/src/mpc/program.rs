//! The quadratic program in sparse form, and Clarabel as its solver.
//!
//! Equalities are the linearised steps; inequalities follow in the order of [`Stage::limits`]. Only `q`, the values of
//! `A` and `b` change between calls, so that Clarabel keeps its symbolic factorisation.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

use serde::{Deserialize, Serialize};

use super::model::{N_INPUTS, N_STATES};
use super::stages::{INEQUALITIES, Stage, Stages, Values};

/// Rates, deviations and slack of one step.
const VARIABLES: usize = N_INPUTS + N_STATES + 1;

/// Values that change between calls: `q`, the values of `A` by columns, and `b`.
#[derive(Clone, Debug, Default, PartialEq)]
struct Data {
    q: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
}

/// A program of fixed size with its solver and buffers.
pub(crate) struct Program {
    solver: DefaultSolver<f64>,
    /// Index among the values of `A` for each entry emitted by [`visit`].
    places: Vec<usize>,
    columns: Vec<usize>,
    rows: Vec<usize>,
    data: Data,
}

impl Program {
    /// Creates a solver for programs of this size, scaled on this fixed program, so that later results do not depend on
    /// the first program solved.
    pub(crate) fn new(stages: &Stages, settings: DefaultSettings<f64>) -> Self {
        let horizon = stages.steps.len();
        let (n, m) = (VARIABLES * horizon, (N_STATES + INEQUALITIES) * horizon);
        let mut entries: Vec<(usize, usize, f64)> = Vec::new();
        visit(stages, |row, col, value| entries.push((row, col, value)));
        let (matrix, places) = compress(&entries, m, n);
        let mut data = Data { q: vec![0.0; n], a: matrix.nzval.clone(), b: vec![0.0; m] };
        fill(stages, &places, &mut data);
        let cones = [
            SupportedConeT::ZeroConeT(N_STATES * horizon),
            SupportedConeT::NonnegativeConeT(INEQUALITIES * horizon),
        ];
        let solver = DefaultSolver::new(&diagonal(stages), &data.q, &matrix, &data.b, &cones, settings)
            .expect("sizes agree by construction and the settings are checked");
        Self { solver, places, columns: matrix.colptr, rows: matrix.rowval, data }
    }

    /// Solves a program. The solution is valid only if the status is solved.
    pub(crate) fn solve(&mut self, stages: &Stages) -> (SolverStatus, u32) {
        fill(stages, &self.places, &mut self.data);
        let Data { q, a, b } = &self.data;
        self.solver.update_q(q).expect("presolve is off and sizes are fixed");
        self.solver.update_A(a).expect("presolve is off and the sparsity is fixed");
        self.solver.update_b(b).expect("presolve is off and sizes are fixed");
        self.solver.solve();
        (self.solver.solution.status, self.solver.solution.iterations)
    }

    /// Rates, deviations and slack of each step in the last solution.
    pub(crate) fn solution(&self) -> impl Iterator<Item = (Values, f64)> {
        self.solver.solution.x.chunks_exact(VARIABLES).map(|x| {
            let mut values = Values::default();
            values.inputs.copy_from_slice(&x[..N_INPUTS]);
            values.states.copy_from_slice(&x[N_INPUTS..N_INPUTS + N_STATES]);
            (values, x[VARIABLES - 1])
        })
    }

    #[cfg(test)]
    pub(crate) fn limit_iterations(&mut self, n: u32) {
        let mut settings = self.solver.settings().clone();
        settings.max_iter = n;
        self.solver.update_settings(settings).unwrap();
    }

    /// Returns a program in sparse form.
    pub(crate) fn problem(&self, stages: &Stages) -> Problem {
        let mut data = self.data.clone();
        fill(stages, &self.places, &mut data);
        let Data { q, a, b } = data;
        Problem {
            cost: diagonal(stages).nzval,
            q,
            columns: self.columns.clone(),
            rows: self.rows.clone(),
            values: a,
            b,
            equalities: N_STATES * stages.steps.len(),
        }
    }
}

/// A problem in solver form: minimise `1/2 x' P x + q' x` with `A x = b` in the first rows and `A x <= b` in the
/// others. For inspection, and to pass it to other solvers.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Problem {
    /// Diagonal of `P`, which has no other entries.
    pub cost: Vec<f64>,
    /// Linear cost.
    pub q: Vec<f64>,
    /// Compressed columns of `A`: start index of each column.
    pub columns: Vec<usize>,
    /// Row of each value.
    pub rows: Vec<usize>,
    /// Values of `A`, including structural zeros.
    pub values: Vec<f64>,
    /// Right sides.
    pub b: Vec<f64>,
    /// Number of equalities.
    pub equalities: usize,
}

/// Entries of a linear step that can differ from zero: (row, column among the states), then (row, input).
const A_ENTRIES: [(usize, usize); 18] = [
    (0, 0),
    (0, 1),
    (0, 2),
    (0, 3),
    (0, 4),
    (0, 5),
    (1, 0),
    (1, 1),
    (1, 2),
    (1, 3),
    (1, 4),
    (1, 5),
    (2, 2),
    (2, 3),
    (2, 4),
    (2, 5),
    (3, 3),
    (3, 5),
];
const B_ENTRIES: [(usize, usize); 6] = [(0, 0), (1, 0), (2, 0), (3, 1), (4, 0), (5, 1)];

/// Emits every entry of `A` as (row, column, value), always in the same order.
fn visit(stages: &Stages, mut emit: impl FnMut(usize, usize, f64)) {
    for (k, Stage { linear, .. }) in stages.steps.iter().enumerate() {
        let (row, col) = (N_STATES * k, VARIABLES * k);
        let state_col = |step: usize| VARIABLES * step + N_INPUTS;
        for i in 0..N_STATES {
            emit(row + i, state_col(k) + i, -1.0);
        }
        for (i, j) in B_ENTRIES {
            emit(row + i, col + j, linear.b[i][j]);
        }
        if k > 0 {
            for (i, j) in A_ENTRIES.into_iter().chain([(4, 4), (5, 5)]) {
                emit(row + i, state_col(k - 1) + j, linear.a[i][j]);
            }
        }
    }
    let horizon = stages.steps.len();
    for k in 0..horizon {
        visit_bounds(N_STATES * horizon + INEQUALITIES * k, VARIABLES * k, &mut emit);
    }
}

/// Left sides of the inequalities of one step, in the order of [`Stage::limits`].
fn visit_bounds(row: usize, col: usize, emit: &mut impl FnMut(usize, usize, f64)) {
    let (across, speed, steering, accel) = (col + 3, col + 5, col + 6, col + 7);
    let slack = col + VARIABLES - 1;
    for (k, bounded) in [col, col + 1, steering, accel].into_iter().enumerate() {
        emit(row + 2 * k, bounded, 1.0);
        emit(row + 2 * k + 1, bounded, -1.0);
    }
    emit(row + 8, speed, 1.0);
    emit(row + 9, across, 1.0);
    emit(row + 9, slack, -1.0);
    emit(row + 10, across, -1.0);
    emit(row + 10, slack, -1.0);
    emit(row + 11, slack, -1.0);
}

/// Diagonal of the cost: `1/2 x' P x`.
fn diagonal(stages: &Stages) -> CscMatrix<f64> {
    let n = VARIABLES * stages.steps.len();
    let mut values = Vec::with_capacity(n);
    for Stage { cost, .. } in &stages.steps {
        values.extend(cost.inputs);
        values.extend(cost.states);
        values.push(stages.slack_squared);
    }
    CscMatrix::new(n, n, (0..=n).collect(), (0..n).collect(), values)
}

/// Writes the values of a program in the order of its sparse form.
fn fill(stages: &Stages, places: &[usize], data: &mut Data) {
    let Data { q, a, b } = data;
    let mut place = places.iter();
    visit(stages, |_, _, value| {
        a[*place.next().expect("every program has the entries of the first")] = value
    });
    let horizon = stages.steps.len();
    let (equal, below) = b.split_at_mut(N_STATES * horizon);
    let mut before = stages.start;
    for (rows, stage) in equal.chunks_exact_mut(N_STATES).zip(&stages.steps) {
        let known = stage.linear.next(&before, &[0.0; N_INPUTS]);
        for (i, row) in rows.iter_mut().enumerate() {
            *row = -stage.linear.c[i] - known[i];
        }
        before = [0.0; N_STATES];
    }
    for (rows, stage) in below.chunks_exact_mut(INEQUALITIES).zip(&stages.steps) {
        rows.copy_from_slice(&stage.limits);
    }
    for (step, stage) in q.chunks_exact_mut(VARIABLES).zip(&stages.steps) {
        step[N_INPUTS..N_INPUTS + N_STATES].copy_from_slice(&stage.pull);
        step[VARIABLES - 1] = stages.slack;
    }
}

/// Compressed columns of a list of entries without duplicates, and the index of each entry among the values.
fn compress(entries: &[(usize, usize, f64)], m: usize, n: usize) -> (CscMatrix<f64>, Vec<usize>) {
    let mut order: Vec<usize> = (0..entries.len()).collect();
    order.sort_by_key(|&e| (entries[e].1, entries[e].0));
    let mut places = vec![0; entries.len()];
    let mut columns = vec![0; n + 1];
    for (place, &e) in order.iter().enumerate() {
        places[e] = place;
        columns[entries[e].1 + 1] += 1;
    }
    for col in 0..n {
        columns[col + 1] += columns[col];
    }
    let rows = order.iter().map(|&e| entries[e].0).collect();
    let values = order.iter().map(|&e| entries[e].2).collect();
    (CscMatrix::new(m, n, columns, rows, values), places)
}
