//! The quadratic program and its fixed sparsity.
//!
//! Variables per step: the two rates, then the six deviations of the state after the step, then the slack of
//! the corridor. Equalities are the linearised steps; inequalities bound rates, steering, acceleration and
//! speed, and the place across the path up to the slack. Costs are diagonal and do not change, since deviations
//! are measured in the axes of each knot; only `q`, the values of `A` and `b` do.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

use serde::{Deserialize, Serialize};

use super::model::{self, Linear, N_INPUTS, N_STATES, State};
use super::{Bounds, Knot, Weights};

/// Rates, deviations and slack of one step.
pub(crate) const VARIABLES: usize = N_INPUTS + N_STATES + 1;
/// Inequalities of one step.
const INEQUALITIES: usize = 12;

/// Numbers that change from tick to tick: `q`, values of `A` in the order of [`visit`], and `b`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Data {
    pub(crate) q: Vec<f64>,
    pub(crate) a: Vec<f64>,
    pub(crate) b: Vec<f64>,
}

/// A program of fixed size, its solver, and the buffers to fill it.
pub(crate) struct Program {
    horizon: usize,
    wheelbase_m: f64,
    dt_s: f64,
    weights: Weights,
    bounds: Bounds,
    solver: DefaultSolver<f64>,
    /// For each entry that [`visit`] emits, its place among the values of `A`.
    places: Vec<usize>,
    columns: Vec<usize>,
    rows: Vec<usize>,
    data: Data,
    limits: Vec<Envelope>,
}

/// Bounds of one step, widened where the start state is outside them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Envelope {
    pub(crate) steering_rad: f64,
    pub(crate) accel_min_mps2: f64,
    pub(crate) accel_max_mps2: f64,
    pub(crate) speed_max_mps: f64,
}

impl Program {
    /// A program of `horizon` steps; the solver is scaled on a straight drive at 10 m/s, so that what it
    /// returns later does not depend on the first problem it meets.
    pub(crate) fn new(
        horizon: usize,
        dt_s: f64,
        wheelbase_m: f64,
        weights: &Weights,
        bounds: &Bounds,
        settings: DefaultSettings<f64>,
    ) -> Self {
        let knots: Vec<Knot> = (0..=horizon).map(|k| Knot::straight(10.0 * dt_s * k as f64, 10.0)).collect();
        let mut limits = vec![bounds.envelope(); horizon];
        envelopes(&knots[0].state, bounds, dt_s, &mut limits);
        let (n, m) = (VARIABLES * horizon, (N_STATES + INEQUALITIES) * horizon);
        let mut entries: Vec<(usize, usize, f64)> = Vec::new();
        let mut b = vec![0.0; m];
        let start = knots[0].state;
        visit(&knots, &start, wheelbase_m, dt_s, |row, col, value| entries.push((row, col, value)), &mut b);
        bound_rows(&knots, bounds, &limits, &mut b);
        let mut q = vec![0.0; n];
        gradient(&knots, weights, &mut q);
        let (matrix, places) = compress(&entries, m, n);
        let cones = [
            SupportedConeT::ZeroConeT(N_STATES * horizon),
            SupportedConeT::NonnegativeConeT(INEQUALITIES * horizon),
        ];
        let solver = DefaultSolver::new(&diagonal(horizon, weights), &q, &matrix, &b, &cones, settings)
            .expect("sizes agree by construction and the settings are checked");
        Self {
            horizon,
            wheelbase_m,
            dt_s,
            weights: *weights,
            bounds: *bounds,
            solver,
            places,
            columns: matrix.colptr,
            rows: matrix.rowval,
            data: Data { q, a: matrix.nzval, b },
            limits,
        }
    }

    /// Fills in the problem of driving from `start` along `knots` (one more than steps).
    pub(crate) fn fill(&mut self, start: &State, knots: &[Knot]) {
        let Data { q, a, b } = &mut self.data;
        envelopes(start, &self.bounds, self.dt_s, &mut self.limits);
        let mut entry = self.places.iter();
        let put = |_row: usize, _col: usize, value: f64| {
            a[*entry.next().expect("every problem has the entries of the first")] = value;
        };
        visit(knots, start, self.wheelbase_m, self.dt_s, put, b);
        bound_rows(knots, &self.bounds, &self.limits, b);
        gradient(knots, &self.weights, q);
    }

    /// Solves what was filled in. The solution counts only when the status says solved.
    pub(crate) fn solve(&mut self) -> (SolverStatus, u32) {
        let Data { q, a, b } = &self.data;
        self.solver.update_q(q).expect("presolve is off and sizes are fixed");
        self.solver.update_A(a).expect("presolve is off and the sparsity is fixed");
        self.solver.update_b(b).expect("presolve is off and sizes are fixed");
        self.solver.solve();
        (self.solver.solution.status, self.solver.solution.iterations)
    }

    /// Deviation from knot `k` (1 to the horizon) in the last solution.
    pub(crate) fn deviation(&self, k: usize) -> &[f64] {
        let first = VARIABLES * (k - 1) + N_INPUTS;
        &self.solver.solution.x[first..first + N_STATES]
    }

    /// Largest slack of the corridor in the last solution, metres.
    pub(crate) fn slack_max_m(&self) -> f64 {
        let x = &self.solver.solution.x;
        (0..self.horizon).map(|k| x[VARIABLES * k + VARIABLES - 1]).fold(0.0, f64::max)
    }

    #[cfg(test)]
    pub(crate) fn limit_iterations(&mut self, n: u32) {
        let mut settings = self.solver.settings().clone();
        settings.max_iter = n;
        self.solver.update_settings(settings).unwrap();
    }

    /// The problem last filled in.
    pub(crate) fn problem(&self) -> Problem {
        let Data { q, a, b } = &self.data;
        Problem {
            cost: diagonal(self.horizon, &self.weights).nzval,
            q: q.clone(),
            columns: self.columns.clone(),
            rows: self.rows.clone(),
            values: a.clone(),
            b: b.clone(),
            equalities: N_STATES * self.horizon,
        }
    }
}

/// A problem as its solver sees it: minimise `1/2 x' P x + q' x` with `A x = b` in the first rows and
/// `A x <= b` in the others. For inspection, and to pose it to other solvers.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Problem {
    /// Diagonal of `P`, which has no other entries.
    pub cost: Vec<f64>,
    /// Linear cost.
    pub q: Vec<f64>,
    /// Compressed columns of `A`: where each column starts.
    pub columns: Vec<usize>,
    /// Row of each value.
    pub rows: Vec<usize>,
    /// Values of `A`, structural zeros included.
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

/// Emits every entry of `A` as (row, column, value), always in the same order, and writes the equality part
/// of `b`.
fn visit(
    knots: &[Knot],
    start: &State,
    wheelbase_m: f64,
    dt_s: f64,
    mut emit: impl FnMut(usize, usize, f64),
    b: &mut [f64],
) {
    let horizon = knots.len() - 1;
    let mut before = model::deviation(start, &knots[0].state);
    for k in 0..horizon {
        let linear: Linear = model::linearise(&knots[k].state, &knots[k + 1].state, wheelbase_m, dt_s);
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
        for i in 0..N_STATES {
            let known: f64 = (0..N_STATES).map(|j| linear.a[i][j] * before[j]).sum();
            b[row + i] = -linear.c[i] - known;
        }
        before = [0.0; N_STATES];
    }
    for k in 0..horizon {
        visit_bounds(N_STATES * horizon + INEQUALITIES * k, VARIABLES * k, &mut emit);
    }
}

/// Left sides of the inequalities of one step; [`bound_rows`] has their right sides in the same order.
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

fn bound_rows(knots: &[Knot], bounds: &Bounds, limits: &[Envelope], b: &mut [f64]) {
    let horizon = knots.len() - 1;
    let rows = b[N_STATES * horizon..].chunks_exact_mut(INEQUALITIES);
    for ((row, knot), limit) in rows.zip(&knots[1..]).zip(limits) {
        let State { speed_mps, steering_rad, accel_mps2, .. } = knot.state;
        row.copy_from_slice(&[
            bounds.steering_rate_max_radps,
            bounds.steering_rate_max_radps,
            bounds.jerk_max_mps3,
            bounds.jerk_max_mps3,
            limit.steering_rad - steering_rad,
            limit.steering_rad + steering_rad,
            limit.accel_max_mps2 - accel_mps2,
            accel_mps2 - limit.accel_min_mps2,
            limit.speed_max_mps - speed_mps,
            knot.left_m,
            knot.right_m,
            0.0,
        ]);
    }
}

/// Bounds of each step that the start state can meet: a bound that it breaks already is widened to what the
/// hardest allowed way back leaves of the breach.
fn envelopes(start: &State, bounds: &Bounds, dt_s: f64, limits: &mut [Envelope]) {
    // A hair of room, so that the way back itself is strictly inside.
    const ROOM: f64 = 1e-3;
    let jerk = bounds.jerk_max_mps3 * dt_s;
    let (mut accel, mut speed) = (start.accel_mps2, start.speed_mps);
    for (k, limit) in limits.iter_mut().enumerate() {
        let elapsed = dt_s * (k + 1) as f64;
        let steering = start.steering_rad.abs() - bounds.steering_rate_max_radps * elapsed;
        let above = start.accel_mps2 - bounds.jerk_max_mps3 * elapsed;
        let below = start.accel_mps2 + bounds.jerk_max_mps3 * elapsed;
        // Braking as hard as jerk and acceleration allow.
        let next = if accel > bounds.accel_min_mps2 {
            (accel - jerk).max(bounds.accel_min_mps2)
        } else {
            (accel + jerk).min(bounds.accel_min_mps2)
        };
        speed += 0.5 * dt_s * (accel + next);
        accel = next;
        *limit = Envelope {
            steering_rad: bounds.steering_max_rad.max(steering + ROOM),
            accel_min_mps2: bounds.accel_min_mps2.min(below - ROOM),
            accel_max_mps2: bounds.accel_max_mps2.max(above + ROOM),
            speed_max_mps: bounds.speed_max_mps.max(speed + ROOM),
        };
    }
}

impl Bounds {
    fn envelope(&self) -> Envelope {
        Envelope {
            steering_rad: self.steering_max_rad,
            accel_min_mps2: self.accel_min_mps2,
            accel_max_mps2: self.accel_max_mps2,
            speed_max_mps: self.speed_max_mps,
        }
    }
}

/// Diagonal of the cost: `1/2 x' P x`.
fn diagonal(horizon: usize, weights: &Weights) -> CscMatrix<f64> {
    let n = VARIABLES * horizon;
    let mut values = Vec::with_capacity(n);
    for k in 1..=horizon {
        let scale = if k == horizon { weights.terminal } else { 1.0 };
        values.extend([weights.steering_rate, weights.jerk]);
        values.extend(weights.states().map(|w| scale * w));
        values.push(weights.slack_squared);
    }
    CscMatrix::new(n, n, (0..=n).collect(), (0..n).collect(), values)
}

/// Linear cost: pulls towards what each knot wants, and the price of slack.
fn gradient(knots: &[Knot], weights: &Weights, q: &mut [f64]) {
    let horizon = knots.len() - 1;
    for (k, (step, knot)) in q.chunks_exact_mut(VARIABLES).zip(&knots[1..]).enumerate() {
        let scale = if k + 1 == horizon { weights.terminal } else { 1.0 };
        let [along, _, _, speed, _, accel] = weights.states().map(|w| -scale * w);
        step.copy_from_slice(&[
            0.0,
            0.0,
            along * knot.wanted_along_m,
            0.0,
            0.0,
            speed * (knot.wanted_speed_mps - knot.state.speed_mps),
            0.0,
            accel * (knot.wanted_accel_mps2 - knot.state.accel_mps2),
            weights.slack,
        ]);
    }
}

/// Compressed columns of a list of entries without repeats, and the place of each entry among the values.
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
