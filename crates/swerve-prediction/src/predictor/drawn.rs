//! Conversion of positions and covariances to the modes of a prediction.

use swerve_core::Time;
use swerve_geom::{Point2, Pose2, Vector2};
use swerve_msg::{PredictedPose, Prediction, Track};

use super::{Horizon, Modes, Tracked};
use crate::linear::HEADING_SPEED_MPS;
use crate::wander::wander;

/// A position, and its covariance xx, xy, yy in m².
pub(super) type Spot = (Point2, [f64; 3]);

/// Direction of a motion; that of `heading_rad` below the speed at which it is defined.
pub(super) fn direction(velocity_mps: Vector2, heading_rad: f64) -> Vector2 {
    let speed_mps = velocity_mps.norm();
    if speed_mps > HEADING_SPEED_MPS {
        velocity_mps * (1.0 / speed_mps)
    } else {
        Vector2::from_heading(heading_rad)
    }
}

/// A mode through these positions, one for each instant; headings are those of the motion.
pub(super) fn mode(
    probability: f64,
    seen: &Tracked,
    stamp: Time,
    (horizon, spots): (&Horizon, &[Spot]),
) -> Prediction {
    let mut heading_rad = seen.track.pose.heading_rad;
    let least_m = HEADING_SPEED_MPS * horizon.step.as_secs();
    let path = horizon.instants(stamp).zip(spots).enumerate().map(|(k, (at, (point, _)))| {
        let on = match spots.get(k + 1) {
            Some((next, _)) => *next - *point,
            None => *point - spots[k.saturating_sub(1)].0,
        };
        if on.norm() > least_m {
            heading_rad = on.heading();
        }
        PredictedPose { at, pose: Pose2::new(point.x_m, point.y_m, heading_rad) }
    });
    let Track { id, kind, extent, .. } = *seen.track;
    let covariances_m2 = spots.iter().map(|(_, covariance_m2)| *covariance_m2).collect();
    Prediction { id, kind, extent, probability, path: path.collect(), covariances_m2 }
}

/// A single mode through these points, with the covariances of the actor's kind.
pub(super) fn single(seen: &Tracked, stamp: Time, horizon: &Horizon, points: &[Point2]) -> Modes {
    let spots = spread(seen, stamp, horizon, points);
    vec![mode(1.0, seen, stamp, (horizon, &spots))]
}

/// Adds the covariances of the actor's kind to points.
pub(super) fn spread(seen: &Tracked, stamp: Time, horizon: &Horizon, points: &[Point2]) -> Vec<Spot> {
    let (wander, step_s) = (wander(seen.past.kind), horizon.step.as_secs());
    let unseen_s = (stamp - seen.past.last().at).as_secs();
    let spot = |(k, point): (usize, &Point2)| {
        let from = points[k.saturating_sub(1)];
        let on = if k == 0 {
            points.get(1).map_or(Vector2::default(), |next| *next - *point)
        } else {
            *point - from
        };
        let direction = direction(on * (1.0 / step_s), seen.track.pose.heading_rad);
        (*point, wander.covariance_m2(direction, unseen_s + step_s * k as f64))
    };
    points.iter().enumerate().map(spot).collect()
}
