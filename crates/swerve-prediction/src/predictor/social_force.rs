//! Social force model of pedestrians (Helbing and Molnár 1995, equations 2 to 6).
//!
//! Pedestrians aim to keep their present velocity; others repel them with a potential that decays with distance, at
//! half strength from behind. Wheeled actors move straight ahead and repel too.

use swerve_core::Time;
use swerve_geom::{Point2, Vector2};
use swerve_msg::ActorKind;
use swerve_road_user::social_force::{self, TOUCH_M};

use super::drawn::single;
use super::straight::VELOCITY_WINDOW_S;
use super::{Horizon, Modes, Tracked};

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
            let drive = social_force::drive(self.velocity_mps, self.wanted_mps);
            self.velocity_mps =
                social_force::limited(self.velocity_mps + (drive + push) * step_s, self.wanted_mps);
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
    others.fold(Vector2::default(), |sum, (_, other)| {
        let away = me.point - other.point;
        sum + social_force::push(away, me.wanted_mps, other.velocity_mps, other.extra_radius_m)
    })
}
