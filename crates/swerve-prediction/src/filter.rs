//! Kalman filters over one actor's sightings, with several motion models weighted by their likelihood (interacting
//! multiple models: Blom and Bar-Shalom 1988).
//!
//! States are position, velocity and acceleration along each axis of the map; both axes are filtered independently by
//! the same model.

use swerve_core::Time;
use swerve_geom::{Point2, Vector2, math};

use crate::past::Past;

type Vector = [f64; 3];
type Matrix = [[f64; 3]; 3];

/// Motion model of an actor.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Motion {
    /// The velocity decays with this time constant, seconds.
    Fading(f64),
    /// The acceleration decays with this time constant, seconds (Singer 1970).
    Turning(f64),
}

/// A motion model with its process noise and transition parameters.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Model {
    pub(crate) motion: Motion,
    /// Spectral density of the white acceleration, m²/s³; of the jerk for [`Motion::Turning`], m²/s⁵.
    pub(crate) density: f64,
    /// Prior probability of the model.
    pub(crate) prior: f64,
    /// Mean time for which an actor follows the model, seconds.
    pub(crate) dwell_s: f64,
}

/// Mean and covariance of a model along one axis.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Axis {
    pub(crate) mean: Vector,
    pub(crate) covariance: Matrix,
}

/// State estimate of one model.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Belief {
    /// Probability of the model, 0 to 1.
    pub(crate) weight: f64,
    /// Estimates along x and along y.
    pub(crate) axes: [Axis; 2],
}

/// A model's step: the non-trivial elements of its transition matrix by rows, and its process noise.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Step {
    /// Coefficients of velocity and acceleration for the position, then for the velocity.
    place: [f64; 2],
    speed: [f64; 2],
    gain: f64,
    /// Upper triangle of the process noise covariance: 00, 01, 02, 11, 12, 22.
    noise: [f64; 6],
}

impl Model {
    /// Discretises the model over `dt_s`.
    pub(crate) fn step(&self, dt_s: f64) -> Step {
        let (t, q) = (dt_s, self.density);
        let (t2, t3) = (t * t, t * t * t);
        match self.motion {
            Motion::Fading(tau_s) => {
                let left = math::exp(-t / tau_s);
                Step {
                    place: [tau_s * (1.0 - left), 0.0],
                    speed: [left, 0.0],
                    gain: 0.0,
                    noise: [q * t3 / 3.0, q * t2 / 2.0, 0.0, q * t, 0.0, 0.0],
                }
            }
            Motion::Turning(tau_s) => {
                let left = math::exp(-t / tau_s);
                let gained = tau_s * (1.0 - left);
                Step {
                    place: [t, tau_s * (t - gained)],
                    speed: [1.0, gained],
                    gain: left,
                    // White jerk over a step that is short compared with the time constant.
                    noise: [
                        q * t3 * t2 / 20.0,
                        q * t2 * t2 / 8.0,
                        q * t3 / 6.0,
                        q * t3 / 3.0,
                        q * t2 / 2.0,
                        q * t,
                    ],
                }
            }
        }
    }
}

/// Symmetric matrix of its upper triangle.
fn symmetric([a, b, c, d, e, f]: [f64; 6]) -> Matrix {
    [[a, b, c], [b, d, e], [c, e, f]]
}

impl Axis {
    /// Propagates the estimate by a step.
    pub(crate) fn on(&self, step: &Step) -> Self {
        let Step { place: [f01, f02], speed: [f11, f12], gain: f22, noise: q } = *step;
        let (m, p) = (&self.mean, &self.covariance);
        let mean = [m[0] + f01 * m[1] + f02 * m[2], f11 * m[1] + f12 * m[2], f22 * m[2]];
        let first = [0, 1, 2].map(|j| p[0][j] + f01 * p[1][j] + f02 * p[2][j]);
        let second = [1, 2].map(|j| f11 * p[1][j] + f12 * p[2][j]);
        let covariance = symmetric([
            first[0] + f01 * first[1] + f02 * first[2] + q[0],
            f11 * first[1] + f12 * first[2] + q[1],
            f22 * first[2] + q[2],
            f11 * second[0] + f12 * second[1] + q[3],
            f22 * second[1] + q[4],
            f22 * f22 * p[2][2] + q[5],
        ]);
        Self { mean, covariance }
    }

    /// Updates by a sighting of variance `r`; also returns the normalised innovation squared and the innovation
    /// variance.
    fn corrected(&self, place_m: f64, r: f64) -> (Self, [f64; 2]) {
        let p = &self.covariance;
        let (off, s) = (place_m - self.mean[0], p[0][0] + r);
        let gain = [p[0][0] / s, p[0][1] / s, p[0][2] / s];
        let mean = [0, 1, 2].map(|i| self.mean[i] + gain[i] * off);
        let left = |i: usize, j: usize| p[i][j] - gain[i] * p[0][j];
        // The variance of the position is computed in a form without cancellation.
        let covariance = symmetric([gain[0] * r, left(0, 1), left(0, 2), left(1, 1), left(1, 2), left(2, 2)]);
        (Self { mean, covariance }, [off * off / s, s])
    }

    /// Normal distribution with the mean and covariance of a mixture.
    fn mixed(parts: &[(f64, Self)]) -> Self {
        let mut mean = [0.0; 3];
        for (w, part) in parts {
            mean.iter_mut().zip(part.mean).for_each(|(sum, one)| *sum += w * one);
        }
        let mut cells = [0.0; 6];
        for (w, part) in parts {
            let ([x, y, z], p) = ([0, 1, 2].map(|i| part.mean[i] - mean[i]), &part.covariance);
            let of = [
                p[0][0] + x * x,
                p[0][1] + x * y,
                p[0][2] + x * z,
                p[1][1] + y * y,
                p[1][2] + y * z,
                p[2][2] + z * z,
            ];
            cells.iter_mut().zip(of).for_each(|(sum, one)| *sum += w * one);
        }
        Self { mean, covariance: symmetric(cells) }
    }
}

impl Belief {
    /// Position estimate.
    pub(crate) fn point(&self) -> Point2 {
        Point2::new(self.axes[0].mean[0], self.axes[1].mean[0])
    }

    /// Derivative of the position along both axes: 1 for the velocity, 2 for the acceleration.
    pub(crate) fn derivative(&self, order: usize) -> Vector2 {
        Vector2::new(self.axes[0].mean[order], self.axes[1].mean[order])
    }
}

/// Filters the sightings of a past; the estimates are for the instant of the last one. `sigma_m` is the standard
/// deviation of a sighting, and `speed_sigma_mps` that of the initial speed.
pub(crate) fn believe(past: &Past, models: &[Model], sigma_m: f64, speed_sigma_mps: f64) -> Vec<Belief> {
    let first = past.sightings[0];
    let alone = past.sightings.len() == 1;
    let (velocity, speed_variance) = match alone {
        true => (past.reported_mps, 1.0),
        false => (Vector2::default(), speed_sigma_mps * speed_sigma_mps),
    };
    let start = |place_m: f64, speed: f64| Axis {
        mean: [place_m, speed, 0.0],
        covariance: [[sigma_m * sigma_m, 0.0, 0.0], [0.0, speed_variance, 0.0], [0.0, 0.0, 1.0]],
    };
    let axes = [start(first.point.x_m, velocity.x), start(first.point.y_m, velocity.y)];
    let mut beliefs: Vec<Belief> = models.iter().map(|model| Belief { weight: model.prior, axes }).collect();
    let (mut at, mut steps): (Time, Option<Steps>) = (first.at, None);
    for sighting in &past.sightings[1..] {
        let dt_s = (sighting.at - at).as_secs();
        at = sighting.at;
        let steps = match &mut steps {
            Some(steps) if steps.dt_s == dt_s => steps,
            other => other.insert(Steps::over(models, dt_s)),
        };
        take_in(&mut beliefs, steps, (sighting.point, sigma_m * sigma_m));
    }
    beliefs
}

/// Steps of all models between two sightings, reused while the interval is the same.
struct Steps {
    dt_s: f64,
    steps: Vec<Step>,
    /// Probability that the model does not change.
    stay: Vec<f64>,
}

impl Steps {
    fn over(models: &[Model], dt_s: f64) -> Self {
        let stay = |model: &Model| math::exp(-dt_s / model.dwell_s);
        let steps = models.iter().map(|model| model.step(dt_s)).collect();
        Self { dt_s, steps, stay: models.iter().map(stay).collect() }
    }

    /// Transition probability from model `from` to model `to`.
    fn share(&self, from: usize, to: usize) -> f64 {
        match from == to {
            true => self.stay[from],
            false => (1.0 - self.stay[from]) / (self.stay.len() - 1) as f64,
        }
    }
}

/// Largest number of models.
const MODELS: usize = 3;

/// Processes one sighting: the estimates are mixed by transition probabilities, propagated, updated and weighted.
fn take_in(beliefs: &mut [Belief], steps: &Steps, (place, r): (Point2, f64)) {
    let count = beliefs.len().min(MODELS);
    let before: [Belief; MODELS] = core::array::from_fn(|k| beliefs[k.min(count - 1)]);
    let mut off = [[0.0; 2]; MODELS];
    for (to, belief) in beliefs.iter_mut().enumerate() {
        if count > 1 {
            let share = |from: usize| before[from].weight * steps.share(from, to);
            let weight = (0..count).map(share).sum::<f64>().max(1e-12);
            let mix = |axis: usize| {
                let parts: [(f64, Axis); MODELS] = core::array::from_fn(|from| {
                    let from = from.min(count - 1);
                    (share(from) / weight, before[from].axes[axis])
                });
                Axis::mixed(&parts[..count])
            };
            *belief = Belief { weight, axes: [mix(0), mix(1)] };
        }
        let corrected = [(0, place.x_m), (1, place.y_m)]
            .map(|(k, at_m)| belief.axes[k].on(&steps.steps[to]).corrected(at_m, r));
        belief.axes = [corrected[0].0, corrected[1].0];
        let [[x, x_m2], [y, y_m2]] = [corrected[0].1, corrected[1].1];
        off[to] = [x + y, (x_m2 * y_m2).sqrt()];
    }
    let least = off[..count].iter().map(|[squared, _]| *squared).fold(f64::INFINITY, f64::min);
    let mut total = 0.0;
    for (belief, [squared, area]) in beliefs.iter_mut().zip(off) {
        belief.weight *= math::exp(-0.5 * (squared - least)) / area;
        total += belief.weight;
    }
    beliefs.iter_mut().for_each(|belief| belief.weight /= total);
}
