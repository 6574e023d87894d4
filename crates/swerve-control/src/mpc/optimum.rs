//! Optimum of a program: a Riccati sweep if no bound is active, an interior-point method over such sweeps otherwise.
//!
//! The unconstrained optimum is the solution exactly if it satisfies all bounds. Otherwise it is the start of a
//! primal-dual method with Mehrotra's predictor and corrector (Nocedal and Wright, *Numerical Optimization*, 2nd ed.,
//! section 16.6), in which each Newton step is an unconstrained problem over the same steps (Rao, Wright, Rawlings,
//! *Application of interior-point methods to model predictive control*, 1998). The corridor's slack occurs in one step
//! of the horizon only and is eliminated there. Every iterate satisfies the dynamics.
//!
//! The operations and their order depend only on the program: there is no warm start.

use super::riccati::{Sweep, slope_max};
use super::stages::{ACCEL, ACROSS, INEQUALITIES, SPEED, STEERING, Stage, Stages, Values, left_sides};

/// Largest number of iterations; bounded programs need 6 to 17.
const ITERATIONS_MAX: u32 = 30;
/// Largest mean product of distance and multiplier at a solution, in the unit of the cost.
const GAP_MAX: f64 = 1e-9;
/// Largest bound violation at a solution, in the unit of the bound.
const BREACH_MAX: f64 = 1e-8;
/// Largest derivative of the Lagrangian by a rate at a solution, in the unit of the cost over that of the rate.
const SLOPE_MAX: f64 = 1e-6;
/// Largest fraction of the distance to the nearest bound that a step takes.
const TO_BOUND: f64 = 0.995;

/// Values of the inequalities of one step.
#[derive(Clone, Copy)]
struct Rows {
    /// Distance to the bound (its slack variable), positive.
    distance: [f64; INEQUALITIES],
    /// Multiplier of the bound, positive.
    price: [f64; INEQUALITIES],
    /// Residual: left side plus distance minus bound.
    breach: [f64; INEQUALITIES],
    /// Multiplier over distance.
    weight: [f64; INEQUALITIES],
    /// Changes of distance and multiplier along the current direction.
    by_distance: [f64; INEQUALITIES],
    by_price: [f64; INEQUALITIES],
}

const NO_ROWS: Rows = Rows {
    distance: [1.0; INEQUALITIES],
    price: [0.0; INEQUALITIES],
    breach: [0.0; INEQUALITIES],
    weight: [0.0; INEQUALITIES],
    by_distance: [0.0; INEQUALITIES],
    by_price: [0.0; INEQUALITIES],
};

/// Solver for programs of one size, with the last solution.
pub(crate) struct Optimum {
    sweep: Sweep,
    point: Vec<Values>,
    slack_m: Vec<f64>,
    gradient: Vec<Values>,
    change: Vec<Values>,
    slack_change: Vec<f64>,
    rows: Vec<Rows>,
    iterations_max: u32,
}

impl Optimum {
    pub(crate) fn new(horizon: usize) -> Self {
        let none = vec![Values::default(); horizon];
        Self {
            sweep: Sweep::new(horizon),
            point: none.clone(),
            slack_m: vec![0.0; horizon],
            gradient: none.clone(),
            change: none,
            slack_change: vec![0.0; horizon],
            rows: vec![NO_ROWS; horizon],
            iterations_max: ITERATIONS_MAX,
        }
    }

    /// Rates, deviations and slack of each step in the last solution.
    pub(crate) fn solution(&self) -> impl Iterator<Item = (Values, f64)> {
        self.point.iter().copied().zip(self.slack_m.iter().copied())
    }

    /// Largest slack of the corridor in the last solution, metres.
    pub(crate) fn slack_max_m(&self) -> f64 {
        self.slack_m.iter().copied().fold(0.0, f64::max)
    }

    /// Adopts the solution of another solver.
    pub(crate) fn adopt(&mut self, solution: impl Iterator<Item = (Values, f64)>) {
        for (k, (values, slack_m)) in solution.enumerate() {
            (self.point[k], self.slack_m[k]) = (values, slack_m);
        }
    }

    #[cfg(test)]
    pub(crate) fn limit_iterations(&mut self, n: u32) {
        self.iterations_max = n;
    }

    /// Finds the unconstrained optimum. Returns true if it satisfies all bounds and is thus the solution.
    pub(crate) fn unbounded(&mut self, stages: &Stages) -> bool {
        let steps = &stages.steps;
        self.sweep.factorise(steps, |k| steps[k].cost);
        self.sweep.roll_out(steps, &stages.start, &mut self.point);
        for ((gradient, stage), point) in self.gradient.iter_mut().zip(steps).zip(&self.point) {
            *gradient = cost_gradient(stage, point);
        }
        self.sweep.solve(steps, &self.gradient, &mut self.change);
        add(&mut self.point, 1.0, &self.change);
        self.slack_m.fill(0.0);
        let met = |(stage, point): (&Stage, &Values)| {
            left_sides(point, 0.0).iter().zip(&stage.limits).all(|(left, limit)| left <= limit)
        };
        steps.iter().zip(&self.point).all(met)
    }

    /// Finds the constrained optimum, starting from the unconstrained one. Returns the number of iterations, or `None`
    /// without convergence.
    pub(crate) fn bounded(&mut self, stages: &Stages) -> Option<u32> {
        self.begin(stages);
        for iteration in 0..self.iterations_max {
            let gap = self.assess(stages);
            if self.is_solved(stages, gap) {
                return Some(iteration);
            }
            let Self { sweep, rows, .. } = self;
            sweep.factorise(&stages.steps, |k| hessian(stages, &stages.steps[k], &rows[k].weight));
            // The predictor aims at a gap of 0; the gap that it reaches sets the target of the corrector.
            self.direct(stages, |_, _| 0.0);
            let reached = self.gap_after(self.length(1.0)) / gap;
            let target = gap * reached * reached * reached;
            self.direct(stages, |rows, i| target - rows.by_distance[i] * rows.by_price[i]);
            self.advance(self.length(TO_BOUND).min(1.0));
        }
        None
    }

    /// Initialises distances and multipliers at the unconstrained optimum.
    fn begin(&mut self, stages: &Stages) {
        for ((rows, stage), (point, slack_m)) in
            self.rows.iter_mut().zip(&stages.steps).zip(self.point.iter().zip(&mut self.slack_m))
        {
            let across = point.states[ACROSS];
            *slack_m = (across - stage.limits[9]).max(-across - stage.limits[10]).max(0.0) + START_SLACK_M;
            let left = left_sides(point, *slack_m);
            for (i, (limit, left)) in stage.limits.iter().zip(left).enumerate() {
                let least = START_SHARE * (1.0 + limit.abs());
                rows.distance[i] = (limit - left).max(least);
                rows.price[i] = START_GAP / rows.distance[i];
            }
        }
    }

    /// Computes residuals and weights of the current point. Returns the mean product of distance and multiplier.
    fn assess(&mut self, stages: &Stages) -> f64 {
        let mut sum = 0.0;
        for ((rows, stage), (point, slack_m)) in
            self.rows.iter_mut().zip(&stages.steps).zip(self.point.iter().zip(&self.slack_m))
        {
            let left = left_sides(point, *slack_m);
            for (i, left) in left.into_iter().enumerate() {
                rows.breach[i] = left + rows.distance[i] - stage.limits[i];
                rows.weight[i] = rows.price[i] / rows.distance[i];
                sum += rows.price[i] * rows.distance[i];
            }
        }
        sum / (INEQUALITIES * self.rows.len()) as f64
    }

    fn is_solved(&mut self, stages: &Stages, gap: f64) -> bool {
        let within = |rows: &Rows| rows.breach.iter().all(|breach| breach.abs() <= BREACH_MAX);
        if gap > GAP_MAX || !self.rows.iter().all(within) {
            return false;
        }
        let mut slack_slope = 0.0f64;
        for (k, stage) in stages.steps.iter().enumerate() {
            let price = &self.rows[k].price;
            self.gradient[k] = cost_gradient(stage, &self.point[k]);
            add_prices(&mut self.gradient[k], price);
            slack_slope = slack_slope.max(slack_gradient(stages, self.slack_m[k], price).abs());
        }
        slope_max(&stages.steps, &self.gradient).max(slack_slope) <= SLOPE_MAX
    }

    /// Computes the Newton direction towards the products of distance and multiplier in `target`, per inequality.
    fn direct(&mut self, stages: &Stages, target: impl Fn(&Rows, usize) -> f64) {
        let mut aim = [0.0; INEQUALITIES];
        for (k, stage) in stages.steps.iter().enumerate() {
            let rows = &mut self.rows[k];
            for (i, aim) in aim.iter_mut().enumerate() {
                // Kept for the changes of the multipliers below.
                rows.by_price[i] = target(rows, i) / rows.distance[i];
                *aim = rows.weight[i] * rows.breach[i] + rows.by_price[i];
            }
            let gradient = &mut self.gradient[k];
            *gradient = cost_gradient(stage, &self.point[k]);
            add_prices(gradient, &aim);
            let slack = slack_gradient(stages, self.slack_m[k], &aim);
            self.slack_change[k] = slack;
            let (cross, own) = slack_hessian(stages, &rows.weight);
            gradient.states[ACROSS] -= cross * slack / own;
        }
        self.sweep.solve(&stages.steps, &self.gradient, &mut self.change);
        for (k, change) in self.change.iter().enumerate() {
            let rows = &mut self.rows[k];
            let (cross, own) = slack_hessian(stages, &rows.weight);
            let slack_change = -(self.slack_change[k] + cross * change.states[ACROSS]) / own;
            self.slack_change[k] = slack_change;
            let left = left_sides(change, slack_change);
            for (i, left) in left.into_iter().enumerate() {
                let moved = left + rows.breach[i];
                rows.by_distance[i] = -moved;
                rows.by_price[i] += rows.weight[i] * moved - rows.price[i];
            }
        }
    }

    /// Step length along the current direction, at most 1: `share` of the length at which a distance or multiplier
    /// becomes 0.
    fn length(&self, share: f64) -> f64 {
        let mut length = 1.0f64;
        for rows in &self.rows {
            for i in 0..INEQUALITIES {
                if rows.by_distance[i] < 0.0 {
                    length = length.min(-share * rows.distance[i] / rows.by_distance[i]);
                }
                if rows.by_price[i] < 0.0 {
                    length = length.min(-share * rows.price[i] / rows.by_price[i]);
                }
            }
        }
        length
    }

    /// Mean product of distance and multiplier after `length` of the current direction.
    fn gap_after(&self, length: f64) -> f64 {
        let mut sum = 0.0;
        for rows in &self.rows {
            for i in 0..INEQUALITIES {
                sum += (rows.distance[i] + length * rows.by_distance[i])
                    * (rows.price[i] + length * rows.by_price[i]);
            }
        }
        sum / (INEQUALITIES * self.rows.len()) as f64
    }

    fn advance(&mut self, length: f64) {
        add(&mut self.point, length, &self.change);
        for (slack_m, change) in self.slack_m.iter_mut().zip(&self.slack_change) {
            *slack_m += length * change;
        }
        for rows in &mut self.rows {
            for i in 0..INEQUALITIES {
                rows.distance[i] += length * rows.by_distance[i];
                rows.price[i] += length * rows.by_price[i];
            }
        }
    }
}

/// Gradient of the unconstrained cost.
fn cost_gradient(stage: &Stage, point: &Values) -> Values {
    let mut gradient = *point;
    for (slope, cost) in gradient.inputs.iter_mut().zip(&stage.cost.inputs) {
        *slope *= cost;
    }
    for (i, slope) in gradient.states.iter_mut().enumerate() {
        *slope = *slope * stage.cost.states[i] + stage.pull[i];
    }
    gradient
}

/// Adds the transposed left sides times `price`, except for the slack.
fn add_prices(gradient: &mut Values, price: &[f64; INEQUALITIES]) {
    gradient.inputs[0] += price[0] - price[1];
    gradient.inputs[1] += price[2] - price[3];
    gradient.states[STEERING] += price[4] - price[5];
    gradient.states[ACCEL] += price[6] - price[7];
    gradient.states[SPEED] += price[8];
    gradient.states[ACROSS] += price[9] - price[10];
}

fn slack_gradient(stages: &Stages, slack_m: f64, price: &[f64; INEQUALITIES]) -> f64 {
    stages.slack + stages.slack_squared * slack_m - price[9] - price[10] - price[11]
}

/// Second derivatives by the slack: mixed with the lateral deviation, and by the slack alone.
fn slack_hessian(stages: &Stages, weight: &[f64; INEQUALITIES]) -> (f64, f64) {
    (weight[10] - weight[9], stages.slack_squared + weight[9] + weight[10] + weight[11])
}

/// Diagonal of the Hessian with weighted bounds, the slack eliminated.
fn hessian(stages: &Stages, stage: &Stage, weight: &[f64; INEQUALITIES]) -> Values {
    let mut cost = stage.cost;
    cost.inputs[0] += weight[0] + weight[1];
    cost.inputs[1] += weight[2] + weight[3];
    cost.states[STEERING] += weight[4] + weight[5];
    cost.states[ACCEL] += weight[6] + weight[7];
    cost.states[SPEED] += weight[8];
    // (l + r) - (l - r)^2 / own, without the cancellation.
    let [left, right] = [weight[9], weight[10]];
    let (_, own) = slack_hessian(stages, weight);
    let alone = stages.slack_squared + weight[11];
    cost.states[ACROSS] += ((left + right) * alone + 4.0 * left * right) / own;
    cost
}

fn add(to: &mut [Values], length: f64, change: &[Values]) {
    for (to, change) in to.iter_mut().zip(change) {
        for (to, change) in to.inputs.iter_mut().zip(&change.inputs) {
            *to += length * change;
        }
        for (to, change) in to.states.iter_mut().zip(&change.states) {
            *to += length * change;
        }
    }
}

/// Initial slack beyond the need of the corridor, metres.
const START_SLACK_M: f64 = 0.1;
/// Smallest initial distance, as a fraction of the bound.
const START_SHARE: f64 = 0.1;
/// Initial products of distance and multiplier, in the unit of the cost.
const START_GAP: f64 = 1.0;
