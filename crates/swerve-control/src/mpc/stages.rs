//! The quadratic program, step by step along the horizon.
//!
//! Variables per step: the two rates, the six deviations of the state after the step, and the slack of the corridor.
//! Each step has its linearised dynamics, a linear cost, and the right sides of its inequalities, which bound rates,
//! steering, acceleration and speed, and the lateral deviation up to the slack. Quadratic costs are diagonal and
//! constant, since deviations are measured in the axes of each knot.

use super::knot::Knot;
use super::model::{self, Linear, N_INPUTS, N_STATES, State};
use super::params::Weights;

/// Inequalities of one step, in the order of [`Stage::limits`]: both signs of steering rate, jerk, steering and
/// acceleration, then speed, the corridor to the left and to the right, and the sign of the slack.
pub(crate) const INEQUALITIES: usize = 12;

/// Index of the lateral deviation.
pub(crate) const ACROSS: usize = 1;
/// Index of the speed in a deviation.
pub(crate) const SPEED: usize = 3;
/// Index of the steering angle in a deviation.
pub(crate) const STEERING: usize = 4;
/// Index of the acceleration in a deviation.
pub(crate) const ACCEL: usize = 5;

/// Values for each rate of a step and each deviation of the state after it: a point, a change, a gradient or the
/// diagonal of a Hessian.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Values {
    pub(crate) inputs: [f64; N_INPUTS],
    pub(crate) states: [f64; N_STATES],
}

/// One step of the horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stage {
    /// Dynamics into the state after the step.
    pub(crate) linear: Linear,
    /// Diagonal of the quadratic cost, multiplied by 1/2 in the objective.
    pub(crate) cost: Values,
    /// Linear cost of the state after the step; rates have none.
    pub(crate) pull: [f64; N_STATES],
    /// Right sides of the inequalities.
    pub(crate) limits: [f64; INEQUALITIES],
}

/// The program of one controller call.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Stages {
    wheelbase_m: f64,
    dt_s: f64,
    weights: Weights,
    bounds: Bounds,
    /// Deviation of the start state from the first knot.
    pub(crate) start: [f64; N_STATES],
    /// The steps.
    pub(crate) steps: Vec<Stage>,
    /// Cost of the slack, linear and (times 1/2) quadratic.
    pub(crate) slack: f64,
    pub(crate) slack_squared: f64,
}

/// Bounds of one step, widened if the start state is outside them.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Envelope {
    steering_rad: f64,
    accel_min_mps2: f64,
    accel_max_mps2: f64,
    speed_max_mps: f64,
}

impl Stages {
    /// Creates the program of a straight drive at 10 m/s.
    pub(crate) fn new(
        horizon: usize,
        dt_s: f64,
        wheelbase_m: f64,
        weights: &Weights,
        bounds: &Bounds,
    ) -> Self {
        let last = horizon.max(1) - 1;
        let stage = |k: usize| {
            let scale = if k == last { weights.terminal } else { 1.0 };
            let states = weights.states().map(|w| scale * w);
            let cost = Values { inputs: [weights.steering_rate, weights.jerk], states };
            Stage { linear: Linear::default(), cost, pull: [0.0; N_STATES], limits: [0.0; INEQUALITIES] }
        };
        let mut stages = Self {
            wheelbase_m,
            dt_s,
            weights: *weights,
            bounds: *bounds,
            start: [0.0; N_STATES],
            steps: (0..=last).map(stage).collect(),
            slack: weights.slack,
            slack_squared: weights.slack_squared,
        };
        let knots: Vec<Knot> = (0..=last + 1).map(|k| Knot::straight(10.0 * dt_s * k as f64, 10.0)).collect();
        stages.fill(&knots[0].state, &knots);
        stages
    }

    /// Fills in the program for driving from `start` along `knots` (one more than steps).
    pub(crate) fn fill(&mut self, start: &State, knots: &[Knot]) {
        self.start = model::deviation(start, &knots[0].state);
        let mut way_back = WayBack { start: *start, accel: start.accel_mps2, speed: start.speed_mps };
        for (k, (stage, pair)) in self.steps.iter_mut().zip(knots.windows(2)).enumerate() {
            let knot = &pair[1];
            stage.linear = model::linearise(&pair[0].state, &knot.state, self.wheelbase_m, self.dt_s);
            stage.pull = pull(&stage.cost.states, knot);
            let envelope = way_back.envelope(&self.bounds, self.dt_s, k);
            stage.limits = limits(&self.bounds, &envelope, knot);
        }
    }
}

/// Linear cost: pulls towards the knot's targets.
fn pull(cost: &[f64; N_STATES], knot: &Knot) -> [f64; N_STATES] {
    let mut pull = [0.0; N_STATES];
    pull[0] = -cost[0] * knot.wanted_along_m;
    pull[SPEED] = -cost[SPEED] * (knot.wanted_speed_mps - knot.state.speed_mps);
    pull[ACCEL] = -cost[ACCEL] * (knot.wanted_accel_mps2 - knot.state.accel_mps2);
    pull
}

fn limits(bounds: &Bounds, envelope: &Envelope, knot: &Knot) -> [f64; INEQUALITIES] {
    let State { speed_mps, steering_rad, accel_mps2, .. } = knot.state;
    [
        bounds.steering_rate_max_radps,
        bounds.steering_rate_max_radps,
        bounds.jerk_max_mps3,
        bounds.jerk_max_mps3,
        envelope.steering_rad - steering_rad,
        envelope.steering_rad + steering_rad,
        envelope.accel_max_mps2 - accel_mps2,
        accel_mps2 - envelope.accel_min_mps2,
        envelope.speed_max_mps - speed_mps,
        knot.left_m,
        knot.right_m,
        0.0,
    ]
}

/// Left sides of the inequalities of one step.
pub(crate) fn left_sides(step: &Values, slack_m: f64) -> [f64; INEQUALITIES] {
    let [rate, jerk] = step.inputs;
    let z = &step.states;
    let (steering, accel) = (z[STEERING], z[ACCEL]);
    let (left, right) = (z[ACROSS] - slack_m, -z[ACROSS] - slack_m);
    [rate, -rate, jerk, -jerk, steering, -steering, accel, -accel, z[SPEED], left, right, -slack_m]
}

/// The hardest allowed return of a start state into its bounds.
struct WayBack {
    start: State,
    accel: f64,
    speed: f64,
}

impl WayBack {
    /// Bounds of step `k` that are feasible for the start state; called for each step in order. A bound that it
    /// violates is widened to the violation that remains after the hardest allowed return.
    fn envelope(&mut self, bounds: &Bounds, dt_s: f64, k: usize) -> Envelope {
        // A small margin, so that the return itself is strictly inside.
        const ROOM: f64 = 1e-3;
        let jerk = bounds.jerk_max_mps3 * dt_s;
        let elapsed = dt_s * (k + 1) as f64;
        let start = &self.start;
        let steering = start.steering_rad.abs() - bounds.steering_rate_max_radps * elapsed;
        let above = start.accel_mps2 - bounds.jerk_max_mps3 * elapsed;
        let below = start.accel_mps2 + bounds.jerk_max_mps3 * elapsed;
        // Braking as hard as jerk and acceleration allow.
        let next = if self.accel > bounds.accel_min_mps2 {
            (self.accel - jerk).max(bounds.accel_min_mps2)
        } else {
            (self.accel + jerk).min(bounds.accel_min_mps2)
        };
        self.speed += 0.5 * dt_s * (self.accel + next);
        self.accel = next;
        Envelope {
            steering_rad: bounds.steering_max_rad.max(steering + ROOM),
            accel_min_mps2: bounds.accel_min_mps2.min(below - ROOM),
            accel_max_mps2: bounds.accel_max_mps2.max(above + ROOM),
            speed_max_mps: bounds.speed_max_mps.max(self.speed + ROOM),
        }
    }
}

/// Hard bounds.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Bounds {
    pub(crate) steering_max_rad: f64,
    pub(crate) steering_rate_max_radps: f64,
    pub(crate) accel_min_mps2: f64,
    pub(crate) accel_max_mps2: f64,
    pub(crate) jerk_max_mps3: f64,
    pub(crate) speed_max_mps: f64,
}
