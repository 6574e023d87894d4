//! Predictions by Kalman filters: one mode per motion model.

use swerve_core::Time;
use swerve_geom::{Point2, Vector2, math};
use swerve_msg::{ActorKind, Prediction};

use super::drawn::{Spot, direction, mode};
use super::{Horizon, Modes, Tracked};
use crate::filter::{Belief, Model, Motion, believe};
use crate::past::Past;
use crate::wander::wander;

/// Slowly decaying velocity, with a time constant of 40 s for pedestrians.
const ON: Model = Model { motion: Motion::Fading(40.0), density: 0.1, prior: 0.8, dwell_s: 4.0 };
/// Turn and acceleration that decay within a second.
const TURN: Model = Model { motion: Motion::Turning(1.0), density: 0.3, prior: 0.15, dwell_s: 2.0 };
/// Stop within one or two seconds.
const STOP: Model = Model { motion: Motion::Fading(0.8), density: 0.3, prior: 0.05, dwell_s: 2.0 };

/// [`super::PredictorName::Kalman`].
pub(super) const KALMAN: &[Model] = &[Model { prior: 1.0, ..ON }];
/// [`super::PredictorName::Ctra`].
pub(super) const CTRA: &[Model] = &[Model { prior: 1.0, ..TURN }];
/// [`super::PredictorName::Imm`].
pub(super) const IMM: &[Model] = &[ON, TURN, STOP];

/// Largest integration step of the turning model, seconds.
const ROLL_STEP_S: f64 = 0.1;

/// Adapts a model to a kind of actor: compared with pedestrians, wheeled actors have a velocity decay four times as
/// slow, and larger process noise.
fn of_kind(model: &Model, kind: ActorKind) -> Model {
    if matches!(kind, ActorKind::Pedestrian | ActorKind::Static) {
        return *model;
    }
    match model.motion {
        Motion::Fading(tau_s) => {
            Model { motion: Motion::Fading(4.0 * tau_s), density: 8.0 * model.density, ..*model }
        }
        Motion::Turning(_) => Model { density: 10.0 * model.density, ..*model },
    }
}

/// Predictions with one mode per model.
pub(super) fn predictions(seen: &[Tracked], stamp: Time, horizon: &Horizon, models: &[Model]) -> Vec<Modes> {
    let of_one = |seen: &Tracked| {
        let models: Vec<Model> = models.iter().map(|model| of_kind(model, seen.past.kind)).collect();
        let beliefs = beliefs(&seen.past, &models);
        models.iter().zip(&beliefs).map(|pair| foretold(seen, stamp, horizon, pair)).collect()
    };
    seen.iter().map(of_one).collect()
}

/// Estimates of the models from a past, with the noise of its kind.
pub(super) fn beliefs(past: &Past, models: &[Model]) -> Vec<Belief> {
    let speed_sigma_mps = if past.kind == ActorKind::Pedestrian { 1.5 } else { 15.0 };
    believe(past, models, wander(past.kind).sighting_m, speed_sigma_mps)
}

/// Mode of one model: its mean over the horizon, with the covariance of recorded actors.
fn foretold(
    seen: &Tracked,
    stamp: Time,
    horizon: &Horizon,
    (model, belief): (&Model, &Belief),
) -> Prediction {
    let wander = wander(seen.past.kind);
    let unseen_s = (stamp - seen.past.last().at).as_secs();
    let along = direction(belief.derivative(1), seen.track.pose.heading_rad);
    let mut rolled = Rolled::of(belief);
    let mut until_s = 0.0;
    let spots: Vec<Spot> = (0..=horizon.steps)
        .map(|k| {
            let t_s = unseen_s + horizon.step.as_secs() * k as f64;
            let point = match model.motion {
                Motion::Fading(tau_s) => {
                    belief.point() + belief.derivative(1) * (tau_s * (1.0 - math::exp(-t_s / tau_s)))
                }
                Motion::Turning(tau_s) => {
                    rolled.on(t_s - until_s, tau_s);
                    rolled.point
                }
            };
            until_s = t_s;
            (point, wander.covariance_m2(along, t_s))
        })
        .collect();
    mode(belief.weight, seen, stamp, (horizon, &spots))
}

/// Motion with decaying yaw rate and acceleration.
struct Rolled {
    point: Point2,
    heading_rad: f64,
    speed_mps: f64,
    /// Acceleration along the motion, m/s².
    gain_mps2: f64,
    yaw_rate_radps: f64,
}

impl Rolled {
    fn of(belief: &Belief) -> Self {
        let (velocity, acceleration): (Vector2, Vector2) = (belief.derivative(1), belief.derivative(2));
        let speed_mps = velocity.norm();
        let along = velocity * (1.0 / speed_mps.max(1e-6));
        // At very low speed, the yaw rate is limited.
        let yaw_rate_radps = along.cross(acceleration) / speed_mps.max(0.5);
        Self {
            point: belief.point(),
            heading_rad: velocity.heading(),
            speed_mps,
            gain_mps2: along.dot(acceleration),
            yaw_rate_radps: yaw_rate_radps.clamp(-1.0, 1.0),
        }
    }

    /// Advances by `dt_s`; the speed does not become negative.
    fn on(&mut self, dt_s: f64, tau_s: f64) {
        let steps = (dt_s / ROLL_STEP_S).ceil().max(1.0);
        let (step_s, left) = (dt_s / steps, math::exp(-dt_s / steps / tau_s));
        for _ in 0..steps as usize {
            let mean_mps = (self.speed_mps + 0.5 * self.gain_mps2 * step_s).max(0.0);
            let middle_rad = self.heading_rad + 0.5 * self.yaw_rate_radps * step_s;
            self.point = self.point + Vector2::from_heading(middle_rad) * (mean_mps * step_s);
            self.heading_rad += self.yaw_rate_radps * step_s;
            self.speed_mps = (self.speed_mps + self.gain_mps2 * step_s).max(0.0);
            self.gain_mps2 *= left;
            self.yaw_rate_radps *= left;
        }
    }
}
