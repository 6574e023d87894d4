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

/// A model's step: all but the corner of its transition, row by row, and the noise that comes on it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Step {
    /// From velocity and acceleration to the place, and those two on.
    place: [f64; 2],
    speed: [f64; 2],
    gain: f64,
    /// Covariance above and on the diagonal: 00, 01, 02, 11, 12, 22.
    noise: [f64; 6],
}

impl Model {
    /// Over `dt_s`.
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
                    // White jerk over a step that is short beside the time constant.
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

/// A covariance by what is above and on its diagonal.
fn symmetric([a, b, c, d, e, f]: [f64; 6]) -> Matrix {
    [[a, b, c], [b, d, e], [c, e, f]]
}

impl Axis {
    /// Moved on.
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

    /// With a sighting of variance `r` taken in; how many deviations it was off, squared, and what these were, squared.
    fn corrected(&self, place_m: f64, r: f64) -> (Self, [f64; 2]) {
        let p = &self.covariance;
        let (off, s) = (place_m - self.mean[0], p[0][0] + r);
        let gain = [p[0][0] / s, p[0][1] / s, p[0][2] / s];
        let mean = [0, 1, 2].map(|i| self.mean[i] + gain[i] * off);
        let left = |i: usize, j: usize| p[i][j] - gain[i] * p[0][j];
        // Of the place itself in a form that does not lose digits.
        let covariance = symmetric([gain[0] * r, left(0, 1), left(0, 2), left(1, 1), left(1, 2), left(2, 2)]);
        (Self { mean, covariance }, [off * off / s, s])
    }

    /// The normal distribution with a mixture's mean and covariance.
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

/// What all models do from one sighting to the next: the same as long as these are equally far apart.
struct Steps {
    dt_s: f64,
    steps: Vec<Step>,
    /// Share of those who go on so.
    stay: Vec<f64>,
}

impl Steps {
    fn over(models: &[Model], dt_s: f64) -> Self {
        let stay = |model: &Model| math::exp(-dt_s / model.dwell_s);
        let steps = models.iter().map(|model| model.step(dt_s)).collect();
        Self { dt_s, steps, stay: models.iter().map(stay).collect() }
    }

    /// Share of those who did as model `from` has it and now do as `to`.
    fn share(&self, from: usize, to: usize) -> f64 {
        match from == to {
            true => self.stay[from],
            false => (1.0 - self.stay[from]) / (self.stay.len() - 1) as f64,
        }
    }
}

/// Models at most.
const MODELS: usize = 3;

/// One sighting: beliefs are mixed by who may have become what, moved on, corrected and weighed.
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
