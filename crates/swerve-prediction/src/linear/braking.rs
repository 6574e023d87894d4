//! Estimation of a vehicle's deceleration from its past positions.

use swerve_core::Time;
use swerve_geom::{Point2, Vector2};
use swerve_msg::{ActorKind, Sighting, Track};

use super::line::{DEVIATIONS, Line};

/// Smallest number of sightings for an estimate, and the shortest time that they must span, seconds.
const SIGHTINGS_MIN: usize = 6;
const SPAN_MIN_S: f64 = 0.25;

/// Smallest significant deceleration, m/s²: coasting vehicles decelerate less.
const BRAKE_MIN_MPS2: f64 = 0.5;

/// Largest deceleration of a vehicle on a dry road, m/s².
const BRAKE_MAX_MPS2: f64 = 10.0;

/// Speed below which a vehicle has no defined direction of braking, m/s.
const SPEED_MIN_MPS: f64 = 0.5;

/// A straight motion with constant deceleration to rest.
#[derive(Clone, Copy)]
pub(crate) struct Braking {
    /// Position and velocity at the stamp.
    pub(super) line: Line,
    /// Time until it is at rest, seconds.
    stop_s: f64,
}

impl Braking {
    /// Detects a significant deceleration of a vehicle along its motion over the last `window_s`, by a least-squares
    /// parabola and the standard deviation of its residuals. `None` if there is none.
    pub(crate) fn of(track: &Track, stamp: Time, window_s: f64) -> Option<Self> {
        if matches!(track.kind, ActorKind::Pedestrian | ActorKind::Static) {
            return None;
        }
        // Stamps are whole nanoseconds, window lengths are not.
        let recent = track.history.partition_point(|one| (stamp - one.at).as_secs() > window_s + 1e-6);
        let sightings = &track.history[recent..];
        let ([first, .., last], true) = (sightings, sightings.len() >= SIGHTINGS_MIN) else { return None };
        let span_s = (last.at - first.at).as_secs();
        let way = last.point - first.point;
        if span_s < SPAN_MIN_S || way.norm() < SPEED_MIN_MPS * span_s {
            return None;
        }
        let forwards = way * (1.0 / way.norm());
        let Parabola { place_m, speed_mps, accel_mps2, accel_sigma_mps2 } =
            Parabola::fit(sightings, stamp, last.point, forwards)?;
        let brake_mps2 = (-accel_mps2).min(BRAKE_MAX_MPS2);
        if speed_mps <= SPEED_MIN_MPS || brake_mps2 < BRAKE_MIN_MPS2 + DEVIATIONS * accel_sigma_mps2 {
            return None;
        }
        let line = Line { point: last.point + forwards * place_m, velocity_mps: forwards * speed_mps };
        Some(Self { line, stop_s: speed_mps / brake_mps2 })
    }

    /// Position after `ahead_s`.
    pub(crate) fn at(&self, ahead_s: f64) -> Point2 {
        self.line.point + self.line.velocity_mps * self.driven_s(ahead_s)
    }

    /// Time at the initial speed that covers the same distance as `ahead_s` of braking, seconds.
    pub(super) fn driven_s(&self, ahead_s: f64) -> f64 {
        let t_s = ahead_s.min(self.stop_s);
        t_s - 0.5 * t_s * t_s / self.stop_s
    }
}

/// Motion along a direction at constant acceleration.
struct Parabola {
    /// Distance from the origin at the stamp, metres.
    place_m: f64,
    speed_mps: f64,
    accel_mps2: f64,
    /// Standard deviation of the acceleration.
    accel_sigma_mps2: f64,
}

impl Parabola {
    /// Least-squares fit over `sightings`, along `forwards` from `origin`, evaluated at `stamp`.
    fn fit(sightings: &[Sighting], stamp: Time, origin: Point2, forwards: Vector2) -> Option<Self> {
        let n = sightings.len() as f64;
        let samples =
            || sightings.iter().map(|one| ((one.at - stamp).as_secs(), (one.point - origin).dot(forwards)));
        let middle_s = samples().map(|(t, _)| t).sum::<f64>() / n;
        // Orthogonal polynomials 1, u and u² - a u - b over the instants of the samples.
        let sum = |f: &dyn Fn(f64, f64) -> f64| samples().map(|(t, x)| f(t - middle_s, x)).sum::<f64>();
        let uu = sum(&|u, _| u * u);
        let (a, b) = (sum(&|u, _| u * u * u) / uu, uu / n);
        let curve = |u: f64| u * u - a * u - b;
        let cc = sum(&|u, _| curve(u) * curve(u));
        if uu <= 0.0 || cc <= 0.0 {
            return None;
        }
        let mean = sum(&|_, x| x) / n;
        let slope = sum(&|u, x| u * x) / uu;
        let bend = sum(&|u, x| curve(u) * x) / cc;
        let at = |u: f64| mean + slope * u + bend * curve(u);
        let residual = sum(&|u, x| (x - at(u)) * (x - at(u)));
        let now = -middle_s;
        Some(Self {
            place_m: at(now),
            speed_mps: slope + bend * (2.0 * now - a),
            accel_mps2: 2.0 * bend,
            accel_sigma_mps2: 2.0 * (residual / (n - 3.0) / cc).sqrt(),
        })
    }
}
