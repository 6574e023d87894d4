//! Kalman filters over one actor's sightings: several models of motion at once, each weighed by how well it foretold them
//! (interacting multiple models: Blom and Bar-Shalom 1988).
//!
//! Position, velocity and acceleration along each axis of the map; both axes are filtered alike and apart.

use swerve_core::Time;
use swerve_geom::{Point2, Vector2, math};

use crate::past::Past;

type Vector = [f64; 3];
type Matrix = [[f64; 3]; 3];

/// How a model has an actor move.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Motion {
    /// The velocity dies away with this time constant, seconds.
    Fading(f64),
    /// The acceleration dies away with this time constant, seconds (Singer 1970).
    Turning(f64),
}

/// A model, and how far it is from what actors do.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Model {
    pub(crate) motion: Motion,
    /// Density of the white acceleration, m²/s³; under [`Motion::Turning`] of the jerk, m²/s⁵.
    pub(crate) density: f64,
    /// Share of actors that begin so.
    pub(crate) prior: f64,
    /// How long an actor goes on so, seconds.
    pub(crate) dwell_s: f64,
}

/// A model's mean and covariance along one axis.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Axis {
    pub(crate) mean: Vector,
    pub(crate) covariance: Matrix,
}

/// What a model makes of the past.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Belief {
    /// The model's share, 0 to 1.
    pub(crate) weight: f64,
    /// Along x and along y.
    pub(crate) axes: [Axis; 2],
}

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    let cell = |i: usize, j: usize| a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| cell(i, j)))
}

fn transposed(a: &Matrix) -> Matrix {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| a[j][i]))
}

fn plus(a: &Matrix, b: &Matrix) -> Matrix {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| a[i][j] + b[i][j]))
}

impl Model {
    /// Transition over `dt_s`, and the noise that comes on it.
    fn step(&self, dt_s: f64) -> (Matrix, Matrix) {
        let (t, q) = (dt_s, self.density);
        match self.motion {
            Motion::Fading(tau_s) => {
                let left = math::exp(-t / tau_s);
                let noise =
                    [[q * t * t * t / 3.0, q * t * t / 2.0, 0.0], [q * t * t / 2.0, q * t, 0.0], [0.0; 3]];
                ([[1.0, tau_s * (1.0 - left), 0.0], [0.0, left, 0.0], [0.0; 3]], noise)
            }
            Motion::Turning(tau_s) => {
                let left = math::exp(-t / tau_s);
                let gained = tau_s * (1.0 - left);
                let transition = [[1.0, t, tau_s * (t - gained)], [0.0, 1.0, gained], [0.0, 0.0, left]];
                // White jerk over a step that is short beside the time constant.
                let (t2, t3) = (t * t, t * t * t);
                let noise = [
                    [q * t3 * t2 / 20.0, q * t2 * t2 / 8.0, q * t3 / 6.0],
                    [q * t2 * t2 / 8.0, q * t3 / 3.0, q * t2 / 2.0],
                    [q * t3 / 6.0, q * t2 / 2.0, q * t],
                ];
                (transition, noise)
            }
        }
    }
}

impl Axis {
    /// Moved on by a model.
    pub(crate) fn on(&self, model: &Model, dt_s: f64) -> Self {
        let (f, q) = model.step(dt_s);
        let m = &self.mean;
        let mean = [0, 1, 2].map(|i| f[i][0] * m[0] + f[i][1] * m[1] + f[i][2] * m[2]);
        Self { mean, covariance: plus(&times(&times(&f, &self.covariance), &transposed(&f)), &q) }
    }

    /// With a sighting of variance `r` taken in, and the logarithm of its likelihood.
    fn corrected(&self, place_m: f64, r: f64) -> (Self, f64) {
        let p = &self.covariance;
        let (off, s) = (place_m - self.mean[0], p[0][0] + r);
        let gain = [p[0][0] / s, p[1][0] / s, p[2][0] / s];
        let mean = [0, 1, 2].map(|i| self.mean[i] + gain[i] * off);
        // Joseph's form for a measured position.
        let keep: Matrix = [0, 1, 2]
            .map(|i| [0, 1, 2].map(|j| f64::from(u8::from(i == j)) - if j == 0 { gain[i] } else { 0.0 }));
        let noise = [0, 1, 2].map(|i| [0, 1, 2].map(|j| gain[i] * r * gain[j]));
        let covariance = plus(&times(&times(&keep, p), &transposed(&keep)), &noise);
        (Self { mean, covariance }, -0.5 * (off * off / s + math::ln(core::f64::consts::TAU * s)))
    }

    /// The normal distribution with a mixture's mean and covariance.
    fn mixed(parts: impl Iterator<Item = (f64, Self)> + Clone) -> Self {
        let mean = [0, 1, 2].map(|i| parts.clone().map(|(w, part)| w * part.mean[i]).sum::<f64>());
        let cell = |i: usize, j: usize| {
            let one = |(w, part): (f64, Self)| {
                w * (part.covariance[i][j] + (part.mean[i] - mean[i]) * (part.mean[j] - mean[j]))
            };
            parts.clone().map(one).sum::<f64>()
        };
        Self { mean, covariance: [0, 1, 2].map(|i| [0, 1, 2].map(|j| cell(i, j))) }
    }
}

impl Belief {
    /// Where it is.
    pub(crate) fn point(&self) -> Point2 {
        Point2::new(self.axes[0].mean[0], self.axes[1].mean[0])
    }

    /// Along both axes: 1 for the velocity, 2 for the acceleration.
    pub(crate) fn derivative(&self, order: usize) -> Vector2 {
        Vector2::new(self.axes[0].mean[order], self.axes[1].mean[order])
    }
}

/// What the models make of a past, at the instant of its last sighting; `sigma_m` is what a sighting is off by and
/// `speed_sigma_mps` how fast such actors are.
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
    let mut at: Time = first.at;
    for sighting in &past.sightings[1..] {
        let dt_s = (sighting.at - at).as_secs();
        at = sighting.at;
        take_in(&mut beliefs, models, dt_s, (sighting.point, sigma_m * sigma_m));
    }
    beliefs
}

/// One sighting after `dt_s`: beliefs are mixed by who may have become what, moved on, corrected and weighed.
fn take_in(beliefs: &mut Vec<Belief>, models: &[Model], dt_s: f64, (place, r): (Point2, f64)) {
    let share = |from: usize, to: usize| {
        let stays = math::exp(-dt_s / models[from].dwell_s);
        if from == to { stays } else { (1.0 - stays) / (models.len() - 1) as f64 }
    };
    let mixed: Vec<Belief> = (0..models.len())
        .map(|to| {
            let parts: Vec<f64> =
                (0..models.len()).map(|from| beliefs[from].weight * share(from, to)).collect();
            let weight = parts.iter().sum::<f64>().max(1e-12);
            let mix = |axis: usize| {
                Axis::mixed(
                    parts.iter().zip(beliefs.iter()).map(move |(w, belief)| (w / weight, belief.axes[axis])),
                )
            };
            Belief { weight, axes: if models.len() == 1 { beliefs[0].axes } else { [mix(0), mix(1)] } }
        })
        .collect();
    let corrected = mixed.iter().zip(models).map(|(belief, model)| {
        let [(x, x_ln), (y, y_ln)] = [(0, place.x_m), (1, place.y_m)]
            .map(|(k, at_m)| belief.axes[k].on(model, dt_s).corrected(at_m, r));
        (Belief { weight: belief.weight, axes: [x, y] }, math::ln(belief.weight) + x_ln + y_ln)
    });
    let corrected: Vec<(Belief, f64)> = corrected.collect();
    let largest = corrected.iter().map(|(_, ln)| *ln).fold(f64::NEG_INFINITY, f64::max);
    let total: f64 = corrected.iter().map(|(_, ln)| math::exp(ln - largest)).sum();
    *beliefs = corrected
        .into_iter()
        .map(|(belief, ln)| Belief { weight: math::exp(ln - largest) / total, ..belief })
        .collect();
}
