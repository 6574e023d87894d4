//! Social force model of pedestrians (Helbing and Molnár 1995, equations 2 to 6).
//!
//! Pedestrians aim to keep their present velocity; others repel them with a potential that decays with distance, at
//! half strength from behind. Wheeled actors move straight ahead and repel too.

use swerve_core::Time;
use swerve_geom::{Point2, Vector2, math};
use swerve_msg::ActorKind;

use super::drawn::single;
use super::straight::VELOCITY_WINDOW_S;
use super::{Horizon, Modes, Tracked};

/// Time constant with which the desired velocity is approached, seconds.
const RELAXATION_S: f64 = 0.5;
/// Potential at zero distance, m²/s², and distance over which it falls to 1/e, metres.
const POTENTIAL_M2PS2: f64 = 2.1;
const RANGE_M: f64 = 0.3;
/// Look-ahead for the others' next step, seconds.
const NEXT_STEP_S: f64 = 2.0;
/// Weight of forces from outside the field of view, and half of its angle as a cosine (100°).
const UNSEEN_SHARE: f64 = 0.5;
const SIGHT_COS: f64 = -0.173_648;
/// Largest speed of a pedestrian, as a ratio to the desired speed.
const SPEED_SHARE_MAX: f64 = 1.3;
/// Distance of the centres of two pedestrians in contact, metres.
const TOUCH_M: f64 = 0.6;
/// Range of the force, metres: beyond, less than a hundred-thousandth is left.
const REACH_M: f64 = 5.0;
/// Largest integration step, seconds.
const STEP_S: f64 = 0.1;

/// A simulated road user.
struct Walker {
    point: Point2,
    velocity_mps: Vector2,
    wanted_mps: Vector2,
    walks: bool,
    /// Radius in excess of a pedestrian's, metres.
    extra_radius_m: f64,
}

/// Predictions with one mode per actor.
pub(super) fn predictions(seen: &[Tracked], stamp: Time, horizon: &Horizon) -> Vec<Modes> {
    let mut walkers: Vec<Walker> = seen.iter().map(|seen| Walker::of(seen, stamp)).collect();
    let mut paths: Vec<Vec<Point2>> = walkers.iter().map(|walker| vec![walker.point]).collect();
    let steps = (horizon.step.as_secs() / STEP_S).ceil().max(1.0);
    let step_s = horizon.step.as_secs() / steps;
    for _ in 0..horizon.steps {
        for _ in 0..steps as usize {
            let pushes: Vec<Vector2> = (0..walkers.len()).map(|k| push(&walkers, k)).collect();
            walkers.iter_mut().zip(pushes).for_each(|(walker, push)| walker.on(push, step_s));
        }
        paths.iter_mut().zip(&walkers).for_each(|(path, walker)| path.push(walker.point));
    }
    seen.iter().zip(&paths).map(|(seen, path)| single(seen, stamp, horizon, path)).collect()
}

impl Walker {
    fn of(seen: &Tracked, stamp: Time) -> Self {
        let velocity_mps = seen.past.velocity_mps(VELOCITY_WINDOW_S);
        let extent = seen.track.extent;
        Self {
            point: seen.past.now(stamp, velocity_mps),
            velocity_mps,
            wanted_mps: velocity_mps,
            walks: seen.past.kind == ActorKind::Pedestrian,
            extra_radius_m: (0.5 * extent.length_m.max(extent.width_m) - 0.5 * TOUCH_M).max(0.0),
        }
    }

    fn on(&mut self, push: Vector2, step_s: f64) {
        if self.walks {
            let drive = (self.wanted_mps - self.velocity_mps) * (1.0 / RELAXATION_S);
            let velocity_mps = self.velocity_mps + (drive + push) * step_s;
            let (speed, most) = (velocity_mps.norm(), SPEED_SHARE_MAX * self.wanted_mps.norm());
            self.velocity_mps = if speed > most { velocity_mps * (most / speed) } else { velocity_mps };
        }
        self.point = self.point + self.velocity_mps * step_s;
    }
}

/// Sum of the forces of all others on walker `k`, m/s².
fn push(walkers: &[Walker], k: usize) -> Vector2 {
    let me = &walkers[k];
    if !me.walks {
        return Vector2::default();
    }
    let others = walkers.iter().enumerate().filter(|(j, _)| *j != k);
    others.fold(Vector2::default(), |sum, (_, other)| sum + push_of(me, other))
}

/// Equations 3 to 6: equipotential lines are ellipses that extend ahead of the other by its next step.
fn push_of(me: &Walker, other: &Walker) -> Vector2 {
    let away: Vector2 = me.point - other.point;
    let apart_m = away.norm();
    let step: Vector2 = other.velocity_mps * NEXT_STEP_S;
    let away_next = away - step;
    let apart_next_m = away_next.norm();
    if apart_m < 1e-9 || apart_next_m < 1e-9 || apart_m.min(apart_next_m) > REACH_M {
        return Vector2::default();
    }
    let both_m = apart_m + apart_next_m;
    let half_axis_m = 0.5 * (both_m * both_m - step.norm_squared()).max(1e-6).sqrt();
    let slope = (away * (1.0 / apart_m) + away_next * (1.0 / apart_next_m)) * (both_m / (4.0 * half_axis_m));
    let gap_m = (half_axis_m - other.extra_radius_m).max(0.0);
    let force = slope * (POTENTIAL_M2PS2 / RANGE_M * math::exp(-gap_m / RANGE_M));
    // Forces from ahead are within the field of view.
    let ahead = -me.wanted_mps.dot(force) >= SIGHT_COS * force.norm() * me.wanted_mps.norm();
    force * if ahead { 1.0 } else { UNSEEN_SHARE }
}
