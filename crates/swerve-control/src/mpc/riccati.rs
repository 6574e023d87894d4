//! The Riccati sweep: minimises a quadratic cost over the linearised steps, in time linear in the horizon
//! (Rawlings, Mayne, Diehl, *Model Predictive Control*, 2nd ed., section 1.3.3 and 8.8.3).
//!
//! A trajectory that satisfies the dynamics is changed to another one that does, so that the constant terms of the
//! steps occur in [`Sweep::roll_out`] only.

use std::array::from_fn;

use super::model::{N_INPUTS, N_STATES};
use super::stages::{Stage, Values};

/// Result of one step of the backward pass, for the forward pass.
#[derive(Clone, Copy, Default)]
struct Gain {
    /// Feedback of the rates on the state before the step.
    feedback: [[f64; N_STATES]; N_INPUTS],
    /// Inverse of the Hessian by the rates, including the cost-to-go: entries (0, 0), (0, 1), (1, 1).
    inverse: [f64; 3],
    /// Feed-forward part of the rates.
    forward: [f64; N_INPUTS],
}

/// Factorisation of one Hessian, for any number of gradients.
pub(crate) struct Sweep {
    gains: Vec<Gain>,
}

impl Sweep {
    pub(crate) fn new(horizon: usize) -> Self {
        Self { gains: vec![Gain::default(); horizon] }
    }

    /// Factorises the cost whose Hessian has the diagonals `hessian`, positive for the rates.
    pub(crate) fn factorise(&mut self, stages: &[Stage], hessian: impl Fn(usize) -> Values) {
        let mut value = [[0.0; N_STATES]; N_STATES];
        for (k, stage) in stages.iter().enumerate().rev() {
            let Values { inputs, states } = hessian(k);
            for (i, cost) in states.into_iter().enumerate() {
                value[i][i] += cost;
            }
            let linear = &stage.linear;
            let before = value.map(|row| linear.transposed(&row));
            let by_inputs = value.map(|row| linear.transposed_inputs(&row));
            // Column i of the value times the steps' inputs: the value is symmetric.
            let column = |j: usize| by_inputs.map(|row| row[j]);
            let [a, b] = linear.transposed_inputs(&column(0));
            let [_, d] = linear.transposed_inputs(&column(1));
            let (a, d) = (a + inputs[0], d + inputs[1]);
            let scale = 1.0 / (a * d - b * b);
            let inverse = [d * scale, -b * scale, a * scale];
            let cross = [linear.transposed(&column(0)), linear.transposed(&column(1))];
            let [rate, jerk]: [[f64; N_STATES]; N_INPUTS] = [
                from_fn(|i| -(inverse[0] * cross[0][i] + inverse[1] * cross[1][i])),
                from_fn(|i| -(inverse[1] * cross[0][i] + inverse[2] * cross[1][i])),
            ];
            let through: [[f64; N_STATES]; N_STATES] =
                from_fn(|i| linear.transposed(&before.map(|row| row[i])));
            let next = |i: usize, j: usize| through[i][j] + cross[0][i] * rate[j] + cross[1][i] * jerk[j];
            value = from_fn(|i| from_fn(|j| 0.5 * (next(i, j) + next(j, i))));
            self.gains[k] = Gain { feedback: [rate, jerk], inverse, ..Gain::default() };
        }
    }

    /// Writes the trajectory from `start` that satisfies the dynamics under the feedback of the factorisation.
    pub(crate) fn roll_out(&self, stages: &[Stage], start: &[f64; N_STATES], out: &mut [Values]) {
        let mut state = *start;
        for ((gain, stage), step) in self.gains.iter().zip(stages).zip(out) {
            step.inputs = gain.feedback.map(|row| dot(&row, &state));
            state = stage.linear.next(&state, &step.inputs);
            for (to, constant) in state.iter_mut().zip(&stage.linear.c) {
                *to += constant;
            }
            step.states = state;
        }
    }

    /// Writes the change of a trajectory that minimises the cost for this gradient; the start is unchanged.
    pub(crate) fn solve(&mut self, stages: &[Stage], gradient: &[Values], change: &mut [Values]) {
        let mut costate = [0.0; N_STATES];
        for ((gain, stage), gradient) in self.gains.iter_mut().zip(stages).zip(gradient).rev() {
            let linear = &stage.linear;
            for (to, slope) in costate.iter_mut().zip(&gradient.states) {
                *to += slope;
            }
            let [by_rate, by_jerk] = linear.transposed_inputs(&costate);
            let slope = [gradient.inputs[0] + by_rate, gradient.inputs[1] + by_jerk];
            let [a, b, d] = gain.inverse;
            gain.forward = [-(a * slope[0] + b * slope[1]), -(b * slope[0] + d * slope[1])];
            costate = linear.transposed(&costate);
            for (i, to) in costate.iter_mut().enumerate() {
                *to += gain.feedback[0][i] * slope[0] + gain.feedback[1][i] * slope[1];
            }
        }
        let mut state = [0.0; N_STATES];
        for ((gain, stage), step) in self.gains.iter().zip(stages).zip(change) {
            for (k, input) in step.inputs.iter_mut().enumerate() {
                *input = gain.forward[k] + dot(&gain.feedback[k], &state);
            }
            state = stage.linear.next(&state, &step.inputs);
            step.states = state;
        }
    }
}

/// Largest derivative of a cost with this gradient by any rate, with states that follow the rates.
pub(crate) fn slope_max(stages: &[Stage], gradient: &[Values]) -> f64 {
    let mut costate = [0.0; N_STATES];
    let mut most = 0.0f64;
    for (stage, gradient) in stages.iter().zip(gradient).rev() {
        for (to, slope) in costate.iter_mut().zip(&gradient.states) {
            *to += slope;
        }
        let by_inputs = stage.linear.transposed_inputs(&costate);
        for (by_states, own) in by_inputs.into_iter().zip(gradient.inputs) {
            most = most.max((by_states + own).abs());
        }
        costate = stage.linear.transposed(&costate);
    }
    most
}

fn dot(a: &[f64; N_STATES], b: &[f64; N_STATES]) -> f64 {
    let mut sum = 0.0;
    for i in 0..N_STATES {
        sum += a[i] * b[i];
    }
    sum
}
