//! Feasibility: the input that brings a vehicle nearest to its next state.
//!
//! The objective and the tolerances are those of `position_orientation_objective` and
//! `position_orientation_feasibility_criteria` of the official checker. It minimises by SLSQP from the input 0; here
//! Gauss-Newton steps are followed by a compass search, which needs no derivative where the objective has an edge.

use swerve_geom::{math, wrap_angle};

use crate::vehicle::{ACCEL_MAX_MPS2, Input, STEERING_RATE_MAX_RADPS, Values};
use crate::{Driven, Model, Vehicle};

/// Tolerances: x and y in metres, heading in radians. The objective applies the third one to the speed.
const WITHIN: [f64; 3] = [0.02, 0.02, 0.03];

/// Differences are rounded to this many parts of a metre or radian before they are compared.
const GRAIN: f64 = 1e4;

/// Gauss-Newton steps.
const NEWTON_STEPS: usize = 6;

/// Most evaluations of the compass search.
const SEARCH_MAX: usize = 400;

/// A step that no input reaches.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Miss {
    /// Time step of the state that is not reached.
    pub step: u32,
    /// Remaining distances along x and y, metres, positive where the state is beyond.
    pub off_m: [f64; 2],
    /// Remaining turn, radians; 0 for the point mass.
    pub off_rad: f64,
    /// Remaining difference of the velocity, m/s: of the speed, for the point mass of the larger component.
    pub off_mps: f64,
}

/// Steps of a solution that no input reaches, in order of time, given the duration of a step.
pub fn misses(driven: &Driven, step_s: f64) -> Vec<Miss> {
    let vehicle = driven.vehicle.vehicle();
    let transition = |two: &[crate::SolutionState]| {
        let [from, to] = [two[0], two[1]].map(|state| vehicle.values(driven.model, &state));
        let task = Task { vehicle, model: driven.model, from, to, dt_s: step_s };
        let input = task.nearest();
        let off = task.off(input)?;
        (!task.is_within(&off)).then_some(Miss {
            step: two[1].step,
            off_m: [off[0], off[1]],
            off_rad: if driven.model == Model::Pm { 0.0 } else { off[3] },
            off_mps: if driven.model == Model::Pm && off[3].abs() > off[2].abs() { off[3] } else { off[2] },
        })
    };
    driven.states.windows(2).filter_map(transition).collect()
}

/// A transition between two states.
#[derive(Clone, Copy)]
struct Task {
    vehicle: Vehicle,
    model: Model,
    from: Values,
    to: Values,
    dt_s: f64,
}

impl Task {
    /// Largest magnitudes of the input.
    fn bounds(&self) -> Input {
        match self.model {
            Model::Pm => [ACCEL_MAX_MPS2; 2],
            _ => [STEERING_RATE_MAX_RADPS, ACCEL_MAX_MPS2],
        }
    }

    /// Differences that remain under an input: x, y, speed, heading; for the point mass x, y and both components of the
    /// velocity. `None` beyond the friction circle.
    fn off(&self, input: Input) -> Option<[f64; 4]> {
        let reached = self.vehicle.after(self.model, self.from, input, self.dt_s)?;
        let off = |k: usize| self.to[k] - reached[k];
        Some(match self.model {
            Model::Pm => [off(0), off(1), off(2), off(3)],
            _ => [off(0), off(1), off(3), wrap_angle(off(4))],
        })
    }

    fn is_within(&self, off: &[f64; 4]) -> bool {
        let [x, y, speed, heading] = off.map(|value| (value.abs() * GRAIN).round_ties_even() / GRAIN);
        match self.model {
            Model::Pm => [x, y, speed, heading].iter().all(|value| *value < WITHIN[0]),
            _ => x < WITHIN[0] && y < WITHIN[1] && heading < WITHIN[2],
        }
    }

    /// The objective of the official checker.
    fn cost(&self, input: Input) -> f64 {
        let length =
            |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>().sqrt();
        let Some(off) = self.off(input) else {
            return length(&mut WITHIN.iter().map(|value| value * 100.0));
        };
        let plain = length(&mut off.iter().copied());
        if self.model == Model::Pm {
            return plain;
        }
        let beyond = off.iter().zip(WITHIN).map(|(off, within)| (off.abs() - within).max(0.0));
        plain + length(&mut beyond.into_iter())
    }

    /// The input with the least cost.
    fn nearest(&self) -> Input {
        let start = self.newton();
        let input = if self.cost(start) < self.cost([0.0; 2]) { start } else { [0.0; 2] };
        self.searched(input)
    }

    /// Gauss-Newton on the squared differences, within the bounds.
    fn newton(&self) -> Input {
        let bounds = self.bounds();
        let mut input = [0.0; 2];
        for _ in 0..NEWTON_STEPS {
            let steps = bounds.map(|bound| 1e-4 * bound);
            let Some(off) = self.off(input) else { break };
            let moved = [0, 1].map(|k| {
                let mut beside = input;
                beside[k] += if input[k] > 0.0 { -steps[k] } else { steps[k] };
                self.off(beside).map(|other| {
                    core::array::from_fn::<f64, 4, _>(|i| (off[i] - other[i]) / (beside[k] - input[k]))
                })
            });
            let [Some(a), Some(b)] = moved else { break };
            let dot = |p: &[f64; 4], q: &[f64; 4]| p.iter().zip(q).map(|(p, q)| p * q).sum::<f64>();
            let (aa, ab, bb) = (dot(&a, &a), dot(&a, &b), dot(&b, &b));
            let (ra, rb) = (dot(&a, &off), dot(&b, &off));
            // Without steering, as at rest, the first row is 0.
            let (aa, bb) = (aa + 1e-12, bb + 1e-12);
            let determinant = aa * bb - ab * ab;
            let by = [(ra * bb - rb * ab) / determinant, (rb * aa - ra * ab) / determinant];
            for k in 0..2 {
                input[k] = (input[k] + by[k]).clamp(-bounds[k], bounds[k]);
            }
        }
        input
    }

    /// Compass search.
    fn searched(&self, from: Input) -> Input {
        let bounds = self.bounds();
        let (mut best, mut cost, mut share) = (from, self.cost(from), 0.02);
        for _ in 0..SEARCH_MAX / 8 {
            let mut better = false;
            for [p, q] in COMPASS {
                let by = [p, q];
                let input: Input = core::array::from_fn(|k| {
                    (best[k] + share * by[k] * bounds[k]).clamp(-bounds[k], bounds[k])
                });
                let found = self.cost(input);
                if found < cost {
                    (best, cost, better) = (input, found, true);
                }
            }
            if !better {
                share *= 0.5;
            }
            if share < 1e-6 {
                break;
            }
        }
        best
    }
}

/// Directions of the compass search.
const COMPASS: [[f64; 2]; 8] =
    [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];

/// Distance of a miss, metres.
impl Miss {
    /// Remaining distance over ground, metres.
    pub fn distance_m(&self) -> f64 {
        math::hypot(self.off_m[0], self.off_m[1])
    }
}
